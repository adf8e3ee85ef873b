"""Frozen dataclasses as the text of a TOML file, which ``toml_tables`` reads again."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Iterator
from typing import Any

# Where there are several kinds of a table, it says its own, whatever the default.
_KINDS = ("kind", "shape")


def toml_lines(
    path: str,
    value: Any,
    without: tuple[str, ...] = (),
    whole: Callable[[str, Any], bool] = lambda path, value: False,
) -> Iterator[str]:
    """The lines of one table at a ``path``: its numbers and words first, then the tables in it.

    What equals its default is left out, but for tables that are written ``whole``.
    """
    tables: list[tuple[str, Any]] = []
    for field in dataclasses.fields(value):
        held = getattr(value, field.name)
        if field.name in without or held is None:
            continue
        if not whole(path, value) and held == field.default and field.name not in _KINDS:
            continue
        if dataclasses.is_dataclass(held) or _is_array_of_tables(held):
            tables.append((field.name, held))
        else:
            yield f"{field.name} = {toml_word(held)}"
    prefix = f"{path}." if path else ""
    for name, held in tables:
        for one in held if isinstance(held, tuple) else (held,):
            yield f"\n[[{prefix}{name}]]" if isinstance(held, tuple) else f"\n[{prefix}{name}]"
            yield from toml_lines(f"{prefix}{name}", one, (), whole)


def _is_array_of_tables(value: Any) -> bool:
    return isinstance(value, tuple) and bool(value) and dataclasses.is_dataclass(value[0])


def toml_word(value: Any) -> str:
    """One value."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # DEL is the one character that JSON writes as it is and TOML does not allow.
        return json.dumps(value, ensure_ascii=False, allow_nan=False).replace("\x7f", "\\u007f")
    if isinstance(value, tuple):
        if value and isinstance(value[0], tuple):  # a row a line, which people read
            return "[\n" + "".join(f"  {toml_word(one)},\n" for one in value) + "]"
        return "[" + ", ".join(toml_word(one) for one in value) + "]"
    return repr(float(value))
