"""A scenario as the text of a scenario file: reading it gives the same scenario again.

Only what differs from the defaults is written; of a suite of sensors every number is.
"""

from __future__ import annotations

from typing import Any

from command_line.toml_text import toml_lines
from sitl.scenario import Scenario
from sitl.sensors.keys import MeasuredSensors


def scenario_text(scenario: Scenario, comment: str = "") -> str:
    """The TOML text of a scenario, after a comment of one or several lines.

    The name is left out: a scenario is named by its file.
    """
    head = "".join(f"# {line}\n" for line in comment.splitlines())
    return head + "\n".join(toml_lines("", scenario, ("name",), _is_of_sensors)) + "\n"


def _is_of_sensors(path: str, value: Any) -> bool:
    return isinstance(value, MeasuredSensors) or path.startswith("sensors.")
