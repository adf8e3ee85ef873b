"""The simulator's codec of the lockstep exchange: one datagram, by fixed layouts.

One step of lockstep is three frames to the flight software and one back, 500 times a simulated
second. Their first fields change with every step and the others never do, so only the first ones
are packed and unpacked. What does not look as expected is left to :mod:`messages.frames`, which
reads anything; the bytes are the same either way.
"""

from __future__ import annotations

import re
from struct import Struct
from typing import Final, NamedTuple

from messages.frames import LAYOUTS, FrameWriter, checksum, closed_frame

_HEADER_SIZE: Final = 10
_CHECKSUM_SIZE: Final = 2
_FIELD = re.compile(r"(\d*)([a-zA-Z])")


class _Part(NamedTuple):
    """Layout of one frame of the datagram."""

    id_bytes: bytes
    crc_extra: bytes
    first: Struct  # what is read of it: start, length, flags and message id, and the first fields


class LockstepReader:
    """Reads datagrams that hold these messages and nothing else."""

    def __init__(self, *parts: tuple[int, int]) -> None:
        """Take message id and number of first values (wire order) of each frame, in order."""
        self._parts = tuple(_part(message_id, count) for message_id, count in parts)

    def read(self, datagram: bytes) -> list[tuple[float, ...]] | None:
        """The first values of each frame; None unless the datagram is whole and as expected."""
        values = []
        at, size = 0, len(datagram)
        for id_bytes, crc_extra, first in self._parts:
            if size < at + first.size:
                return None
            found = first.unpack_from(datagram, at)
            end = at + _HEADER_SIZE + found[1]
            if found[0] != 0xFD or found[2] or found[3] != id_bytes or end < at + first.size:
                return None
            if size < end + _CHECKSUM_SIZE:
                return None
            expected = datagram[end] | datagram[end + 1] << 8
            if checksum(datagram[at + 1 : end] + crc_extra) != expected:
                return None
            values.append(found[4:])
            at = end + _CHECKSUM_SIZE
        return values if at == size else None


class LockstepFrame:
    """Writes one message whose last fields never change."""

    def __init__(self, writer: FrameWriter, message_id: int, *last_values: float | bytes) -> None:
        """Fix the last values in wire order; not all zero, so that the frame's length is fixed too.

        Raises:
            ValueError: The last values end a payload of no fixed length.
        """
        layout = LAYOUTS[message_id]
        fields = _fields(layout.payload)
        count = len(fields) - len(last_values)
        first = Struct("<" + "".join(fields[:count]))
        last = Struct("<" + "".join(fields[count:])).pack(*last_values).rstrip(b"\0")
        if not last:
            raise ValueError(f"message {message_id}: its last values are all zero")
        self._writer = writer
        self._last = last
        self._id_bytes = layout.id_bytes
        self._crc_extra = layout.crc_extra
        self._length = first.size + len(last)
        self._body = Struct(f"<B5s3s{first.format[1:]}{len(last)}s")

    def __call__(self, *first_values: float) -> bytes:
        """The frame with these first values."""
        origin = self._writer.next_origin()
        body = self._body.pack(self._length, origin, self._id_bytes, *first_values, self._last)
        return closed_frame(body, self._crc_extra)


def _part(message_id: int, count: int) -> _Part:
    layout = LAYOUTS[message_id]
    first = Struct("<BBB4x3s" + "".join(_fields(layout.payload)[:count]))
    return _Part(layout.id_bytes, layout.crc_extra, first)


def _fields(payload: Struct) -> list[str]:
    """The format of each value of a payload; text is one value."""
    fields: list[str] = []
    for count, kind in _FIELD.findall(payload.format):
        fields += [f"{count}s"] if kind == "s" else [kind] * int(count or 1)
    return fields
