"""What a link remembers of others is bounded: the newest stays."""

from __future__ import annotations

from typing import TypeVar

K = TypeVar("K")
V = TypeVar("V")


def renew(kept: dict[K, V], key: K, value: V, most: int) -> None:
    """Put a value in as the newest, and forget the oldest where there are more than ``most``."""
    kept.pop(key, None)
    kept[key] = value
    if len(kept) > most:
        del kept[next(iter(kept))]
