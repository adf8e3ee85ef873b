"""A scenario as the text of a scenario file: reading it gives the same scenario again.

Only what differs from the defaults is written; of a suite of sensors every number is.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator
from typing import Any

from sitl.scenario import Scenario
from sitl.sensors.keys import MeasuredSensors

# Where there are several kinds of a table, it says its own, whatever the default.
_KINDS = ("kind", "shape")


def scenario_text(scenario: Scenario, comment: str = "") -> str:
    """The TOML text of a scenario, after a comment of one or several lines.

    The name is left out: a scenario is named by its file.
    """
    head = "".join(f"# {line}\n" for line in comment.splitlines())
    return head + "\n".join(_lines("", scenario, ("name",))) + "\n"


def _lines(path: str, value: Any, without: tuple[str, ...] = ()) -> Iterator[str]:
    """The lines of one table: its numbers and words first, then the tables in it."""
    tables: list[tuple[str, Any]] = []
    whole = isinstance(value, MeasuredSensors) or path.startswith("sensors.")
    for field in dataclasses.fields(value):
        held = getattr(value, field.name)
        if field.name in without or held is None:
            continue
        if not whole and held == field.default and field.name not in _KINDS:
            continue
        if dataclasses.is_dataclass(held) or _is_array_of_tables(held):
            tables.append((field.name, held))
        else:
            yield f"{field.name} = {_word(held)}"
    prefix = f"{path}." if path else ""
    for name, held in tables:
        if isinstance(held, tuple):
            for one in held:
                yield f"\n[[{prefix}{name}]]"
                yield from _lines(f"{prefix}{name}", one)
        else:
            yield f"\n[{prefix}{name}]"
            yield from _lines(f"{prefix}{name}", held)


def _is_array_of_tables(value: Any) -> bool:
    return isinstance(value, tuple) and bool(value) and dataclasses.is_dataclass(value[0])


def _word(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # DEL is the one character that JSON writes as it is and TOML does not allow.
        return json.dumps(value, ensure_ascii=False, allow_nan=False).replace("\x7f", "\\u007f")
    if isinstance(value, tuple):
        if value and isinstance(value[0], tuple):  # a row a line, which people read
            return "[\n" + "".join(f"  {_word(one)},\n" for one in value) + "]"
        return "[" + ", ".join(_word(one) for one in value) + "]"
    return repr(float(value))
