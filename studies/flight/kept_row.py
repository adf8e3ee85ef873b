"""Rows as they come back from a file: every field must have the type that it was kept with."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from types import NoneType, UnionType
from typing import Any, Final, TypeVar, get_args, get_origin, get_type_hints

RowT = TypeVar("RowT")

_EXACT: Final = 1 << 53  # up to it every integer is a double
_LONG: Final = 1 << 63  # of a column of integers


def kept_row(kind: type[RowT], line: Mapping[str, Any]) -> RowT:
    """The row of a dataclass ``kind`` that a line holds.

    Raises:
        TypeError: It is no object; a field is missing, unknown, or of another type.
    """
    if not isinstance(line, Mapping):
        raise TypeError(f"{line!r} is no object")
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
    if get_origin(hint) is tuple:  # of any length
        return isinstance(value, tuple) and all(_is(part, get_args(hint)[0]) for part in value)
    if hint is float:
        return isinstance(value, float) or _is_whole(value, _EXACT)
    if hint is int:
        return _is_whole(value, _LONG - 1)
    if hint is None or hint is NoneType:
        return value is None
    return isinstance(value, hint)


def _is_whole(value: Any, most: int) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and -most <= value <= most
