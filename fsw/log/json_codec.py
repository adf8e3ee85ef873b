"""Inputs of a tick as JSON and back, exactly.

The conversion follows the type annotations of dataclasses and named tuples, so that a new input
needs no code here. A type that could not be read back is rejected when the flight software starts.
Python writes a float with as many digits as identify it, so no bit is lost.
"""

from __future__ import annotations

import dataclasses
import enum
import json
import types
import typing
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import orjson

from command_line.bounded_json import unrepeated

_NULL: Final = b"null"

Convert = Callable[[Any], Any]

_PLAIN: Final = (int, float, bool, str)
# For what orjson does not write as it is. With plans, of some hundred numbers, it takes 20 times as
# long.
_ENCODER: Final = json.JSONEncoder(separators=(",", ":"))


class _Codec(NamedTuple):
    """How values of one annotation are written and read."""

    shape: Any  # names and types as JSON; equal in builds that read each other
    write: Convert  # to what ``json`` encodes
    read: Convert  # from what it decodes


class JsonCodec:
    """Converts the fields of one dataclass."""

    def __init__(self, kind: type, instead: dict[type, Any] | None = None) -> None:
        """Prepare the conversion of a dataclass.

        The values of ``instead`` are written in place of all values of their type: wall-clock times
        would make two logs of the same flight differ.

        Raises:
            TypeError: A field has a type that could not be read back.
        """
        hints = typing.get_type_hints(kind)
        self._codecs = {name: _codec(hint, instead or {}) for name, hint in hints.items()}
        self.names = tuple(hints)

    @property
    def schema(self) -> str:
        """The shape of everything that can be written; equal in builds that read each other."""
        return json.dumps({name: codec.shape for name, codec in self._codecs.items()})

    def encode(self, name: str, value: object) -> bytes:
        """One field as JSON, ASCII only."""
        written = self._codecs[name].write(value)
        try:
            text = orjson.dumps(written)
        except TypeError:  # a whole number of more than 64 bits, or text that is no Unicode
            text = _NULL
        # null may stand for a number that is none.
        if _NULL in text or not text.isascii():
            return _ENCODER.encode(written).encode("ascii")
        return text

    def decode(self, name: str, text: bytes) -> Any:
        """The field again; ``ValueError`` if the text is not what :meth:`encode` writes."""
        try:
            found = json.loads(text, object_pairs_hook=unrepeated)  # noqa: TID251  # NaN is in it
            return self._codecs[name].read(found)
        except (TypeError, LookupError, AttributeError, ArithmeticError, ValueError) as error:
            raise ValueError(f"input {name} cannot be read: {error}") from None
        except RecursionError:
            raise ValueError(f"input {name} cannot be read: nested too deeply") from None


def _codec(hint: Any, instead: dict[type, Any]) -> _Codec:
    parts = [part for part in typing.get_args(hint) if part not in (Ellipsis, types.NoneType)]
    inner = [_codec(part, instead) for part in parts]
    origin = typing.get_origin(hint)
    if hint in _PLAIN:
        return _Codec(hint.__name__, _same, float if hint is float else _same)
    if origin is tuple:
        return _tuple(inner)
    if origin in (types.UnionType, typing.Union):
        return (
            _optional(inner[0], parts[0].__name__)
            if len(parts) == 1
            else _tagged(dict(zip(parts, inner, strict=True)))
        )
    if isinstance(hint, type) and issubclass(hint, enum.Enum):
        return _Codec([one.name for one in hint], lambda one: one.name, lambda name: hint[name])
    named = isinstance(hint, type) and issubclass(hint, tuple) and hasattr(hint, "_fields")
    if not named and not (isinstance(hint, type) and dataclasses.is_dataclass(hint)):
        raise TypeError(f"{hint} cannot be an input of a tick: it would not survive a log")
    codec = _record(hint, instead)
    if hint in instead:
        fixed = codec.write(instead[hint])
        return codec._replace(write=lambda _: fixed)
    return codec


def _record(kind: Any, instead: dict[type, Any]) -> _Codec:
    """A dataclass or named tuple, as an object."""
    fields = {name: _codec(hint, instead) for name, hint in typing.get_type_hints(kind).items()}
    writers = [(name, codec.write) for name, codec in fields.items()]
    readers = [(name, codec.read) for name, codec in fields.items()]
    plain = all(write is _same for _, write in writers)
    return _Codec(
        {name: codec.shape for name, codec in fields.items()},
        (lambda one: {name: getattr(one, name) for name in fields})
        if plain
        else (lambda one: {name: write(getattr(one, name)) for name, write in writers}),
        lambda values: kind(**{name: read(values[name]) for name, read in readers}),
    )


def _tuple(inner: list[_Codec]) -> _Codec:
    """An array; ``tuple[X, ...]`` has one inner type for all elements."""
    readers, last = [codec.read for codec in inner], len(inner) - 1
    return _Codec(
        [codec.shape for codec in inner],
        _tuple_writer([codec.write for codec in inner]),
        lambda values: tuple(readers[min(k, last)](value) for k, value in enumerate(values)),
    )


def _tuple_writer(parts: list[Convert]) -> Convert:
    if all(part is _same for part in parts):
        return _same
    if len(parts) == 1:
        return lambda values: [parts[0](value) for value in values]
    return lambda values: [part(value) for part, value in zip(parts, values, strict=True)]


def _optional(one: _Codec, name: str) -> _Codec:
    return _Codec(
        {name: one.shape},
        lambda value: None if value is None else one.write(value),
        lambda value: None if value is None else one.read(value),
    )


def _tagged(members: dict[Any, _Codec]) -> _Codec:
    """One of several types, as an object with its name as the only key."""
    readers = {kind.__name__: codec.read for kind, codec in members.items()}

    def write(value: Any) -> Any:
        return None if value is None else {type(value).__name__: members[type(value)].write(value)}

    def read(value: dict[str, Any] | None) -> Any:
        if value is None:
            return None
        ((name, content),) = value.items()
        return readers[name](content)

    return _Codec({kind.__name__: codec.shape for kind, codec in members.items()}, write, read)


def _same(value: Any) -> Any:
    return value
