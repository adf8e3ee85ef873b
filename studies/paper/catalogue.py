"""Studies by name; heavy imports happen when one is requested."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from studies.campaign.campaign import Campaign
    from studies.flight.job import Outcome
    from studies.paper.settings import Report, Settings

# Module of each; what makes the study has the name ``run``, or that of the study.
STUDIES = {
    "table3": "table3",
    "table4": "table4",
    "rivals": "rivals",
    "fig2": "figure2",
    "fig6": "flight_figures",
    "fig7": "flight_figures",
    "fig8": "flight_figures",
    "robustness": "robustness",
    "smallest-sphere": "smallest_sphere",
}


def study(name: str) -> Callable[[Settings, Campaign[Outcome]], Report]:
    """The study of this name."""
    module = import_module(f"studies.paper.{STUDIES[name]}")
    found: Callable[[Settings, Campaign[Outcome]], Report] = (
        getattr(module, name, None) or module.run
    )
    return found
