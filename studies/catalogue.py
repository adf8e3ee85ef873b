"""Every study by the name it is asked for."""

from __future__ import annotations

from collections.abc import Callable

from studies import (
    figure2,
    flight_figures,
    robustness,
    smallest_sphere,
    table3,
    table4,
)
from studies.campaign import Campaign
from studies.settings import Report, Settings

Study = Callable[[Settings, Campaign], Report]

STUDIES: dict[str, Study] = {
    "table3": table3.run,
    "table4": table4.run,
    "fig2": lambda settings, campaign: figure2.run(),
    "fig6": lambda settings, campaign: flight_figures.fig6(settings, campaign.report),
    "fig7": lambda settings, campaign: flight_figures.fig7(settings, campaign.report),
    "fig8": lambda settings, campaign: flight_figures.fig8(settings, campaign.report),
    "robustness": robustness.run,
    "smallest-sphere": smallest_sphere.run,
}
