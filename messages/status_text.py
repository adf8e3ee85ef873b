"""Sentences that came as STATUSTEXT."""

from __future__ import annotations

from collections.abc import Iterable
from typing import cast

from messages.frames import Frame

STATUSTEXT = 253  # the message's id


def joined(frames: Iterable[Frame]) -> tuple[str, ...]:
    """The sentences in these frames, the pieces of a long one joined; whole ones come first."""
    pieces: dict[int, bytes] = {}
    whole: list[bytes] = []
    for frame in frames:
        if frame.message_id != STATUSTEXT:
            continue
        _, raw, text_id, _ = cast("tuple[int, bytes, int, int]", frame.payload_values)
        text = raw.rstrip(b"\0")
        if text_id == 0:
            whole.append(text)
        else:
            pieces[text_id] = pieces.get(text_id, b"") + text
    return tuple(text.decode("utf-8", "replace") for text in (*whole, *pieces.values()))
