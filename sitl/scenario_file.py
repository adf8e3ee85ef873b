"""Reads scenario files. Invalid ones are rejected with the key, the value and what is allowed."""

from __future__ import annotations

import dataclasses
import difflib
import hashlib
import math
import tomllib
import types
import typing
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin

from command_line.bounded_file import read_bounded
from command_line.bounded_toml import TomlError, toml_table
from sitl.ranges import ROUNDED
from sitl.scenario import V3, Range, Scenario, ScenarioWall, ScenarioZone, Sensors
from sitl.sensors.keys import MeasuredSensors, SuiteName

_DIGITS = 12
_MAX_BYTES = 2 * 1024 * 1024  # of a file: a reference of 20,000 points; zones are a hundredth
_MAX_CSV = 2 * 1024 * 1024  # of a table of points
COLUMNS = ["time_s", "north_m", "east_m", "down_m", "yaw_deg"]  # of one, the last if there is yaw
_SHOWN = 80  # characters of a value in a sentence
_UNIT = 1e-6  # [1] by which a normal's length is off 1 without any rounding
PACKAGED = Path(__file__).parent / "scenarios"
SUITES = Path(__file__).parent / "sensors" / "suites"
PERFECT = "perfect"
SUITE_NAMES: tuple[str, ...] = get_args(SuiteName)


Plane = TypeVar("Plane", ScenarioWall, ScenarioZone)


class ScenarioError(ValueError):
    """A scenario that cannot be flown; the message says which key and what is allowed."""


def scenario_names() -> tuple[str, ...]:
    """Names of the scenarios that come with the simulator."""
    return tuple(sorted(path.stem for path in PACKAGED.glob("*.toml")))


def load_scenario(name_or_path: str, suite: str | None = None) -> Scenario:
    """Read a packaged scenario by name, or any by path; ``suite`` as of ``parse_scenario``.

    Raises:
        ScenarioError: Unknown name, unreadable file, unknown key or impossible value.
    """
    path = _path(name_or_path)
    try:
        return parse_scenario(_content(path).decode("utf-8"), path.stem, suite, path.parent)
    except UnicodeDecodeError as error:
        raise ScenarioError(f"scenario {path} is not TOML: it is not UTF-8") from error


def check_pacing(scenario: Scenario, *, realtime: bool) -> None:
    """Refuse faults that a flight in lockstep cannot have.

    Raises:
        ScenarioError: With the key and what to do.
    """
    for i, fault in enumerate(scenario.faults):
        if fault.of_real_time and not realtime:
            raise ScenarioError(f"faults[{i}]: {fault} needs real time; add --realtime")


def suite_of(scenario: Scenario) -> str:
    """Name of the suite of sensors that a scenario is flown with."""
    sensors = scenario.sensors
    return sensors.suite if isinstance(sensors, MeasuredSensors) else PERFECT


def scenario_digest(name_or_path: str) -> str:
    """First digits of the SHA-256 of the file; they differ if two scenarios of one name differ.

    Raises:
        ScenarioError: Unknown name or unreadable file.
    """
    path = _path(name_or_path)
    digest = hashlib.sha256(_content(path))
    beside = points_file(path)
    if beside is not None:
        digest.update(read_points(beside)[1])
    return digest.hexdigest()[:_DIGITS]


def points_file(path: Path) -> Path | None:
    """The table of points that a scenario file names, beside it; None: it names none."""
    try:
        named = tomllib.loads(_content(path).decode("utf-8")).get("trajectory", {}).get("file")
    except (ValueError, AttributeError, RecursionError):
        return None  # whoever reads it as a scenario says what is wrong
    return path.parent / named if isinstance(named, str) else None


def _path(name_or_path: str) -> Path:
    path = Path(name_or_path)
    if name_or_path in scenario_names():
        return PACKAGED / f"{name_or_path}.toml"
    if path.suffix != ".toml":
        raise ScenarioError(
            f'unknown scenario "{name_or_path}"{_nearest(name_or_path, scenario_names())}; '
            f"known: {', '.join(scenario_names())}, or the path of a .toml file"
        )
    return path


def _content(path: Path) -> bytes:
    try:
        return read_bounded(path, _MAX_BYTES)
    except OSError as error:
        raise ScenarioError(f"cannot read scenario {path}: {error.strerror}") from error


def parse_scenario(
    text: str, name: str, suite: str | None = None, folder: Path | None = None
) -> Scenario:
    """The scenario that a TOML text describes, flown with a ``suite`` of sensors if one is named.

    What the text says about sensors then counts only if it is about the same suite. Files that it
    names are in ``folder``.

    Raises:
        ScenarioError: Not TOML, unknown key or impossible value.
    """
    try:
        return _parsed(text, name, suite, folder)
    except RecursionError:
        raise ScenarioError(f"scenario {name} is nested too deeply") from None


def _parsed(text: str, name: str, suite: str | None, folder: Path | None) -> Scenario:
    try:
        table = toml_table(text)
    except TomlError as error:
        raise ScenarioError(f"scenario {name} is {error}") from error
    if "name" in table:
        raise ScenarioError('unknown key "name": a scenario is named by its file')
    if suite is not None:
        given = table.get("sensors", {})
        same = isinstance(given, dict) and given.get("suite", PERFECT) == suite
        table["sensors"] = {**(given if same else {}), "suite": suite}
    curve = table.get("trajectory")
    if isinstance(curve, dict) and curve.get("kind") == "points" and "file" in curve:
        table["trajectory"] = _with_points(curve, folder)
    scenario: Scenario = build_table(Scenario, {**table, "name": name}, "")
    return dataclasses.replace(
        scenario,
        walls=tuple(map(_with_unit_normal, scenario.walls)),
        zones=tuple(map(_with_unit_normal, scenario.zones)),
    )


def _with_points(curve: dict[str, Any], folder: Path | None) -> dict[str, Any]:
    """A table of points with the numbers of the file that it names."""
    named = curve["file"]
    inside = isinstance(named, str) and not ({"..", "/"} & set(Path(named).parts))
    if not inside or folder is None:
        raise ScenarioError(
            f"trajectory.file = {_shown(named)}: must be a file beside the scenario's"
        )
    for key in ("time_s", "position_m", "yaw_deg"):
        if key in curve:
            raise ScenarioError(f"trajectory.{key}: cannot be given together with file")
    columns, _ = read_points(folder / named)
    return {key: value for key, value in curve.items() if key != "file"} | columns


def read_points(path: Path) -> tuple[dict[str, list[Any]], bytes]:
    """The points of a CSV file, as keys of a scenario's trajectory, and its bytes.

    Raises:
        ScenarioError: It cannot be read, or a line of it is not what the first one says.
    """
    try:
        data = read_bounded(path, _MAX_CSV)
        lines = data.decode("utf-8-sig").splitlines()
    except OSError as error:
        raise ScenarioError(f"cannot read points {path}: {error.strerror}") from error
    except UnicodeDecodeError:
        raise ScenarioError(f"points {path} are not CSV: they are not UTF-8") from None
    rows = [(k, line) for k, line in enumerate(lines, start=1) if line.strip() and line[0] != "#"]
    head = [word.strip() for word in rows[0][1].split(",")] if rows else []
    if head not in (COLUMNS[:-1], COLUMNS):
        raise ScenarioError(
            f'points {path}: the first line must be "{",".join(COLUMNS[:-1])}", with '
            f'",{COLUMNS[-1]}" if there is yaw'
        )
    found: list[list[float]] = []
    for number, line in rows[1:]:
        try:
            values = [float(word) for word in line.split(",")]
        except ValueError:
            values = []
        if len(values) != len(head) or not all(map(math.isfinite, values)):
            raise ScenarioError(
                f"points {path}, line {number}: must be {len(head)} finite numbers, is "
                f"{_shown(line)}"
            )
        found.append(values)
    columns: dict[str, list[Any]] = {"time_s": [row[0] for row in found]}
    columns["position_m"] = [row[1:4] for row in found]
    if len(head) == len(COLUMNS):
        columns["yaw_deg"] = [row[4] for row in found]
    return columns, data


def _with_unit_normal(zone: Plane) -> Plane:
    """A plane whose normal was written with a few digits, with it as a unit vector [1]."""
    normal: V3 | None = getattr(zone, "normal", None)
    if normal is None:
        return zone
    length = math.hypot(*normal)
    # Nearer to 1 it is a unit vector as it is written; further off it is some other vector.
    if abs(length - 1.0) <= _UNIT or abs(length - 1.0) > ROUNDED:
        return zone
    changed: Any = zone  # whichever of the two it is
    unit = tuple(part / length for part in normal)
    return dataclasses.replace(changed, normal=unit)  # type: ignore[no-any-return]


def _nearest(word: object, known: Iterable[str]) -> str:
    match = difflib.get_close_matches(str(word)[:_SHOWN], list(known), n=1, cutoff=0.4)
    return f', did you mean "{match[0]}"?' if match else ""


def _shown(value: object) -> str:
    """A value as sentences quote it, in part if it is long."""
    try:
        text = repr(value)
    except ValueError:  # an integer of thousands of digits
        return "a number too long to show"
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}…"


@cache
def _hints(kind: Any) -> dict[str, Any]:
    """The annotations of a dataclass, which Python evaluates anew each time, for 0.3 ms."""
    return typing.get_type_hints(kind, include_extras=True)


def build_table(kind: Any, table: Any, path: str) -> Any:
    """An instance of the dataclass ``kind`` from a TOML ``table`` that stands at ``path``.

    Raises:
        ScenarioError: An unknown or missing key, or an impossible value.
    """
    if not isinstance(table, dict):
        raise ScenarioError(f"{path} = {_shown(table)}: must be a table")
    hints = _hints(kind)
    prefix = f"{path}." if path else ""
    for key in table:
        if key not in hints:
            raise ScenarioError(
                f'unknown key "{prefix}{key[:_SHOWN]}" = {_shown(table[key])}{_nearest(key, hints)}'
                f" (known here: {', '.join(name for name in hints if name != 'name' or path)})"
            )
    for field in dataclasses.fields(kind):
        if field.default is dataclasses.MISSING and field.name not in table:
            allowed = _allowed(hints[field.name])
            raise ScenarioError(f'missing key "{prefix}{field.name}"{allowed}')
    return kind(**{key: _value(hints[key], table[key], f"{prefix}{key}") for key in table})


def _value(hint: Any, value: Any, path: str) -> Any:
    """One value, checked against its annotation."""
    origin, parts = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return _numbers(parts[0], parts[1], value, path)
    if hint == Sensors | MeasuredSensors:
        return _sensors(value, path)
    if origin is types.UnionType:
        return _table_of_a_kind([part for part in parts if part is not types.NoneType], value, path)
    if hint is ScenarioZone:
        # Loads numba, for which a scenario without zones need not wait.
        from sitl.shapes import TABLES

        return _table_of_a_kind(list(TABLES), value, path, "shape")
    if dataclasses.is_dataclass(hint):
        return build_table(hint, value, path)
    if origin is tuple:
        if not isinstance(value, list):
            raise ScenarioError(
                f"{path} = {_shown(value)}: must be an array of {_entries(parts[0], path)}"
            )
        return tuple(_value(parts[0], item, f"{path}[{i}]") for i, item in enumerate(value))
    if hint is bool:
        if not isinstance(value, bool):
            raise ScenarioError(f"{path} = {_shown(value)}: must be true or false")
        return value
    return _word(hint, value, path)


def _entries(hint: Any, path: str) -> str:
    """What an array consists of, as a sentence says it."""
    if get_origin(hint) is Annotated:
        size = len(get_args(get_args(hint)[0]))
        return f"arrays of {size} numbers" if size else f"numbers ({get_args(hint)[1]})"
    if dataclasses.is_dataclass(hint) or get_origin(hint) is types.UnionType:
        return f"tables ([[{path}]])"
    return 'texts, such as ["a", "b"]'


def _sensors(value: Any, path: str) -> Sensors | MeasuredSensors:
    """The numbers of a suite, with those of the scenario in their place where it has any."""
    if not isinstance(value, dict):
        raise ScenarioError(f"{path} = {_shown(value)}: must be a table")
    own = {key: part for key, part in value.items() if key != "suite"}
    suite = _word(SuiteName, value.get("suite", PERFECT), f"{path}.suite")
    if suite == PERFECT:
        exact: Sensors = build_table(Sensors, own, path)
        return exact
    tables = tomllib.loads((SUITES / f"{suite}.toml").read_text(encoding="utf-8"))
    for key, part in own.items():
        if key not in tables:
            raise ScenarioError(
                f'unknown key "{path}.{key}": the suite "{suite}" has no such sensor'
                f"{_nearest(key, tables)} (known here: suite, {', '.join(tables)})"
            )
        if not isinstance(part, dict):
            raise ScenarioError(f"{path}.{key} = {_shown(part)}: must be a table")
        tables[key] = {**tables[key], **part}
    measured: MeasuredSensors = build_table(MeasuredSensors, {**tables, "suite": suite}, path)
    return measured


def _word(hint: Any, value: Any, path: str) -> str:
    """A text, or one of several."""
    parts = get_args(hint)
    if not isinstance(value, str):
        raise ScenarioError(f"{path} = {_shown(value)}: must be a text{_allowed(hint)}")
    if get_origin(hint) is Literal and value not in parts:
        hint = _nearest(value, parts)
        raise ScenarioError(f'{path} = "{value[:_SHOWN]}": must be {_words(parts)}{hint}')
    return value


def _table_of_a_kind(kinds: list[Any], value: Any, path: str, key: str = "kind") -> Any:
    """A table with a ``key`` that names its type, where there are several."""
    if len(kinds) == 1:
        return build_table(kinds[0], value, path)
    words = {get_args(_hints(kind)[key])[0]: kind for kind in kinds}
    if not isinstance(value, dict):
        raise ScenarioError(f"{path} = {_shown(value)}: must be a table")
    if key not in value:
        raise ScenarioError(f'missing key "{path}.{key}": must be {_words(words)}')
    word = value[key]
    if not isinstance(word, str) or word not in words:
        raise ScenarioError(
            f"{path}.{key} = {_shown(word)}: must be {_words(words)}{_nearest(word, words)}"
        )
    return build_table(words[word], value, path)


def _numbers(hint: Any, allowed: Range, value: Any, path: str) -> float | tuple[float, ...]:
    """A number or a vector of numbers within its range."""
    if hint is not float:
        size = len(get_args(hint))
        if not isinstance(value, list) or len(value) != size:
            raise ScenarioError(
                f"{path} = {_shown(value)}: must be an array of {size} numbers ({allowed})"
            )
        return tuple(_number(item, allowed, f"{path}[{i}]") for i, item in enumerate(value))
    return _number(value, allowed, path)


def _number(value: Any, allowed: Range, path: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ScenarioError(f"{path} = {_shown(value)}: must be a number ({allowed})")
    try:
        number = float(value)
    except OverflowError:  # an integer beyond all floats; infinity may be allowed, and is not meant
        number = math.nan
    if not allowed.contains(number):
        raise ScenarioError(f"{path} = {_shown(value)}: must be {allowed}")
    return number


def _words(words: Iterable[str]) -> str:
    return "one of " + ", ".join(f'"{word}"' for word in words)


def _allowed(hint: Any) -> str:
    """What a sentence about a key says in brackets."""
    if get_origin(hint) is Annotated:
        return f" ({get_args(hint)[1]})"
    return f" ({_words(get_args(hint))})" if get_origin(hint) is Literal else ""
