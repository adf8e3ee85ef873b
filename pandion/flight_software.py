"""``pandion fsw``: the flight software, which then knows what it is compared with as well."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fsw.autopilot.parameters.control_choice import ControlChoice


def main(argv: list[str]) -> int:
    """Fly; returns the exit code."""
    from fsw.__main__ import main as fly

    return fly(argv, "pandion fsw", _know_rivals)


def _know_rivals(flown: ControlChoice) -> None:
    """Let the planner know those of the study, if one is chosen: they take time to import."""
    ours = type(flown)()
    if (flown.controller, flown.solver) != (ours.controller, ours.solver):
        import studies.flight.rival_planners  # noqa: F401
