"""How far blf's claim carries: another vehicle, late or noisy sensors, other disturbances."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, replace

from sitl.scenario import (
    EncoderErrors,
    Impulses,
    ImuErrors,
    PoseErrors,
    Scenario,
    Sensors,
    VehicleScale,
    Wind,
)
from studies import summary
from studies.campaign import Campaign
from studies.cases import CASES, configuration, grazing, scenario
from studies.deviations import deviations
from studies.settings import Report, Settings, Table
from studies.summary import fly_cells

Change = Callable[[Scenario], Scenario]


def _vehicle(scale: VehicleScale) -> Change:
    return lambda flown: replace(flown, vehicle_scale=scale)


def _late(latency_ms: float) -> Change:
    """Every sensor late, which the flight software does not know."""
    sensors = Sensors(
        ImuErrors(latency_ms=latency_ms),
        PoseErrors(latency_ms=latency_ms),
        EncoderErrors(latency_ms=latency_ms),
    )
    return lambda flown: replace(flown, sensors=sensors)


def _noisy(flown: Scenario) -> Scenario:
    angle, rate = math.radians(0.2), math.radians(0.2)
    sensors = Sensors(
        ImuErrors(gyro_rad_s=rate),
        PoseErrors(0.001, 0.01, angle, rate),
        EncoderErrors(angle, rate),
    )
    return replace(flown, sensors=sensors)


def _windy(flown: Scenario) -> Scenario:
    wind = Wind((0.5 * math.sqrt(0.5), 0.5 * math.sqrt(0.5), 0.0))
    return replace(flown, disturbances=(*flown.disturbances, wind))


def _pushed(flown: Scenario) -> Scenario:
    """Twice the paper's amplitude for 0.1 s in any direction, every 5 s on average."""
    pushes = Impulses(mean_interval_s=5.0, magnitude_m_s2=1.6, duration_s=0.1)
    return replace(flown, disturbances=(*flown.disturbances, pushes))


# On top of the paper's random disturbance.
CHANGES: dict[str, Change] = {
    "as believed": lambda flown: flown,
    "mass × 0.8": _vehicle(VehicleScale(mass=0.8)),
    "mass × 1.2": _vehicle(VehicleScale(mass=1.2)),
    "inertia × 0.8": _vehicle(VehicleScale(inertia=0.8)),
    "inertia × 1.2": _vehicle(VehicleScale(inertia=1.2)),
    "sensors 6 ms late": _late(6.0),
    "sensors 10 ms late": _late(10.0),
    "sensor noise": _noisy,
    "wind 0.5 m/s²": _windy,
    "impulses": _pushed,
}

GRAZING = "grazing path"  # of Case I only

_HEADERS = ("case", "change", *summary.HEADERS)


def run(settings: Settings, campaign: Campaign) -> Report:
    """Fly every change in both cases; always the full plant, the other has nothing to change."""
    config = configuration("full", "blf", settings.inner)
    named = [(case, name) for case in CASES for name in CHANGES]
    named.append(("I", GRAZING))
    changes = CHANGES | {GRAZING: grazing}
    flown = (scenario(case, disturbed=True, duration_s=settings.duration_s) for case, _ in named)
    cells = [(changes[name](one), config) for (_, name), one in zip(named, flown, strict=True)]
    summaries, errors = fly_cells(campaign, replace(settings, plant="full"), cells)
    found = list(zip(named, summaries, strict=True))
    return Report(
        title="Robustness of MPC-BLF, full plant, with the paper's disturbance",
        rows=[
            {"plant": "full", "case": case, "change": name, "controller": "blf"} | asdict(row)
            for (case, name), row in found
        ],
        tables=(
            Table(
                "MPC-BLF",
                _HEADERS,
                tuple((case, name, *summary.cells(row)) for (case, name), row in found),
            ),
        ),
        deviations=deviations("robustness"),
        errors=errors,
    )
