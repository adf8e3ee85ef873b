"""The link to ground stations: telemetry out, commands in.

Nothing that arrives here can raise, and nothing is kept between datagrams but what a valid frame
said.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from typing import Final

from fsw.link import encode_replies, message_ids
from fsw.link.dispatch import Dispatch
from fsw.link.inbox import Inbox
from fsw.link.message_ids import AUTOPILOT, PANDION, SYSTEM_ID
from fsw.link.peers import Peers
from fsw.link.service import LinkService, Outgoing, WireValues
from fsw.link.streams import HEARTBEAT, STREAMS, Stream, schedule
from fsw.link.telemetry import TelemetryContext
from fsw.link.udp_endpoint import Address, OpenEndpoint
from fsw.signals import CommandAck, FlightSnapshot, Mode, StatusText, TickOutputs
from messages.frames import FrameWriter, Losses, cut

RecordFrame = Callable[[int, bytes], None]
"""Takes the sensor time [us] and one frame, for the log."""

_POLL_TICKS: Final = 5  # 100 Hz: a system call a tick would be spent on silence
_POLL_BYTES: Final = 4096  # a poll; a flood waits in the kernel, and is dropped there
_MAX_DATAGRAM_OUT: Final = 1400  # bytes
_MESSAGE_ID: Final = slice(7, 10)  # in a frame
# Not recorded: a log that is downloaded while it is written would grow by what is sent of it.
_FILE_DATA: Final = frozenset(
    id_.to_bytes(3, "little") for id_ in (message_ids.LOG_DATA, message_ids.FILE_TRANSFER_PROTOCOL)
)


class GcsLink:
    """Serves the configured ground station and those who speak to the vehicle."""

    def __init__(
        self,
        target: Address,
        inbox: Inbox,
        context: TelemetryContext,
        record: RecordFrame,
        services: Sequence[LinkService] = (),
    ) -> None:
        self.losses = Losses()
        self.encode_failures = 0
        self._endpoint = OpenEndpoint(target)
        self._peers = Peers(target)
        self._inbox = inbox
        self._context = context
        self._record = record
        self._writers = {id_: FrameWriter(SYSTEM_ID, id_) for id_ in (AUTOPILOT, PANDION)}
        self._slots = schedule(STREAMS, round(1e6 / context.facts.tick_period_us))
        self._tick = 0
        self._shown: tuple[Mode, bool] | None = None
        self._text_id = 0
        self._dispatch = Dispatch(services)
        self._answers: list[bytes] = []

    @property
    def port(self) -> int:
        """The local port, where ground stations answer to."""
        return self._endpoint.port

    @property
    def peers(self) -> tuple[Address, ...]:
        """Everyone who receives telemetry."""
        return self._peers.all

    def poll(self, t_us: int) -> None:
        """Read and answer what ground stations sent, within a budget; call it once a tick."""
        if self._tick % _POLL_TICKS == 0:
            self._read_waiting(t_us)
            self._send_answers(t_us)

    def _send_answers(self, t_us: int) -> None:
        if self._answers:
            frames, self._answers = self._answers, []
            self._send(t_us, frames)

    def _read_waiting(self, t_us: int) -> None:
        budget = _POLL_BYTES
        while budget > 0:
            received = self._endpoint.receive_waiting()
            if received is None:
                return
            datagram, sender = received
            # An empty datagram costs as much as a small one.
            budget -= max(len(datagram), 64)
            self._read(t_us, datagram, sender)

    def publish(self, outputs: TickOutputs) -> None:
        """Send what is due on this tick; call it once a tick, after the actuators."""
        snapshot = outputs.snapshot
        due = self._slots[self._tick % len(self._slots)]
        self._tick += 1
        frames: list[bytes] = []
        if (snapshot.mode, snapshot.armed) != self._shown:
            self._shown = (snapshot.mode, snapshot.armed)
            self._encode(HEARTBEAT, snapshot, frames)
        for stream in due:
            self._encode(stream, snapshot, frames)
        for text in outputs.texts:
            self._encode_text(text, frames)
        if frames:
            self._send(snapshot.t_us, frames)
        self._dispatch.poll(snapshot.t_us, self._answer)
        self._send_answers(snapshot.t_us)

    def acknowledge(self, t_us: int, ack: CommandAck) -> None:
        """Answer a command that came over this link."""
        values = encode_replies.command_ack(ack)
        frame = self._writers[AUTOPILOT].frame(message_ids.COMMAND_ACK, *values)
        self._send(t_us, [frame])

    def close(self) -> None:
        """Close the socket."""
        self._endpoint.close()

    def _read(self, t_us: int, datagram: bytes, sender: Address) -> None:
        for frame, raw in cut(datagram, self.losses):
            if frame.system_id == SYSTEM_ID and frame.component_id in self._writers:
                continue  # our own telemetry, sent back by a router
            self._record(t_us, raw)
            self._inbox.accept(frame)
            self._peers.heard(sender)
            self._dispatch.receive(frame, t_us, self._answer)

    def _answer(self, outgoing: Outgoing) -> None:
        self._append(outgoing.component, outgoing.message_id, outgoing.values, self._answers)

    def _encode(self, stream: Stream, snapshot: FlightSnapshot, frames: list[bytes]) -> None:
        try:
            values = stream.encode(snapshot, self._context)
        except (OverflowError, ValueError):
            self.encode_failures += 1
            return
        if values is not None:
            self._append(stream.component, stream.message_id, values, frames)

    def _append(
        self, component: int, message_id: int, values: WireValues, frames: list[bytes]
    ) -> None:
        try:
            frames.append(self._writers[component].frame(message_id, *values))
        except (struct.error, OverflowError, ValueError):
            # A number that does not fit its field must not end the flight it describes.
            self.encode_failures += 1

    def _encode_text(self, text: StatusText, frames: list[bytes]) -> None:
        self._text_id = self._text_id % 0xFFFF + 1
        writer = self._writers[AUTOPILOT]
        for values in encode_replies.status_texts(text, self._text_id):
            frames.append(writer.frame(message_ids.STATUSTEXT, *values))

    def _send(self, t_us: int, frames: list[bytes]) -> None:
        for frame in frames:
            if frame[_MESSAGE_ID] not in _FILE_DATA:
                self._record(t_us, frame)
        for datagram in _packed(frames):
            for peer in self._peers.all:
                self._endpoint.send(datagram, peer)


def _packed(frames: list[bytes]) -> list[bytes]:
    """Join frames into as few datagrams as fit an Ethernet packet."""
    datagrams = [b""]
    for frame in frames:
        if len(datagrams[-1]) + len(frame) > _MAX_DATAGRAM_OUT:
            datagrams.append(b"")
        datagrams[-1] += frame
    return datagrams
