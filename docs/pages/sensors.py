"""The tables in docs/reference/sensors.md: every key of every sensor, and the suites' numbers."""

from __future__ import annotations

import dataclasses
import inspect
import re
import tomllib
import typing
from typing import Annotated, Any, Final

from sitl.scenario_file import PERFECT, SUITE_NAMES, SUITES
from sitl.sensors import keys

BEGIN: Final = "<!-- sensors: make pages -->\n"
END: Final = "<!-- end -->"
NAMES: Final = tuple(name for name in SUITE_NAMES if name != PERFECT)
TABLES: Final[dict[str, type[keys.Timing]]] = {
    name: kind
    for name, hint in typing.get_type_hints(keys.MeasuredSensors).items()
    for kind in (hint, *typing.get_args(hint))
    if isinstance(kind, type) and issubclass(kind, keys.Timing)
}


def reference() -> str:
    """The tables in Markdown."""
    numbers = {
        name: tomllib.loads((SUITES / f"{name}.toml").read_text(encoding="utf-8")) for name in NAMES
    }
    parts = ["### Every sensor\n", _table("timing", keys.Timing, {})]
    parts.append("Below, those that a suite gives a number are in one row.\n")
    for name, kind in TABLES.items():
        parts.append(f"### `[sensors.{name}]`\n")
        values = {suite: found[name] for suite, found in numbers.items() if name in found}
        parts.append(_table(name, kind, values))
    return "\n".join(parts) + "\n"


def inserted(page: str) -> str:
    """The page with the tables as they should be.

    Raises:
        ValueError: The page has no place for them.
    """
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError("the page has no place for the sensors")
    return f"{before}{begin}{reference()}{end}{after}"


def _table(name: str, kind: type[keys.Timing], values: dict[str, dict[str, Any]]) -> str:
    """Every key of one sensor: its own, and those of all sensors that a suite gives."""
    rows = [f"On board in `{'`, `'.join(values)}`.\n"] if values else []
    hints, meanings = typing.get_type_hints(kind, include_extras=True), _meanings(kind)
    common = {field.name for field in dataclasses.fields(keys.Timing)}
    timing = []
    for field in dataclasses.fields(kind):
        given = {suite: found.get(field.name) for suite, found in values.items()}
        value = _value(given) if values else ""
        named = f"`{field.name}`{f' = {value}' if value else ''}"
        if kind is not keys.Timing and field.name in common:
            timing += [named] if any(given.values()) else []
            continue
        allowed, meaning = _allowed(hints[field.name]), meanings[field.name]
        is_given = f" = {value}" if value else ""
        is_said = f": {meaning}" if meaning else ""
        rows.append(f"- `{field.name}` ({allowed}){is_given}{is_said}")
    if timing:
        rows.insert(1, f"- {', '.join(timing)}")
    return "\n".join(rows) + "\n"


def _meanings(kind: type[Any]) -> dict[str, str]:
    """What the comments beside, or above, each of its keys say."""
    found, above = {}, ""
    for line in "\n".join(map(inspect.getsource, kind.__mro__[-2::-1])).splitlines():
        comment = line.partition("# ")[2]
        key = re.match(r"    (\w+): ", line)
        if key:
            found[key.group(1)] = f"{above} {comment}".strip()
        above = f"{above} {comment}" if line.startswith("    # ") else ""
    return found


def _value(given: dict[str, Any]) -> str:
    """What the suites give: one number where they agree, else suite by suite."""
    shown = {suite: _shown(value) for suite, value in given.items() if value is not None}
    if len(shown) == len(given) and len(set(shown.values())) == 1:
        return next(iter(shown.values()))
    return ", ".join(f"`{suite}` {value}" for suite, value in shown.items())


def _allowed(hint: Any) -> str:
    if typing.get_origin(hint) is not Annotated:
        return "true, false"
    plain, permitted = typing.get_args(hint)
    count = len(typing.get_args(plain))
    span = str(permitted).replace(" to ", "…")
    return f"{count} numbers, {span}" if count else span


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return "[" + ", ".join(f"{entry:g}" for entry in value) + "]"
    return f"{value:g}"
