"""Rows as they come back from a file: every field must have the type that it was kept with."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from types import NoneType, UnionType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

RowT = TypeVar("RowT")


def kept_row(kind: type[RowT], line: Mapping[str, Any]) -> RowT:
    """The row of a dataclass ``kind`` that a line holds.

    Raises:
        TypeError: A field is missing, unknown, or of another type.
    """
    made: Any = kind
    hints = _hints(made)
    for name, value in line.items():
        if name in hints and not _is(value, hints[name]):
            raise TypeError(f"{name} = {value!r} is no {hints[name]}")
    return made(**line)  # type: ignore[no-any-return]


@cache
def _hints(kind: type[Any]) -> dict[str, Any]:
    return get_type_hints(kind)


def _is(value: Any, hint: Any) -> bool:
    """Whether a value of JSON has a type; whole numbers are numbers, true and false are not."""
    if isinstance(hint, UnionType):
        return any(_is(value, one) for one in get_args(hint))
    if get_origin(hint) is dict:
        key, of = get_args(hint)
        return isinstance(value, dict) and all(
            _is(name, key) and _is(part, of) for name, part in value.items()
        )
    if hint is float:
        return isinstance(value, int | float) and not isinstance(value, bool)
    if hint is int:
        return isinstance(value, int) and not isinstance(value, bool)
    if hint is None or hint is NoneType:
        return value is None
    return isinstance(value, hint)
