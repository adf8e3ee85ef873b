"""Tables of TOML as frozen dataclasses: what a key may be is what its field is annotated with.

A key is declared once, as a field: its type, its range (``Annotated[float, Range(...)]``) and its
default. What is not allowed is refused with the key, the value and what is.
"""

from __future__ import annotations

import dataclasses
import difflib
import types
import typing
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Annotated, Any, Literal, get_args, get_origin

from command_line.ranges import Range

SHOWN = 80  # characters of a value in a sentence


def nearest(word: object, known: Iterable[str]) -> str:
    """Which of the ``known`` words may have been meant, as the end of a sentence."""
    match = difflib.get_close_matches(str(word)[:SHOWN], list(known), n=1, cutoff=0.4)
    return f', did you mean "{match[0]}"?' if match else ""


def shown(value: object) -> str:
    """A value as sentences quote it, in part if it is long."""
    try:
        text = repr(value)
    except ValueError:  # an integer of thousands of digits
        return "a number too long to show"
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}…"


def one_of(words: Iterable[str]) -> str:
    """Words to choose from, as a part of a sentence."""
    return "one of " + ", ".join(f'"{word}"' for word in words)


@cache
def _hints(kind: Any) -> dict[str, Any]:
    """The annotations of a dataclass, which Python evaluates anew each time, for 0.3 ms."""
    return typing.get_type_hints(kind, include_extras=True)


def _entries(hint: Any, path: str) -> str:
    """What an array consists of, as a sentence says it."""
    if get_origin(hint) is Annotated:
        size = len(get_args(get_args(hint)[0]))
        return f"arrays of {size} numbers" if size else f"numbers ({get_args(hint)[1]})"
    if dataclasses.is_dataclass(hint) or get_origin(hint) is types.UnionType:
        return f"tables ([[{path}]])"
    return 'texts, such as ["a", "b"]'


def _allowed(hint: Any) -> str:
    """What a sentence about a key says in brackets."""
    if get_origin(hint) is Annotated:
        return f" ({get_args(hint)[1]})"
    return f" ({one_of(get_args(hint))})" if get_origin(hint) is Literal else ""


@dataclass(frozen=True)
class TableReader:
    """Reads tables of one kind of file."""

    error: type[Exception]  # raised for what is not allowed
    # What reads the value of a key with such an annotation, from the value and the key's path.
    special: Mapping[Any, Callable[[Any, str], Any]] = field(default_factory=dict)

    def build(self, kind: Any, table: Any, path: str) -> Any:
        """An instance of the dataclass ``kind`` from a TOML ``table`` that stands at ``path``.

        Raises:
            error: An unknown or missing key, or an impossible value.
        """
        if not isinstance(table, dict):
            raise self.error(f"{path} = {shown(table)}: must be a table")
        hints = _hints(kind)
        prefix = f"{path}." if path else ""
        for key in table:
            if key not in hints:
                raise self.error(
                    f'unknown key "{prefix}{key[:SHOWN]}" = {shown(table[key])}'
                    f"{nearest(key, hints)} (known here: "
                    f"{', '.join(name for name in hints if name != 'name' or path)})"
                )
        for one in dataclasses.fields(kind):
            if one.default is dataclasses.MISSING and one.name not in table:
                allowed = _allowed(hints[one.name])
                raise self.error(f'missing key "{prefix}{one.name}"{allowed}')
        return kind(**{key: self._value(hints[key], table[key], f"{prefix}{key}") for key in table})

    def _value(self, hint: Any, value: Any, path: str) -> Any:
        """One value, checked against its annotation."""
        if hint in self.special:
            return self.special[hint](value, path)
        origin, parts = get_origin(hint), get_args(hint)
        if origin is Annotated:
            return self._numbers(parts[0], parts[1], value, path)
        if origin in (types.UnionType, typing.Union):
            kinds = [part for part in parts if part is not types.NoneType]
            if len(kinds) == 1:
                return self._value(kinds[0], value, path)
            return self.table_of_a_kind(kinds, value, path)
        if dataclasses.is_dataclass(hint):
            return self.build(hint, value, path)
        if origin is tuple:
            if not isinstance(value, list):
                raise self.error(
                    f"{path} = {shown(value)}: must be an array of {_entries(parts[0], path)}"
                )
            return tuple(
                self._value(parts[0], item, f"{path}[{i}]") for i, item in enumerate(value)
            )
        if hint is bool:
            if not isinstance(value, bool):
                raise self.error(f"{path} = {shown(value)}: must be true or false")
            return value
        return self.word(hint, value, path)

    def table_of_a_kind(self, kinds: list[Any], value: Any, path: str, key: str = "kind") -> Any:
        """A table with a ``key`` that names its type, where there are several."""
        words = {get_args(_hints(kind)[key])[0]: kind for kind in kinds}
        if not isinstance(value, dict):
            raise self.error(f"{path} = {shown(value)}: must be a table")
        if key not in value:
            raise self.error(f'missing key "{path}.{key}": must be {one_of(words)}')
        word = value[key]
        if not isinstance(word, str) or word not in words:
            raise self.error(
                f"{path}.{key} = {shown(word)}: must be {one_of(words)}{nearest(word, words)}"
            )
        return self.build(words[word], value, path)

    def _numbers(
        self, hint: Any, allowed: Range, value: Any, path: str
    ) -> float | tuple[float, ...]:
        """A number or a vector of numbers within its range."""
        if hint is not float:
            size = len(get_args(hint))
            if not isinstance(value, list) or len(value) != size:
                raise self.error(
                    f"{path} = {shown(value)}: must be an array of {size} numbers ({allowed})"
                )
            return tuple(
                self._number(item, allowed, f"{path}[{i}]") for i, item in enumerate(value)
            )
        return self._number(value, allowed, path)

    def _number(self, value: Any, allowed: Range, path: str) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(f"{path} = {shown(value)}: must be a number ({allowed})")
        number = float(value)  # of an integer as well: toml_table lets none pass beyond all floats
        if not allowed.contains(number):
            raise self.error(f"{path} = {shown(value)}: must be {allowed}")
        return number

    def word(self, hint: Any, value: Any, path: str) -> str:
        """A text, or one of several."""
        parts = get_args(hint)
        if not isinstance(value, str):
            raise self.error(f"{path} = {shown(value)}: must be a text{_allowed(hint)}")
        if get_origin(hint) is Literal and value not in parts:
            hint = nearest(value, parts)
            raise self.error(f'{path} = "{value[:SHOWN]}": must be {one_of(parts)}{hint}')
        return value
