"""The page of scenario keys names every key with its range and default, and no other."""

from __future__ import annotations

import dataclasses
import re
import typing
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest

from sitl import scenario
from sitl.faults.keys import Fault
from sitl.scenario_file import parse_scenario
from sitl.scenario_validation import check
from sitl.shapes import TABLES as ZONES
from sitl.simulation import Simulation

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "scenarios.md"
SHAPES = tuple(ZONES)
NOT_COMMON = object()
TABLES = (
    scenario.Scenario,
    scenario.Start,
    scenario.Pilot,
    scenario.Lissajous,
    scenario.Hold,
    scenario.Points,
    scenario.Circle,
    scenario.Polynomial,
    scenario.Push,
    scenario.ScenarioWall,
    scenario.Obstacle,
    scenario.Workspace,
    scenario.ScenarioZone,
    scenario.WayPoint,
    scenario.Touch,
    scenario.Payload,
    *SHAPES,
    scenario.Uniform,
    scenario.Wind,
    scenario.Impulses,
    scenario.Torque,
    scenario.Sequence,
    scenario.ImuErrors,
    scenario.PoseErrors,
    scenario.EncoderErrors,
    scenario.VehicleScale,
    scenario.AirKeys,
    scenario.ActuatorKeys,
    Fault,
)


def hints(kind: Any) -> dict[str, Any]:
    """Annotations of a table's keys, with their ranges."""
    return typing.get_type_hints(kind, include_extras=True)


def allowed(hint: Any) -> str:
    """What the table says about the value."""
    if hint is bool:
        return "true, false"
    if typing.get_origin(hint) is Annotated:
        plain, permitted = typing.get_args(hint)
        count = len(typing.get_args(plain))
        return f"{count} numbers, {permitted}" if count else str(permitted)
    if typing.get_origin(hint) is tuple:
        return f"arrays of {allowed(typing.get_args(hint)[0])}"
    return ", ".join(f"`{word}`" for word in typing.get_args(hint)) or "text"


def default(field: dataclasses.Field[Any]) -> str:
    """What the table says about leaving it out."""
    # In a file a table says its kind, even where the dataclass has only one.
    if field.default is dataclasses.MISSING or field.name in ("kind", "shape"):
        return "required"
    value = field.default
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return "[" + ", ".join(f"{entry:.4g}" for entry in value) + "]"
    if isinstance(value, float):
        return f"{value:g}"
    return f"`{value}`" if value else "empty"


def expected(kind: Any) -> set[tuple[str, str, str]]:
    """Rows of one table; keys that hold other tables have tables of their own."""
    rows = set()
    common = {field.name: field.default for field in dataclasses.fields(scenario.ScenarioZone)}
    for field in dataclasses.fields(kind):
        if kind in SHAPES and common.get(field.name, NOT_COMMON) is field.default:
            continue
        hint = hints(kind)[field.name]
        entry = typing.get_args(hint)[0] if typing.get_origin(hint) is tuple else hint
        plain = typing.get_origin(entry) in (Annotated, Literal) or hint in (str, bool)
        named_by_file = kind is scenario.Scenario and field.name == "name"
        if plain and not named_by_file:
            rows.add((f"`{field.name}`", allowed(hint), default(field)))
    return rows


def documented(kind: Any) -> set[tuple[str, str, str]]:
    """Key, range and default in the lines behind the marker of a dataclass."""
    text = PAGE.read_text(encoding="utf-8")
    lines = text.split(f"<!-- {kind.__name__} -->\n")[1].split("\n\n")[0].splitlines()
    rows = [re.fullmatch(r"- (`\w+`) \(([^;)]+)(?:; ([^)]+))?\)(?::.*)?", line) for line in lines]
    return {(row[1], row[2].replace("…", " to "), row[3] or "required") for row in rows if row}


@pytest.mark.parametrize("kind", TABLES, ids=lambda kind: kind.__name__)
def test_the_page_names_every_key_with_range_and_default(kind: Any) -> None:
    assert documented(kind) == expected(kind)


def test_every_dataclass_of_a_scenario_has_a_table() -> None:
    made = {
        name
        for name, value in vars(scenario).items()
        if getattr(value, "__module__", None) == scenario.__name__
        and dataclasses.is_dataclass(value)
        and value is not scenario.Sensors
    }
    assert made == {kind.__name__ for kind in TABLES if kind not in (*SHAPES, Fault)}


def test_the_examples_on_the_page_can_be_flown() -> None:
    examples = re.findall(r"```toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert examples
    for text in examples:
        flown = parse_scenario(text, "example")
        check(flown)
        assert Simulation(flown, 0).ended is None
