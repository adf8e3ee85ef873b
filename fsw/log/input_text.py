"""What a tick was given, as JSON and back, exactly.

The inputs of a tick are dataclasses and named tuples of numbers, texts and tuples, and more kinds
of them come with every capability. So nothing here knows one by name: the conversion follows the
type annotations, and an input that it could not bring back is refused when the flight software
starts.
Python writes a float in as many digits as identify it, so no bit is lost.
"""

from __future__ import annotations

import dataclasses
import enum
import json
import types
import typing
from collections.abc import Callable
from typing import Any, Final

Convert = Callable[[Any], Any]

_PLAIN: Final = (int, float, bool, str)
# ``json.dumps`` with separators makes one of these every time: a quarter of a plan's cost.
_ENCODER: Final = json.JSONEncoder(separators=(",", ":"))


class InputText:
    """Converts the fields of one dataclass."""

    def __init__(self, kind: type, instead: dict[type, Any] | None = None) -> None:
        """Prepare the conversion.

        Args:
            kind: A dataclass.
            instead: For some types the value that is written whatever the real one is, for what
                is measured by the wall clock and must not be in a file that is to repeat.

        Raises:
            TypeError: A field has a type that could not be brought back.
        """
        self.fields: dict[str, Any] = typing.get_type_hints(kind)
        self._instead = instead or {}
        self._write = {name: self._writer(hint) for name, hint in self.fields.items()}
        self._read = {name: self._reader(hint) for name, hint in self.fields.items()}

    @property
    def schema(self) -> str:
        """The shape of everything that can be written; equal in builds that read each other."""
        return json.dumps({name: _shape(hint) for name, hint in self.fields.items()})

    def text(self, name: str, value: object) -> bytes:
        """One field as JSON, ASCII only."""
        return _ENCODER.encode(self._write[name](value)).encode("ascii")

    def value(self, name: str, text: bytes) -> Any:
        """The field again.

        Raises:
            ValueError: The text is not what :meth:`text` writes.
        """
        try:
            return self._read[name](json.loads(text))
        except (TypeError, LookupError, AttributeError, ArithmeticError, ValueError) as error:
            raise ValueError(f"input {name} cannot be read: {error}") from None

    def _writer(self, hint: Any) -> Convert:
        if hint in self._instead:
            fixed = self._writer_of_class(hint)(self._instead[hint])
            return lambda _: fixed
        if _is_plain(hint):
            return _same
        if _is_tuple(hint):
            return self._writer_of_tuple([self._writer(part) for part in _elements(hint)])
        if _is_union(hint):
            return self._writer_of_union(_members(hint))
        return self._writer_of_class(hint)

    def _writer_of_tuple(self, parts: list[Convert]) -> Convert:
        if all(part is _same for part in parts):
            return _same
        if len(parts) == 1:
            return lambda values: [parts[0](value) for value in values]
        return lambda values: [part(value) for part, value in zip(parts, values, strict=True)]

    def _writer_of_union(self, members: tuple[type, ...]) -> Convert:
        known = {member: self._writer(member) for member in members}
        if len(members) == 1:
            (convert,) = known.values()
            return lambda value: None if value is None else convert(value)
        return lambda v: None if v is None else {type(v).__name__: known[type(v)](v)}

    def _writer_of_class(self, kind: Any) -> Convert:
        if isinstance(kind, type) and issubclass(kind, enum.Enum):
            return lambda member: member.name
        names, parts = zip(*_parts(kind).items(), strict=True)
        writers = [self._writer(part) for part in parts]
        if all(write is _same for write in writers):
            return lambda value: {name: getattr(value, name) for name in names}
        pairs = list(zip(names, writers, strict=True))
        return lambda value: {name: write(getattr(value, name)) for name, write in pairs}

    def _reader(self, hint: Any) -> Convert:
        if _is_plain(hint):
            return float if hint is float else _same
        if _is_tuple(hint):
            parts = [self._reader(part) for part in _elements(hint)]
            return lambda values: tuple(
                parts[min(k, len(parts) - 1)](value) for k, value in enumerate(values)
            )
        if _is_union(hint):
            return self._reader_of_union(_members(hint))
        if issubclass(hint, enum.Enum):
            return lambda name: hint[name]
        readers = {name: self._reader(part) for name, part in _parts(hint).items()}
        return lambda values: hint(**{name: read(values[name]) for name, read in readers.items()})

    def _reader_of_union(self, members: tuple[type, ...]) -> Convert:
        readers = {member.__name__: self._reader(member) for member in members}
        if len(members) == 1:
            (read,) = readers.values()
            return lambda value: None if value is None else read(value)

        def tagged(value: dict[str, Any] | None) -> Any:
            if value is None:
                return None
            ((name, content),) = value.items()
            return readers[name](content)

        return tagged


def _same(value: Any) -> Any:
    return value


def _is_plain(hint: Any) -> bool:
    return hint in _PLAIN


def _is_tuple(hint: Any) -> bool:
    return typing.get_origin(hint) is tuple


def _is_union(hint: Any) -> bool:
    return typing.get_origin(hint) in (types.UnionType, typing.Union)


def _elements(hint: Any) -> list[Any]:
    """Types of a tuple's elements; ``tuple[X, ...]`` has one."""
    return [part for part in typing.get_args(hint) if part is not Ellipsis]


def _members(hint: Any) -> tuple[type, ...]:
    return tuple(part for part in typing.get_args(hint) if part is not types.NoneType)


def _parts(kind: Any) -> dict[str, Any]:
    """Names and types of the fields of a dataclass or named tuple.

    Raises:
        TypeError: It is neither.
    """
    named = isinstance(kind, type) and issubclass(kind, tuple) and hasattr(kind, "_fields")
    if not named and not (isinstance(kind, type) and dataclasses.is_dataclass(kind)):
        raise TypeError(f"{kind} cannot be an input of a tick: it would not survive a log")
    return typing.get_type_hints(kind)


def _shape(hint: Any) -> Any:
    if _is_plain(hint):
        return hint.__name__
    if _is_tuple(hint):
        return [_shape(part) for part in _elements(hint)]
    if _is_union(hint):
        return {member.__name__: _shape(member) for member in _members(hint)}
    if issubclass(hint, enum.Enum):
        return [member.name for member in hint]
    return {name: _shape(part) for name, part in _parts(hint).items()}
