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
    suites = {name: (SUITES / f"{name}.toml").read_text(encoding="utf-8") for name in NAMES}
    parts = ["### Every sensor\n", _table("timing", keys.Timing, {}, {})]
    parts.append("Below, these have a row where a suite gives a number, and no meaning again.\n")
    numbers = {name: tomllib.loads(text) for name, text in suites.items()}
    notes = {name: _comments(text) for name, text in suites.items()}
    for name, kind in TABLES.items():
        parts.append(f"### `[sensors.{name}]`\n")
        values = {suite: found[name] for suite, found in numbers.items() if name in found}
        said = {suite: found.get(name, {}) for suite, found in notes.items()}
        parts.append(_table(name, kind, values, said))
    parts.append("### Sources\n")
    cited: dict[str, list[str]] = {}
    for name, text in suites.items():
        for source in _sources(text):
            cited.setdefault(source, []).append(name)
    marks = [source.split()[0] for source in cited]
    for source, of in sorted(cited.items(), key=lambda row: int(row[0][1 : row[0].index("]")])):
        only = f" (`{'`, `'.join(of)}`)" if marks.count(source.split()[0]) > 1 else ""
        parts.append(f"- {source}{only}")
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


def _table(
    name: str,
    kind: type[keys.Timing],
    values: dict[str, dict[str, Any]],
    notes: dict[str, dict[str, str]],
) -> str:
    """Every key of one sensor: its own, and those of all sensors that a suite gives."""
    rows = [f"On board in `{'`, `'.join(values)}`.\n"] if values else []
    hints, meanings = typing.get_type_hints(kind, include_extras=True), _meanings(kind)
    common = {field.name for field in dataclasses.fields(keys.Timing)}
    for field in dataclasses.fields(kind):
        given = [found.get(field.name) for found in values.values()]
        if kind is not keys.Timing and field.name in common and not any(given):
            continue
        repeated = kind is not keys.Timing and field.name in common
        meaning = "" if repeated else meanings[field.name]
        allowed = "" if repeated else _allowed(hints[field.name])
        value = _value(dict(zip(values, given, strict=True))) if values else ""
        source = _source([notes[suite].get(field.name, "") for suite in values])
        line = f"- `{field.name}`"
        line += f" ({allowed})" if allowed else ""
        line += f" = {value}" if value else ""
        line += f": {meaning}" if meaning else ""
        line += f" [{source}]" if source else ""
        rows.append(line)
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


def _source(said: list[str]) -> str:
    # The head of the page says that a number without a source is our choice.
    sources = (re.sub(r"(, |: )?our choice(: )?", "", text) for text in said)
    return "; ".join(dict.fromkeys(text for text in sources if text))


def _comments(text: str) -> dict[str, dict[str, str]]:
    """What stands behind each key of a suite's file, sensor by sensor."""
    found: dict[str, dict[str, str]] = {}
    table = ""
    for line in text.splitlines():
        heading = re.match(r"\[(\w+)\]", line)
        if heading:
            table = heading.group(1)
            found[table] = {}
        noted = re.match(r"(\w+) = [^#]+# (.+)", line)
        if noted:
            found[table][noted.group(1)] = noted.group(2)
    return found


def _sources(text: str) -> list[str]:
    """The numbered sources at the head of a suite's file, one text each."""
    head = text.partition("\n\n")[0].replace("\n#     ", " ")
    return re.findall(r"^# (\[\d+\] .+)$", head, re.MULTILINE)
