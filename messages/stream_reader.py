"""Frames in a stream of bytes, which knows no datagrams: a serial line, a TCP connection.

A frame may come in pieces, with noise around it, or be cut off. What follows a start marker is
believed only with the right checksum; until then its length is a claim. The search goes on behind a
marker as soon as it can begin no frame, its checksum is wrong, or nothing has come for a pause. So
every frame that arrives whole is read, at the latest after the pause, and nothing waits for ever.
"""

from __future__ import annotations

import re
from typing import Final

from messages.frames import SIGNATURE_SIZE, Frame, Losses, announced_size, frame_at, is_signed

# No pause within a frame is as long: half of it are the gaps of a radio that takes turns.
PAUSE_US: Final = 250_000

_MARKER: Final = re.compile(rb"[\xfd\xfe]")
_VERSION_1: Final = 0xFE


class StreamReader:
    """Cuts one stream into frames; the counterpart of ``messages.frames.cut`` for datagrams."""

    def __init__(self) -> None:
        self._kept = b""  # of a frame that has begun
        self._step = 0  # where in it, or behind it, a frame must begin; before it: nowhere
        self._counted = 0  # bytes of it that belong to a frame already

    @property
    def waits(self) -> bool:
        """Whether the rest of something is to come; call :meth:`cut` after a pause."""
        return bool(self._kept)

    def forget(self, losses: Losses) -> None:
        """Begin another stream: the connection is a new one."""
        losses.bytes += max(len(self._kept) - self._counted, 0)
        self._kept, self._step, self._counted = b"", 0, 0

    def cut(self, data: bytes, losses: Losses) -> list[tuple[Frame, bytes]]:
        """The frames that are whole now, in order, each with its own bytes.

        ``data`` is what has come since; empty: a pause is over, and the rest of what has begun will
        not come. What is dropped is added to ``losses``.

        A frame of MAVLink 1, whose short header noise resembles now and then, counts only where a
        frame must begin, or if another one begins right behind it. The checksum covers no
        signature, so a frame that begins within one was sent in its place.
        """
        buffer, over = self._kept + data, not data
        found: list[tuple[Frame, bytes]] = []
        at, size, step, counted = 0, len(buffer), self._step, self._counted
        while at < size:
            length = announced_size(buffer, at)
            if length != 0 and not over:
                # One byte more shows whether another frame follows.
                more = buffer[at] == _VERSION_1 and at != step
                if length is None or at + length + more > size:
                    break
            frame = frame_at(buffer, at)[1] if length else None
            if frame is not None and length and (at == step or _counts(buffer, at, length, over)):
                raw = buffer[at : at + length]
                found.append((frame, raw))
                losses.bytes += max(at - counted, 0)
                counted = step = at + length
                following = step - (SIGNATURE_SIZE if is_signed(raw) else 0)
            else:
                losses.frames += at >= counted and _MARKER.match(buffer, at) is not None
                following = at + 1
            at = _next_start(buffer, following, step)
        self._kept, self._step, self._counted = buffer[at:], step - at, max(counted - at, 0)
        losses.bytes += max(at - counted, 0)
        return found


def _next_start(buffer: bytes, begin: int, step: int) -> int:
    """Where the next frame may begin, from ``begin`` on; the end of the buffer: nowhere in it."""
    marker = _MARKER.search(buffer, begin)
    at = len(buffer) if marker is None else marker.start()
    return min(at, step) if step >= begin else at


def _counts(buffer: bytes, at: int, length: int, over: bool) -> bool:
    """Whether a frame with the right checksum is one where none must begin."""
    if buffer[at] != _VERSION_1:
        return True
    end = at + length
    return over if end == len(buffer) else _MARKER.match(buffer, end) is not None
