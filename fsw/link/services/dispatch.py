"""Passes frames to the services; a service that raises is reported and does not end the flight."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Sequence

from fsw.link.services.service import BulkService, LinkService
from fsw.link.wire.outgoing import ServiceOutput
from messages.frames import Frame

Answers = Callable[[ServiceOutput], None]
"""Takes each thing a service wants to say."""


class Dispatch:
    """The services of one link."""

    def __init__(self, services: Sequence[LinkService]) -> None:
        self.failures = 0  # answers that ended in an exception
        self._polled = tuple(services)
        self._bulky = tuple(service for service in services if isinstance(service, BulkService))
        self._wanting: dict[int, tuple[LinkService, ...]] = {}
        for service in services:
            for id_ in service.message_ids:
                self._wanting[id_] = (*self._wanting.get(id_, ()), service)

    def handle(self, frame: Frame, t_us: int, send: Answers) -> None:
        """Let the services handle a frame."""
        for service in self._wanting.get(frame.message_id, ()):
            try:
                for outgoing in service.handle(frame, t_us):
                    send(outgoing)
            except Exception:
                self._note()

    def poll(self, t_us: int, send: Answers) -> None:
        """Let the services continue what they send."""
        for service in self._polled:
            try:
                for outgoing in service.poll(t_us):
                    send(outgoing)
            except Exception:
                self._note()

    def bulk(self, t_us: int, send: Answers) -> bool:
        """Let services send a datagram each of what clients wait for; whether any did."""
        sent = False
        for service in self._bulky:
            try:
                for outgoing in service.bulk(t_us):
                    send(outgoing)
                    sent = True
            except Exception:
                self._note()
        return sent

    def _note(self) -> None:
        """A mistake in a service must not end the flight it serves; it is reported once."""
        if self.failures == 0:
            traceback.print_exc()
        self.failures += 1
