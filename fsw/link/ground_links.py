"""All links to the ground: opened as they were chosen, and as the loop sees them."""

from __future__ import annotations

import select
import time
from collections.abc import Callable, Sequence
from dataclasses import astuple
from operator import attrgetter
from typing import Final

from command_line.folders import NoHomeError, state_folder
from fsw.autopilot.ports import Clock, LinkLosses
from fsw.autopilot.signals import CommandAck, FlightSnapshot, StatusText, TickOutputs
from fsw.link.bounded_memory import RecordFrame, SentFrames
from fsw.link.gcs_link import GcsLink, LinkSetup
from fsw.link.inbox import Inbox
from fsw.link.link_choice import LinkChoice, addresses
from fsw.link.services.service import LinkService, TimeService
from fsw.link.signing.key_file import KeyFile, NoKeyFile
from fsw.link.signing.signing import SignedTimes, Signing
from fsw.link.telemetry.stream_rates import SLOT_US
from fsw.link.telemetry.streams import API_RATES, GROUND_RATES
from fsw.link.wire.outgoing import TelemetryContext

_GCS_PORT: Final = 18570  # of our own, as PX4 has it, if they are free
_API_PORT: Final = 14580
_READ_BYTES: Final = 4096  # of each link a slot in lockstep, of all links a tick in real time
_UNHEARD_SLOTS: Final = 5  # between two polls of a link without a client
# Tick of a slot on which its messages are encoded; they are sent on the next one. So neither the
# sending nor what a planning period begins with falls on the same tick.
_ENCODES: Final = 2
_SENDS: Final = 3
# Of a mission, and what a heartbeat says: a vehicle that is disarmed shows the intended mode.
_TOLD_AT_ONCE: Final = attrgetter("mission", "mode", "intended_mode", "armed", "landed", "failures")
_ONE: Final = 1  # byte of budget: one frame
_GUARD_US: Final = 200  # before a tick: the dearest frame takes less
# Of files, a tick and link: some 3 MB/s in real time, if the client asks as fast.
_BULK_DATAGRAMS: Final = 6


class GroundLinks:
    """The ground station's link and the programs' link, each with its own peers and rates."""

    def __init__(self, links: Sequence[GcsLink], tick_period_us: int, clock: Clock) -> None:
        self.links = tuple(links)
        self._clock = clock
        self._tick_us = tick_period_us
        self._slot_ticks = SLOT_US // tick_period_us
        self._tick = 0
        self._told: tuple[object, ...] | None = None  # of the last tick
        self._t_us = 0  # of the last tick
        self._attends = False

    @property
    def received(self) -> int:
        """Datagrams that came over all links since the start, dropped ones too."""
        return sum(link.received for link in self.links)

    @property
    def losses(self) -> LinkLosses:
        """What came over all links and was of no use."""
        each = [astuple(link.losses_so_far) for link in self.links]
        return LinkLosses(*map(sum, zip(*each, strict=True)))

    def poll(self, t_us: int) -> None:
        """Read what arrived, in lockstep; call it once a tick, after :meth:`publish`."""
        if self._attends or self._tick % self._slot_ticks:
            return
        for link in self.links:
            # Each poll is a system call; a link without a client can wait a little longer.
            if link.is_heard or self._tick % (_UNHEARD_SLOTS * self._slot_ticks) == 0:
                link.read(t_us, _READ_BYTES)

    def attend(self, seconds: float) -> None:
        """Sleep for ``seconds`` [s] and answer the ground: in real time it is heard between ticks.

        One frame is taken at a time and none shortly before the end, so a flood delays no tick.
        """
        self._attends = True
        begin = self._clock()
        until, budget = begin + round(1e6 * seconds), _READ_BYTES
        bulk = _BULK_DATAGRAMS
        while budget > 0 and (left := until - self._clock() - _GUARD_US) > 0:
            # The vehicle's time goes on between two ticks.
            t_us = self._t_us + min(self._clock() - begin, self._tick_us - 1)
            if bulk > 0:
                served = [link.serve_bulk(t_us) for link in self.links if link.talks]
                bulk = bulk - 1 if any(served) else 0
            begun = [link for link in self.links if link.arrivals.waits]
            at_once = bool(bulk or begun)
            came, _, _ = select.select(self.links, (), (), 0.0 if at_once else 1e-6 * left)
            if not came and not at_once:
                break
            ready = [link for link in self.links if link in came or link.arrivals.waits]
            for link in ready:
                budget -= _ONE - link.read(t_us, _ONE)
                bulk = max(bulk, _ONE)  # it may have asked for more
        time.sleep(1e-6 * max(until - self._clock(), 0))

    def publish(self, outputs: TickOutputs) -> None:
        """Send what is due on this tick; call it once a tick, after the actuators."""
        snapshot = outputs.snapshot
        tick, t_us = self._tick, snapshot.t_us
        self._t_us = t_us
        self._tick += 1
        place, texts = tick % self._slot_ticks, bool(outputs.texts)
        encodes, sends = place == _ENCODES, place == _SENDS
        changed, steps = self._changes(snapshot)
        news = encodes or changed or texts
        for link in self.links:
            if link.talks:
                fast, busy = link.rates.slot_us < SLOT_US, t_us < link.dispatch.busy_until_us
                if news or fast:
                    link.publish(outputs, changed)
                if fast or changed or sends or steps or ((texts or busy) and not encodes):
                    link.serve(t_us)
                if busy and not self._attends:
                    for _ in range(_BULK_DATAGRAMS):
                        if not link.serve_bulk(t_us):
                            break
            elif news:
                link.announce(snapshot, changed)
            if encodes and self._attends:
                # Ticks without a pause between them must not make the vehicle deaf.
                link.read(t_us, _ONE)

    def news(self) -> list[StatusText]:
        """What the operator should know about lines that come and go; call it once a second."""
        return [text for link in self.links for text in link.news()]

    def _changes(self, now: FlightSnapshot) -> tuple[bool, bool]:
        """Whether a heartbeat says something new at once, and whether a mission has gone on.

        One step of a mission may follow another by a tick, and each is told.
        """
        before, self._told = self._told, _TOLD_AT_ONCE(now)
        if self._told == before:
            return False, False
        if before is None:
            return True, now.mission is not None
        return self._told[1:] != before[1:], self._told[0] != before[0]

    def acknowledge(self, t_us: int, ack: CommandAck) -> None:
        """Answer a command on the link it came from; on all where that is not known."""
        hearing = [
            link for link in self.links if link.hears(ack.target_system, ack.target_component)
        ]
        for link in hearing or self.links:
            link.acknowledge(t_us, ack)

    def close(self) -> None:
        """Close all sockets."""
        for link in self.links:
            link.close()


def build_links(
    choice: LinkChoice,
    inbox: Inbox,
    context: TelemetryContext,
    clocks: tuple[Clock, Clock],
    record: RecordFrame,
    services: Callable[[], Sequence[LinkService]],
    *,
    beside: bool = False,
) -> GroundLinks:
    """Open the links; ``clocks`` are monotonic time and Unix time [us].

    Only the ground station's link is recorded: the programs' link would repeat the same telemetry
    under the same sequence numbers. ``services`` makes what one link serves. A planner ``beside``
    PX4 leaves PX4 its ports.

    Raises:
        LinkError: An address is none, or a key cannot be trusted.
    """
    gcs, api = addresses(choice)
    now_us, unix_us = clocks
    remote = choice.allow_remote
    setups = [LinkSetup("gcs", gcs, _GCS_PORT + beside, GROUND_RATES, unheard=True, remote=remote)]
    if api is not None:
        # Until a program speaks, a heartbeat a second is all it needs to find the vehicle.
        setups.append(
            LinkSetup("api", api, _API_PORT + beside, API_RATES, unheard=False, remote=remote)
        )
    times, sent = SignedTimes(), SentFrames()
    links = [
        GcsLink(
            setup,
            inbox,
            context,
            Signing(number, unix_us, _key_file(choice, setup.name), times),
            now_us,
            record if number == 0 else None,
            (TimeService(), *services()),
            sent,
        )
        for number, setup in enumerate(setups)
    ]
    return GroundLinks(links, context.facts.tick_period_us, now_us)


def _key_file(choice: LinkChoice, link: str) -> KeyFile:
    """Where the signing key of a link of this name is kept."""
    try:
        return KeyFile((choice.keys or state_folder()) / f"signing-{link}.json")
    except NoHomeError:
        return NoKeyFile()
