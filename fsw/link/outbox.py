"""Frames on their way to the peers of one link."""

from __future__ import annotations

import struct
from typing import Final

from fsw.autopilot.signals import StatusText
from fsw.link.signing.signing import Signing
from fsw.link.text_limiter import TextLimiter
from fsw.link.wire.outgoing import ServiceOutput, WireValues
from messages import message_ids, status_text
from messages.frames import FrameWriter
from messages.message_ids import AUTOPILOT, PANDION, SYSTEM_ID

_MAX_DATAGRAM: Final = 1400  # bytes, fits an Ethernet packet


class Outbox:
    """Encodes, counts sequences, signs where the link is signed, and packs."""

    def __init__(self, signing: Signing) -> None:
        self.encode_failures = 0
        self._signing = signing
        self._writers = {id_: FrameWriter(SYSTEM_ID, id_) for id_ in (AUTOPILOT, PANDION)}
        self.bytes = 0  # of the frames that wait to be sent
        self._frames: list[bytes] = []
        self._asked_for: set[bytes] = set()
        self._text_id = 0
        self._limiter = TextLimiter()

    def add(self, component: int, message_id: int, values: WireValues) -> int:
        """Take one message; returns the bytes of its frame.

        One with a number that does not fit its field is dropped and counted, and has 0: such a
        number must not end the flight it describes.
        """
        try:
            frame = self._writers[component].frame(message_id, *values)
        except (struct.error, OverflowError, ValueError, KeyError, TypeError):
            self.encode_failures += 1
            return 0
        return self._add_frame(frame)

    def add_output(self, outgoing: ServiceOutput, t_us: int) -> None:
        """Take an output of a service."""
        if isinstance(outgoing, StatusText):
            self.add_text(outgoing, t_us)
            return
        component, message_id, values = outgoing.component, outgoing.message_id, outgoing.values
        if isinstance(values, bytes):
            self._add_frame(self._writers[component].packed_frame(message_id, values))
        else:
            self.add(component, message_id, values)

    def add_asked_for(self, outgoing: ServiceOutput, t_us: int) -> None:
        """Take a requested message: in MAVLink 2 if MAVLink 1 has no such message.

        A peer may speak MAVLink 1 only because it does not know our version yet.
        """
        before = len(self._frames)
        self.add_output(outgoing, t_us)
        self._asked_for.update(self._frames[before:])

    def add_text(self, text: StatusText, t_us: int) -> None:
        """Take a text, unless it has just been sent."""
        admitted = self._limiter.admit(text, t_us)
        if admitted is not None:
            self._add_text(admitted)

    def add_overdue_texts(self, t_us: int) -> None:
        """Say how often sentences were held back; call it now and then."""
        for text in self._limiter.overdue(t_us):
            self._add_text(text)

    def _add_frame(self, frame: bytes) -> int:
        sent = self._signing.signed(frame) if self._signing.active else frame
        self._frames.append(sent)
        self.bytes += len(sent)
        return len(sent)

    def _add_text(self, text: StatusText) -> None:
        """In as many STATUSTEXT as it needs."""
        self._text_id = self._text_id % 0xFFFF + 1
        for values in status_text.pieces(text.text, text.severity, self._text_id):
            self.add(AUTOPILOT, message_ids.STATUSTEXT, values)

    def take(self) -> tuple[list[bytes], set[bytes]]:
        """Hand over the frames, in order, and those among them that were asked for."""
        frames, self._frames, self.bytes = self._frames, [], 0
        asked_for, self._asked_for = self._asked_for, set()
        return frames, asked_for


def packed(frames: list[bytes]) -> list[bytes]:
    """Join frames into as few datagrams as fit an Ethernet packet."""
    datagrams = [b""]
    for frame in frames:
        if len(datagrams[-1]) + len(frame) > _MAX_DATAGRAM:
            datagrams.append(b"")
        datagrams[-1] += frame
    return datagrams
