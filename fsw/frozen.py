"""``dataclass`` and ``replace`` for values made in every tick: frozen for mypy, fast to build.

A frozen dataclass sets each field through ``object.__setattr__``: 2.6 us for fourteen of them,
against 0.16 us here. Such values must not be changed all the same; mypy, which sees the ordinary
``dataclass``, refuses the assignment before it runs.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING, Generic, TypeVar

V = TypeVar("V")
M = TypeVar("M")


class Remembered(Generic[V, M]):
    """What a function makes of frozen values; the last one is known by ``is``.

    A hash of 64 zones takes 30 us, ten times as long as what is asked of one of them.
    """

    def __init__(self, make: Callable[[V], M]) -> None:
        self._make, self._last = lru_cache(maxsize=16)(make), list[tuple[V, M]]()

    def __call__(self, value: V) -> M:
        """What it has made of a value, or makes."""
        if not (self._last and self._last[0][0] is value):
            self._last = [(value, self._make(value))]
        return self._last[0][1]


if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
    from dataclasses import replace as replace
else:
    import dataclasses

    def dataclass(*, frozen, slots):
        """What ``dataclasses.dataclass`` makes, frozen by the type checker alone."""
        assert frozen

        def made(definition):
            kind = dataclasses.dataclass(slots=slots, unsafe_hash=True)(definition)
            if not hasattr(kind, "__post_init__"):  # else a value checks itself
                kind._copy = _copy_of(kind)
            return kind

        return made

    def _copy_of(kind):
        """A function that copies values of a kind, written field by field as the library does."""
        lines = [f" copied.{field.name} = value.{field.name}" for field in dataclasses.fields(kind)]
        made = {"new": object.__new__, "kind": kind}
        exec("\n".join(["def copy(value):", " copied = new(kind)", *lines, " return copied"]), made)
        return made["copy"]

    def replace(value, /, **changes):
        """``dataclasses.replace``, in a quarter of the time for values of this ``dataclass``."""
        copy = type(value).__dict__.get("_copy")
        if copy is None:
            return dataclasses.replace(value, **changes)
        copied = copy(value)
        for name, new in changes.items():
            setattr(copied, name, new)
        return copied
