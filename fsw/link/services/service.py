"""What a link serves beside telemetry and commands: parameters, missions, files, time.

A service is asked by frames and answers with messages and sentences; sockets, sequence numbers,
signatures and peers are the link's. There is one instance a link; what it serves may be shared.
Times are sensor time [us].
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Sequence
from typing import Final, cast

from fsw.autopilot.signals import CommandRequest, MessageSource
from fsw.link.wire.decode import Numbers, for_this_vehicle
from fsw.link.wire.outgoing import Outgoing, ServiceOutput
from messages.frames import Frame
from messages.message_ids import PING, TIMESYNC

Outcome = tuple[int, str]
"""MAV_RESULT of a command, and in a sentence why it is refused."""


class LinkService:
    """One protocol on one link; it hears only what is addressed to this vehicle."""

    message_ids: frozenset[int] = frozenset()  # what it wants to hear
    commands: frozenset[int] = frozenset()  # MAV_CMD that it carries out; no tick sees them
    source: MessageSource | None = None  # of the frame that is handled now

    def handle(self, frame: Frame, t_us: int) -> Sequence[ServiceOutput]:
        """Answer a valid frame at once: values of the right type and number, not of any sense."""
        return ()

    def poll(self, t_us: int) -> Sequence[ServiceOutput]:
        """Go on with an answer that is paced; called often, so idle must cost nothing."""
        return ()

    def bulk(self, t_us: int) -> Sequence[ServiceOutput]:
        """The next datagram of what clients ask for piece by piece; nothing without a transfer.

        Called in what is left of a tick, several times, so that it delays none.
        """
        return ()

    def carry_out(self, request: CommandRequest, t_us: int, armed: bool) -> Outcome:
        """Do one of its ``commands`` at once, or begin to."""
        raise NotImplementedError


class TimeService(LinkService):
    """TIMESYNC and PING: answers in the vehicle's own time, with which its messages are stamped."""

    message_ids = frozenset({PING, TIMESYNC})

    def handle(self, frame: Frame, t_us: int) -> Sequence[Outgoing]:
        """Answer a request; replies to other systems are ignored."""
        if frame.message_id == TIMESYNC:
            answered_ns, sent_ns = frame.payload_values
            return () if answered_ns else (Outgoing(TIMESYNC, (1000 * t_us, sent_ns)),)
        time_us, sequence, system, component = cast(Numbers, frame.payload_values)
        if system or component:
            return ()  # a ping with a target is an answer
        return (Outgoing(PING, (time_us, sequence, frame.system_id, frame.component_id)),)


_BUSY_US: Final = 100_000  # after a question or an answer; the slowest pace is 20 ms


class Dispatch:
    """Hands frames to the services of one link that want them, and what they answer to the link."""

    def __init__(
        self, services: Sequence[LinkService], send: Callable[[ServiceOutput, int], None]
    ) -> None:
        self.failures = 0  # answers that ended in an exception
        self.busy_until_us = 0  # a service was asked or has answered lately
        self._send = send
        self._services = tuple(services)
        self._wanting: dict[int, tuple[LinkService, ...]] = {}  # by message
        for service in services:
            for id_ in service.message_ids:
                self._wanting[id_] = (*self._wanting.get(id_, ()), service)

    @property
    def message_ids(self) -> frozenset[int]:
        """What any service wants to hear."""
        return frozenset(self._wanting)

    def handle(self, frame: Frame, t_us: int, source: MessageSource | None = None) -> None:
        """Let every service that wants the frame answer it, if it is for this vehicle."""
        if not for_this_vehicle(frame):
            return
        for service in self._wanting.get(frame.message_id, ()):
            service.source = source
            self.busy_until_us = t_us + _BUSY_US
            self._answer(t_us, service.handle, frame, t_us)

    def poll(self, t_us: int) -> None:
        """Let every service go on with what it is sending."""
        for service in self._services:
            self._answer(t_us, service.poll, t_us)

    def bulk(self, t_us: int) -> bool:
        """Let services send a datagram each of what clients wait for; whether any did."""
        sent = False
        for service in self._services:
            sent |= self._answer(t_us, service.bulk, t_us)
        return sent

    def _answer(
        self, t_us: int, service: Callable[..., Sequence[ServiceOutput]], *about: Frame | int
    ) -> bool:
        """Send what a service says; its mistake must not end a flight, and is reported once."""
        sent = False
        try:
            for outgoing in service(*about):
                self.busy_until_us = t_us + _BUSY_US
                self._send(outgoing, t_us)
                sent = True
        except Exception:
            if self.failures == 0:
                traceback.print_exc()
            self.failures += 1
        return sent
