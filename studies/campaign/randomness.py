"""What is random in the flights of a campaign: what its seed decides, and what it varies."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from fsw.autopilot.tuning import flat
from sitl.scenario import Scenario, Uniform
from sitl.sensors.keys import MeasuredSensors
from studies.campaign.keys import FAULT, Flown
from studies.campaign.plan import Varied
from studies.campaign.values import Choice
from studies.flight.job import Job


def seeded(flown: Flown) -> bool:
    """Whether the seed of a flight changes anything."""
    return Job("full", flown.scenario, flown.config, 0).random


def spread(varied: Iterable[Varied], flown: Flown) -> bool:
    """Whether a file's distributions let flights of this differ."""
    return any(
        not (isinstance(one.distribution, Choice) and len(set(one.distribution.values)) == 1)
        and (bool(flown.scenario.faults) or not one.key.startswith(f"{FAULT}."))
        for one in varied
    )


def drawn(scenario: Scenario) -> Iterator[str]:
    """What of a scenario the seed of a flight decides."""
    for item in scenario.disturbances:
        if isinstance(item, Uniform):
            yield f"disturbance {item.name}: uniform within ±{item.amplitude_m_s2:g} m/s² an axis"
        elif item.kind not in ("wind", "sequence"):
            yield f"disturbance {item.name}: {item.kind}"
    if isinstance(scenario.sensors, MeasuredSensors):
        yield f"errors of the sensors of suite {scenario.sensors.suite}"
    elif any(value for key, value in flat(scenario.sensors).items() if "latency" not in key):
        yield "errors of the exact sensors"
    if scenario.air.turbulence_m_s > 0.0:
        yield f"turbulence, {scenario.air.turbulence_m_s:g} m/s at 20 ft"
    for fault in scenario.faults:
        if fault.random:
            yield f"what the fault draws: {fault}"
