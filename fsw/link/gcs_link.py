"""One link to the ground: telemetry out, commands in, services both ways.

Received data never raises, and only valid frames change the state of the link.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import InitVar, asdict, dataclass
from typing import Final

from fsw.autopilot.ports import Clock, LinkLosses
from fsw.autopilot.signals import (
    CommandAck,
    FlightSnapshot,
    MessageSource,
    Severity,
    StatusText,
    TickOutputs,
)
from fsw.link.bounded_memory import BoundedRecord, RecordFrame, SentFrames, renew
from fsw.link.endpoints import open_endpoint
from fsw.link.inbox import Inbox
from fsw.link.outbox import Outbox, packed
from fsw.link.peers import Arrivals, Peers
from fsw.link.services.service import Dispatch, LinkService
from fsw.link.signing.signing import FrameTrust, Signing, set_up_signing
from fsw.link.telemetry.stream_rates import TELEMETRY, LineBudget, LinkCommands, StreamRates
from fsw.link.telemetry.streams import AT_ONCE, HEARTBEAT, STREAMS, Stream
from fsw.link.wire.decode import for_this_vehicle
from fsw.link.wire.encode_standard import command_ack
from fsw.link.wire.outgoing import TelemetryContext
from messages import dialect, message_ids
from messages.addresses import Address, LinkAddress
from messages.frames import Frame, Losses, as_version_1, is_version_1
from messages.message_ids import AUTOPILOT, SYSTEM_ID

_FRAME_COST: Final = 32  # bytes for each frame: a small one may ask for as much as a large one
_MAX_UNHANDLED: Final = 64  # kinds of messages, counted one by one
_MAX_SPEAKERS: Final = 32  # twice the commands of a tick, which are answered after it
_MEASURED_S: Final = 3  # calls of ``news``, one a second
_HOUSEKEEPING_US: Final = 1_000_000
_MESSAGE_ID: Final = slice(7, 10)  # in a frame
# Not recorded: a log that is downloaded while it is written would grow by what is sent of it.
# Neither remembered, for they would fill the memory and do nothing when they come back.
_FILE_DATA: Final = frozenset(
    id_.to_bytes(3, "little")
    for id_ in (
        message_ids.LOG_DATA,
        message_ids.LOGGING_DATA,
        message_ids.LOGGING_DATA_ACKED,
        message_ids.FILE_TRANSFER_PROTOCOL,
    )
)


@dataclass(frozen=True, slots=True)
class LinkSetup:
    """Configuration of one link."""

    name: str  # in fsw.json
    target: LinkAddress  # peer that is spoken to first
    local_port: int  # of UDP, if it is free
    rates_hz: tuple[float, ...]  # of each stream
    unheard: bool  # whether everything is sent before anybody has been heard
    remote: bool = False  # whether other machines are heard though the target is this one


@dataclass(eq=False)
class GcsLink:
    """Serves the configured peer and the peers that send valid frames."""

    _setup: LinkSetup
    _inbox: Inbox
    _context: TelemetryContext
    signing: Signing
    _clock: Clock  # wall time
    record: InitVar[RecordFrame | None]  # takes all frames of both directions
    services: InitVar[Sequence[LinkService]]
    _sent: SentFrames  # of all links: known again on each
    accepted: int = 0  # frames
    echoes: int = 0  # frames of ours that came back: dropped
    elsewhere: int = 0  # accepted frames for another system or component

    def __post_init__(self, record: RecordFrame | None, services: Sequence[LinkService]) -> None:
        setup, context, clock = self._setup, self._context, self._clock
        self.name = setup.name
        self.losses = Losses()
        self.outbox = Outbox(self.signing)
        self.dispatch = Dispatch(services, self.outbox.add_output)
        self.unhandled: dict[int, int] = {}  # accepted frames of no use here, by message
        handled = (self._inbox.message_ids, self.dispatch.message_ids, {message_ids.SETUP_SIGNING})
        self._handled = frozenset[int]().union(*handled)
        self._endpoint, peer = open_endpoint(
            setup.target, clock, setup.local_port, remote=setup.remote
        )
        self.arrivals = Arrivals(self._endpoint, self.losses)
        carried = self._endpoint.bytes_per_s
        self._line = None if carried is None else LineBudget(carried, clock)
        self.rates = StreamRates(
            STREAMS,
            setup.rates_hz,
            context.facts.tick_period_us,
            max_bytes_s=None if carried is None else TELEMETRY * carried,
        )
        self._looks = 0  # for news
        self._told_slow = False
        self.talks = setup.unheard  # whether more than a heartbeat is sent
        self.peers = Peers(peer)
        self._received, self._told = BoundedRecord(record), BoundedRecord(record)
        self._commands = LinkCommands(self.rates, context, services)
        self._snapshot: FlightSnapshot | None = None
        self._speakers: dict[tuple[int, int], None] = {}  # the one heard last is the last
        self._housekeeping_us = 0

    @property
    def port(self) -> int | None:
        """The local UDP port, where ground stations answer to; None of a stream."""
        return self._endpoint.port

    @property
    def dropped(self) -> int | None:
        """Datagrams that were not read in time and were dropped; None: the kernel's not known."""
        kernel = self._endpoint.dropped
        return None if kernel is None else kernel + self.arrivals.dropped

    @property
    def received(self) -> int:
        """Datagrams that came since the start, those that were dropped too."""
        return self.arrivals.read + (self._endpoint.dropped or 0)

    @property
    def is_heard(self) -> bool:
        """Whether it has a client."""
        return bool(self.peers.last_received_us)

    def fileno(self) -> int:
        """The socket, to wait for."""
        return self._endpoint.fileno()

    def hears(self, system: int, component: int) -> bool:
        """Whether a component has spoken on this link, lately where many have."""
        return (system, component) in self._speakers

    def read(self, t_us: int, budget: int) -> int:
        """Take frames that are there, and answer them; returns what is left of the budget.

        What lies beyond the budget [bytes] waits until its sender's turn, and is lost if it becomes
        too much. A small frame may ask for as much as a large one, so each costs something, and
        what is answered as much as what asks.
        """
        while budget > 0:
            self.arrivals.fetch(self.peers.all)
            begun = self.arrivals.begin()
            if begun is None:
                break
            budget -= begun
            found = self.arrivals.take()
            if found is None:
                continue
            frame, raw = found
            waiting = self.outbox.bytes
            if frame.system_id == SYSTEM_ID and raw in self._sent:
                self.echoes += 1
            else:
                self._take(t_us, frame, raw, self.arrivals.sender)
            budget -= _FRAME_COST + self.outbox.bytes - waiting
        if self.outbox.bytes:
            self._send(t_us)
        return budget

    def announce(self, snapshot: FlightSnapshot, changed: bool) -> None:
        """Send a heartbeat to a link without a client; see :meth:`publish`."""
        self._snapshot = snapshot
        if changed or snapshot.t_us >= self._housekeeping_us:
            self._housekeeping_us = snapshot.t_us + _HOUSEKEEPING_US
            self._encode(HEARTBEAT, snapshot)
            self._send(snapshot.t_us)

    def serve(self, t_us: int) -> None:
        """Let services go on with what they are sending, if it talks.

        Every tick while one was asked or has answered lately; otherwise once a slot is enough, for
        what it says without being asked.
        """
        if self._line is None or self._line.has_room():
            self.dispatch.poll(t_us)
        if self.outbox.bytes:
            self._send(t_us)

    def serve_bulk(self, t_us: int) -> bool:
        """Send a datagram of what clients wait for; whether there was anything, and room."""
        if self._line is not None and not self._line.has_room():
            return False
        if not self.dispatch.bulk(t_us):
            return False
        self._send(t_us)
        return True

    def publish(self, outputs: TickOutputs, changed: bool) -> None:
        """Send what is due to all peers; at once if mode, arming, landing or health ``changed``."""
        snapshot = self._snapshot = outputs.snapshot
        if changed:
            for stream in AT_ONCE:
                self._encode(stream, snapshot)
        has_room = self._line is None or self._line.takes_telemetry()
        for stream in self.rates.due(snapshot.t_us):
            if has_room or stream.vital:
                self._encode(stream, snapshot)
        for text in outputs.texts:
            self.outbox.add_text(text, snapshot.t_us)
        if snapshot.t_us >= self._housekeeping_us:
            self._housekeeping_us = snapshot.t_us + _HOUSEKEEPING_US
            self.outbox.add_overdue_texts(snapshot.t_us)
            self.peers.expire(self._clock())
            self.rates.heard_by(frozenset(self.peers.last_received_us))
            self.talks = self._setup.unheard or bool(self.peers.last_received_us)
            if self._line is not None:
                self.rates.fit()

    def news(self) -> list[StatusText]:
        """What the operator should know about the line itself; call it once a second."""
        found = self._endpoint.news()
        texts = [] if found is None else [StatusText(Severity.NOTICE, f"link {self.name}: {found}")]
        self._looks += 1
        # By then frames of every kind have been measured.
        if self._looks > _MEASURED_S and self.rates.share < 1.0 and not self._told_slow:
            self._told_slow = True
            share = f"{100.0 * self.rates.share:.0f} %"
            sentence = f"slow line, telemetry at {share} of its rates, heartbeat and state in full"
            texts.append(StatusText(Severity.NOTICE, f"link {self.name}: {sentence}"))
        return texts

    def acknowledge(self, t_us: int, ack: CommandAck) -> None:
        """Answer a command that came over this link."""
        self._add_answer(ack)
        self._send(t_us)

    def as_json(self) -> dict[str, object]:
        """Counts since start, for ``fsw.json``."""
        return {
            "frames_accepted": self.accepted,
            "false_starts": self.losses.frames,
            "bytes_lost": self.losses.bytes,
            "datagrams_dropped": self.dropped,
            "echoes_dropped": self.echoes,
            "for_others": self.elsewhere,
            "unhandled": {
                dialect.mavlink_map[id_].msgname: count for id_, count in self.unhandled.items()
            },
            "refused": asdict(self.signing.counters),
            "signed": self.signing.active,
            "unrecorded": self._received.left_out + self._told.left_out,
            "peers": len(self.peers.all),
            "encode_failures": self.outbox.encode_failures,
            "service_failures": self.dispatch.failures,
            **self._endpoint.as_json(),
        }

    @property
    def losses_so_far(self) -> LinkLosses:
        """What came and was of no use."""
        refused = sum(asdict(self.signing.counters).values())
        unhandled = sum(self.unhandled.values())
        return LinkLosses(self.losses.frames, self.echoes, refused, unhandled, self.dropped or 0)

    def close(self) -> None:
        """Close the socket."""
        self._endpoint.close()
        self.signing.close()

    def _take(self, t_us: int, frame: Frame, raw: bytes, sender: Address) -> None:
        """Let a frame whose checksum is right do what it may."""
        trust = self.signing.judge(frame, raw)
        if trust is FrameTrust.REFUSED:
            return
        self.accepted += 1
        self._received.add(t_us, raw)
        if trust is FrameTrust.EXEMPT:
            return  # no sign of life either: anybody could start or stop a failsafe with it
        self.peers.heard(sender, self._clock(), version_1=is_version_1(raw))
        self.talks = True
        renew(self._speakers, (frame.system_id, frame.component_id), None, _MAX_SPEAKERS)
        if frame.message_id == message_ids.SETUP_SIGNING:
            armed = self._snapshot is not None and self._snapshot.armed
            text = set_up_signing(self.signing, frame, sender, armed)
            if text is not None:
                self.outbox.add_text(text, t_us)
            return
        self._count_use(frame)
        host, port = sender
        source = MessageSource(
            frame.system_id, frame.component_id, self.name, f"{host}:{port}", self.signing.active
        )
        answer = self._commands.handle(frame, t_us, self._snapshot, sender)
        if answer is None:
            put_off = self._inbox.accept(frame, source)
            if put_off is not None:
                self._add_answer(put_off)
        else:
            for message in answer:
                self.outbox.add_asked_for(message, t_us)
        self.dispatch.handle(frame, t_us, source)

    def _count_use(self, frame: Frame) -> None:
        """Count what will not be answered, because nobody here is asked or nothing here can."""
        if not for_this_vehicle(frame):
            self.elsewhere += 1
        elif frame.message_id not in self._handled:
            count = self.unhandled.get(frame.message_id, 0)
            if count or len(self.unhandled) < _MAX_UNHANDLED:
                self.unhandled[frame.message_id] = count + 1

    def _add_answer(self, ack: CommandAck) -> None:
        self.outbox.add(AUTOPILOT, message_ids.COMMAND_ACK, command_ack(ack))

    def _encode(self, stream: Stream, snapshot: FlightSnapshot) -> None:
        try:
            values = stream.encode(snapshot, self._context)
        except (OverflowError, ValueError):
            # A number that does not fit its field must not end the flight it describes.
            self.outbox.encode_failures += 1
            return
        if values is not None:
            size = self.outbox.add(stream.component, stream.message_id, values)
            if self._line is not None and size:
                self.rates.note_size(stream, size)

    def _send(self, t_us: int) -> None:
        frames, asked_for = self.outbox.take()
        for frame in frames:
            if frame[_MESSAGE_ID] not in _FILE_DATA:
                self._told.add(t_us, frame)
        old = self.peers.version_1
        self._send_to([peer for peer in self.peers.all if peer not in old], frames)
        if old and not self.signing.active:
            both = ((frame, as_version_1(frame)) for frame in frames)
            self._send_to(old, [v1 or v2 for v2, v1 in both if v1 or v2 in asked_for])

    def _send_to(self, peers: Collection[Address], frames: list[bytes]) -> None:
        if not peers or not frames:
            return
        self._sent.add(frame for frame in frames if frame[_MESSAGE_ID] not in _FILE_DATA)
        for datagram in packed(frames):
            for peer in peers:
                self._endpoint.send(datagram, peer)
            if self._line is not None:
                self._line.spend(len(datagram))
