"""Reads scenario files. Invalid ones are rejected with the key, the value and what is allowed."""

from __future__ import annotations

import dataclasses
import hashlib
import math
from pathlib import Path
from typing import Any, Final, TypeVar, get_args

from command_line.bounded_file import read_bounded
from command_line.bounded_toml import TomlError, toml_table
from command_line.toml_tables import TableReader, nearest, shown
from command_line.values import plain_float
from sitl.ranges import ROUNDED, UNIT
from sitl.scenario import (
    V3,
    Scenario,
    ScenarioWall,
    ScenarioZone,
    Sensors,
    Trajectory,
    is_vehicle_file,
    start_angles,
    vehicle_of,
)
from sitl.sensors.keys import MeasuredSensors, SuiteName
from vehicles.description import Vehicle

_DIGITS = 12
_MAX_BYTES = 2 * 1024 * 1024  # of a file: a reference of 20,000 points; zones are a hundredth
_MAX_CSV = 2 * 1024 * 1024  # of a table of points
COLUMNS = ["time_s", "north_m", "east_m", "down_m", "yaw_deg"]  # of one, the last if there is yaw
PACKAGED = Path(__file__).parent / "scenarios"
SUITES = Path(__file__).parent / "sensors" / "suites"
PERFECT = "perfect"
EXTRA = "force_torque"  # a sensor that any suite but that may have beside its own
SUITE_NAMES: tuple[str, ...] = get_args(SuiteName)


Plane = TypeVar("Plane", ScenarioWall, ScenarioZone, Trajectory)


class ScenarioError(ValueError):
    """A scenario that cannot be flown; the message says which key and what is allowed."""


def scenario_names() -> tuple[str, ...]:
    """Names of the scenarios that come with the simulator."""
    return tuple(sorted(path.stem for path in PACKAGED.glob("*.toml")))


def load_scenario(
    name_or_path: str, suite: str | None = None, vehicle: str | None = None
) -> Scenario:
    """Read a packaged scenario by name, or any by path; ``suite`` as of ``parse_scenario``.

    With a ``vehicle``, by name or path, in place of its own.

    Raises:
        ScenarioError: Unknown name, unreadable file, unknown key or impossible value.
    """
    path = _path(name_or_path)
    try:
        found = parse_scenario(_content(path).decode("utf-8"), path.stem, suite, path.parent)
        return found if vehicle is None else with_vehicle(found, vehicle)
    except UnicodeDecodeError as error:
        raise ScenarioError(f"scenario {path} is not TOML: it is not UTF-8") from error


def with_vehicle(scenario: Scenario, vehicle: str) -> Scenario:
    """The scenario with another vehicle, by name or path, which starts in its own home posture.

    A sphere that follows the end-effector is where that posture has the base.

    Raises:
        ScenarioError: There is no such vehicle, or it cannot be.
    """
    start = dataclasses.replace(scenario.start, arm_deg=())
    found = dataclasses.replace(scenario, vehicle=vehicle, start=start)
    flown = checked_vehicle(found)
    if found.workspace is None:
        return found
    from sitl.plant.trim import end_effector  # its kernels take a moment

    _, _, down = end_effector(flown, start_angles(found))
    workspace = dataclasses.replace(found.workspace, d_iw_m=round(max(down, 0.0), _DIGITS))
    return dataclasses.replace(found, workspace=workspace)


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
    for one in named_files(path):
        digest.update(_content(one))
    return digest.hexdigest()[:_DIGITS]


def named_files(path: Path) -> list[Path]:
    """The table of points and the vehicle that a scenario file names, where they are files."""
    try:
        table = toml_table(_content(path).decode("utf-8"))
        named = [table.get("trajectory", {}).get("file"), table.get("vehicle")]
    except (ValueError, AttributeError):
        return []  # whoever reads it as a scenario says what is wrong
    points, vehicle = (one if isinstance(one, str) else "" for one in named)
    return [
        path.parent / one for one in (points, vehicle if is_vehicle_file(vehicle) else "") if one
    ]


def _path(name_or_path: str) -> Path:
    path = Path(name_or_path)
    if name_or_path in scenario_names():
        return PACKAGED / f"{name_or_path}.toml"
    if path.suffix != ".toml":
        raise ScenarioError(
            f'unknown scenario "{name_or_path}"{nearest(name_or_path, scenario_names())}; '
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
    vehicle = table.get("vehicle")
    if isinstance(vehicle, str) and is_vehicle_file(vehicle) and folder is not None:
        table["vehicle"] = str(folder / vehicle)
    scenario: Scenario = build_table(Scenario, {**table, "name": name}, "")
    if "vehicle" in table:
        checked_vehicle(scenario)
    return dataclasses.replace(
        scenario,
        trajectory=_with_unit_normal(scenario.trajectory),
        walls=tuple(map(_with_unit_normal, scenario.walls)),
        zones=tuple(map(_with_unit_normal, scenario.zones)),
    )


def checked_vehicle(scenario: Scenario) -> Vehicle:
    """The vehicle that a scenario names.

    Raises:
        ScenarioError: There is no such vehicle, or it cannot be.
    """
    from vehicles.vehicle_file import VehicleError

    try:
        return vehicle_of(scenario)
    except VehicleError as error:
        raise ScenarioError(f"vehicle: {error}") from error


def _with_points(curve: dict[str, Any], folder: Path | None) -> dict[str, Any]:
    """A table of points with the numbers of the file that it names."""
    named = curve["file"]
    inside = isinstance(named, str) and not ({"..", "/"} & set(Path(named).parts))
    if not inside or folder is None:
        raise ScenarioError(
            f"trajectory.file = {shown(named)}: must be a file beside the scenario's"
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
        values = [plain_float(word) for word in line.split(",")]
        if len(values) != len(head) or not all(map(math.isfinite, values)):
            raise ScenarioError(
                f"points {path}, line {number}: must be {len(head)} finite numbers, is "
                f"{shown(line)}"
            )
        found.append(values)
    columns: dict[str, list[Any]] = {"time_s": [row[0] for row in found]}
    columns["position_m"] = [row[1:4] for row in found]
    if len(head) == len(COLUMNS):
        columns["yaw_deg"] = [row[4] for row in found]
    return columns, data


def _with_unit_normal(zone: Plane) -> Plane:
    """What has a normal that was written with a few digits, with it as a unit vector [1]."""
    normal: V3 | None = getattr(zone, "normal", None)
    if normal is None:
        return zone
    length = math.hypot(*normal)
    # Nearer to 1 it is a unit vector as it is written; further off it is some other vector.
    if abs(length - 1.0) <= UNIT or abs(length - 1.0) > ROUNDED:
        return zone
    changed: Any = zone  # whichever of them it is
    unit = tuple(part / length for part in normal)
    return dataclasses.replace(changed, normal=unit)  # type: ignore[no-any-return]


def _sensors(value: Any, path: str) -> Sensors | MeasuredSensors:
    """The numbers of a suite, with those of the scenario in their place where it has any."""
    if not isinstance(value, dict):
        raise ScenarioError(f"{path} = {shown(value)}: must be a table")
    own = {key: part for key, part in value.items() if key != "suite"}
    suite = _READER.word(SuiteName, value.get("suite", PERFECT), f"{path}.suite")
    if suite == PERFECT:
        exact: Sensors = build_table(Sensors, own, path)
        return exact
    tables = toml_table((SUITES / f"{suite}.toml").read_text(encoding="utf-8"))
    if EXTRA in own:
        tables[EXTRA] = {}
    for key, part in own.items():
        if key not in tables:
            raise ScenarioError(
                f'unknown key "{path}.{key}": the suite "{suite}" has no such sensor'
                f"{nearest(key, tables)} (known here: suite, {', '.join(tables)})"
            )
        if not isinstance(part, dict):
            raise ScenarioError(f"{path}.{key} = {shown(part)}: must be a table")
        tables[key] = {**tables[key], **part}
    measured: MeasuredSensors = build_table(MeasuredSensors, {**tables, "suite": suite}, path)
    return measured


def _zone(value: Any, path: str) -> Any:
    """A zone of the shape that its table names."""
    # Loads numba, for which a scenario without zones need not wait.
    from sitl.shapes import TABLES

    return _READER.table_of_a_kind(list(TABLES), value, path, "shape")


_READER: Final = TableReader(
    ScenarioError, {Sensors | MeasuredSensors: _sensors, ScenarioZone: _zone}
)
build_table: Final = _READER.build
