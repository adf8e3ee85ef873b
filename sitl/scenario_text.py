"""A scenario as the text of a scenario file: reading it gives the same scenario again.

Only what differs from the defaults is written; of a suite of sensors every number is.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from command_line.toml_text import toml_lines, toml_word
from sitl.scenario import PAPER, Scenario
from sitl.sensors.keys import MeasuredSensors


def scenario_text(scenario: Scenario, comment: str = "", folder: Path | None = None) -> str:
    """The TOML text of a scenario, after a comment of one or several lines.

    The name is left out: a scenario is named by its file. A vehicle's file in the ``folder`` of
    the text is named from there, so that both can be moved; any other from the root.
    """
    head = "".join(f"# {line}\n" for line in comment.splitlines())
    vehicle = Path(scenario.vehicle)
    if folder is not None and vehicle.is_relative_to(folder.absolute()):
        vehicle = vehicle.relative_to(folder.absolute())
    if scenario.vehicle != PAPER:
        head += f"vehicle = {toml_word(str(vehicle))}\n"
    return head + "\n".join(toml_lines("", scenario, ("name", "vehicle"), _is_of_sensors)) + "\n"


def write_scenario(scenario: Scenario, path: Path, comment: str = "") -> None:
    """Write a scenario's file, which names the same vehicle wherever it is.

    Raises:
        OSError: It cannot be written.
    """
    path.write_text(scenario_text(scenario, comment, path.parent), encoding="utf-8")


def _is_of_sensors(path: str, value: Any) -> bool:
    return isinstance(value, MeasuredSensors) or path.startswith("sensors.")
