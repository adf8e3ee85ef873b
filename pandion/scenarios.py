"""Scenarios from Python: by name, from a file or as dataclasses that can be changed and saved."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

from sitl.scenario import Scenario
from sitl.scenario_file import load_scenario as load_by_name
from sitl.scenario_file import parse_scenario, with_vehicle
from sitl.scenario_text import scenario_text, write_scenario
from sitl.scenario_validation import check

AnyScenario: TypeAlias = str | Path | Scenario


def load_scenario(
    scenario: AnyScenario,
    *,
    sensors: str | None = None,
    duration_s: float | None = None,
    vehicle: str | None = None,
) -> Scenario:
    """A scenario by name, by the path of its file, or one that is there already.

    Args:
        scenario: ``"walls"``, ``"my/scenario.toml"`` or a ``Scenario``.
        sensors: ``perfect``, ``mocap``, ``vio``, ``rtk`` or ``gnss``; None: the scenario's.
        duration_s: How long it is flown [s]; None: as it says.
        vehicle: One that comes with Pandion, or the path of a ``.toml`` file; None: its own.

    Returns:
        A frozen dataclass; ``dataclasses.replace`` makes a changed one.

    Raises:
        ScenarioError: Unknown name or key, an impossible value, or a contradiction.
    """
    if isinstance(scenario, Scenario):
        # Whatever the dataclass was changed to is read as a file's text would be.
        found = parse_scenario(scenario_text(scenario), scenario.name, sensors)
    else:
        found = load_by_name(str(scenario), sensors)
    if duration_s is not None:
        found = replace(found, duration_s=float(duration_s))
        found = parse_scenario(scenario_text(found), found.name)
    if vehicle is not None:
        found = with_vehicle(found, vehicle)
    check(found)
    return found


def save_scenario(scenario: Scenario, path: Path | str) -> Path:
    """Write a scenario to a ``.toml`` file, which ``pandion fly`` reads; returns its path.

    Raises:
        OSError: The file cannot be written.
    """
    written = Path(path)
    write_scenario(scenario, written)
    return written
