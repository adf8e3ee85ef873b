"""Pandion as a library, and its command line: the only package that knows both processes.

What is public is in ``__all__``; it is loaded when it is asked for, so that the command line starts
at once. How a flight is flown from Python: docs/reference/api.md.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from fsw.autopilot.model.airframe import AIRFRAME as AIRFRAME
    from fsw.autopilot.signals import Plan as Plan
    from fsw.autopilot.signals import PlanFailure as PlanFailure
    from fsw.autopilot.signals import PlanRequest as PlanRequest
    from pandion.flown import Log as Log
    from pandion.flown import Result as Result
    from pandion.flown import load_log as load_log
    from pandion.flying import fly as fly
    from pandion.scenarios import load_scenario as load_scenario
    from pandion.scenarios import save_scenario as save_scenario
    from pandion.simulator import Autopilot as Autopilot
    from pandion.simulator import Simulator as Simulator
    from sitl.scenario import Scenario as Scenario
    from sitl.scenario_file import ScenarioError as ScenarioError
    from sitl.scenario_file import scenario_names as scenario_names
    from studies.flight.own_parts import Observation as Observation
    from studies.flight.own_parts import OwnPartError as OwnPartError

    __version__: str

_PLACES: Final = {
    "fsw.autopilot.model.airframe": ("AIRFRAME",),
    "fsw.autopilot.signals": ("Plan", "PlanFailure", "PlanRequest"),
    "pandion.flown": ("Log", "Result", "load_log"),
    "pandion.flying": ("fly",),
    "pandion.scenarios": ("load_scenario", "save_scenario"),
    "pandion.simulator": ("Autopilot", "Simulator"),
    "sitl.scenario": ("Scenario",),
    "sitl.scenario_file": ("ScenarioError", "scenario_names"),
    "studies.flight.own_parts": ("Observation", "OwnPartError"),
}
_PUBLIC: Final = {name: module for module, names in _PLACES.items() for name in names}
__all__ = sorted([*_PUBLIC, "__version__"])


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from command_line.version import version

        return version()
    if name not in _PUBLIC:
        raise AttributeError(f"module 'pandion' has no attribute {name!r}")
    found = getattr(import_module(_PUBLIC[name]), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
