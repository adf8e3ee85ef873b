"""Sentences in STATUSTEXT messages: cut into pieces, and joined again."""

from __future__ import annotations

from collections.abc import Iterable
from typing import cast

from messages.frames import Frame

STATUSTEXT = 253  # the message's id
_SIZE = 50  # bytes of text in one message
_MAX_PIECES = 255


def pieces(sentence: str, severity: int, text_id: int) -> list[tuple[int, bytes, int, int]]:
    """Values of the STATUSTEXT messages for one sentence, in wire order.

    The id, 1..65535, is the same for all pieces of a long one, so that the receiver joins them.
    """
    whole = sentence.encode("utf-8")
    if len(whole) <= _SIZE:
        return [(severity, whole, 0, 0)]
    starts = range(0, min(len(whole), _MAX_PIECES * _SIZE), _SIZE)
    return [(severity, whole[at : at + _SIZE], text_id, n) for n, at in enumerate(starts)]


def joined(frames: Iterable[Frame]) -> tuple[str, ...]:
    """The sentences in these frames, the pieces of a long one joined; whole ones come first."""
    return tuple(sentence for _, sentence in graded(frames))


def graded(frames: Iterable[Frame]) -> tuple[tuple[int, str], ...]:
    """The same, each with its severity; that of a long one is its last piece's."""
    cut: dict[int, tuple[int, bytes]] = {}
    whole: list[tuple[int, bytes]] = []
    for frame in frames:
        if frame.message_id != STATUSTEXT:
            continue
        severity, raw, text_id, _ = cast("tuple[int, bytes, int, int]", frame.payload_values)
        text = raw.rstrip(b"\0")
        if text_id == 0:
            whole.append((severity, text))
        else:
            _, before = cut.get(text_id, (severity, b""))
            cut[text_id] = severity, before + text
    every = (*whole, *cut.values())
    return tuple((severity, text.decode("utf-8", "replace")) for severity, text in every)
