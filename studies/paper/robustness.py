"""How far blf's claim carries: another vehicle, real sensors, real air, sensors that fail.

``CELLS`` are the rows. Each names the suite of sensors that it is flown with; all are flown in the
full plant, with the paper's random disturbance unless they say otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import cache
from typing import Final

from fsw.autopilot.measurements import Sensor
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.parameters.registry import BY_NAME
from fsw.autopilot.tuning import tuned
from sitl.air.wall_effect import IDEAL
from sitl.scenario import (
    ActuatorKeys,
    AirKeys,
    EncoderErrors,
    Impulses,
    ImuErrors,
    PoseErrors,
    Scenario,
    Sensors,
    VehicleScale,
    Wind,
)
from sitl.scenario_file import load_scenario, scenario_names
from studies.campaign.campaign import Campaign
from studies.campaign.keys import later, with_number
from studies.flight.job import Job, Outcome
from studies.flight.sensor_faults import Fault, FaultKind
from studies.paper import summary
from studies.paper.cases import configuration, grazing
from studies.paper.deviations import deviations
from studies.paper.settings import NoCellError, Report, Settings, Table
from studies.paper.summary import Summary, fly_jobs

Change = Callable[[Scenario], Scenario]

# Scenario of each case; the field is a niche like that of Case I, for the errors of satellites.
SCENARIOS: Final = {"I": "walls", "II": "workspace", "field": "field"}

SUITES, AIR, FAULTS, MODELS = (
    "Suites of sensors",
    "Real air and actuators",
    "Sensors that fail beside walls",
    "Model errors and sensor errors",
)

# When the path of Case I has a second left to its nearest place to a wall: the front at 13, 53 and
# 93 s, the right one at 18 and 78 s, the left one at 48 s.
BESIDE_S: Final = (12.0, 17.0, 47.0, 52.0, 77.0, 92.0)
_REST_S: Final = 5.0  # of the flight, after a fault that lasts no longer than two


@dataclass(frozen=True, slots=True)
class Cell:
    """One row: what is flown, and under which names it stands in the table."""

    section: str
    suite: str
    case: str
    change: str
    flown: Scenario
    fault: Fault | None = None


def _as_it_is(flown: Scenario) -> Scenario:
    return flown


def _vehicle(scale: VehicleScale) -> Change:
    return lambda flown: replace(flown, vehicle_scale=scale)


def _late(latency_ms: float) -> Change:
    """Every sensor late; of exact states the flight software does not know when they were."""
    return lambda flown: later(flown, latency_ms)


def _pose_latency(latency_ms: float) -> Change:
    """Motion capture as late as this, with true time stamps."""
    path = ["sensors", "motion_capture", "latency_ms"]
    return lambda flown: with_number(flown, path, latency_ms)


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


def _real_air(wind_m_s: float, at_20_ft_m_s: float, *, disturbed: bool = True) -> Change:
    """Every effect of ``[air]`` and ``[actuators]``, with wind to the north-east."""
    diagonal = wind_m_s * math.sqrt(0.5)
    air = AirKeys(
        wind_m_s=(diagonal, diagonal, 0.0),
        turbulence_m_s=at_20_ft_m_s,
        rotor_drag_1_s=(0.544, 0.386, 0.0),
        body_drag_m2=0.03,
        ground_effect=True,
        ceiling_effect=True,
        wall_suction=IDEAL,
    )
    actuators = ActuatorKeys(
        quadratic_thrust=True,
        dead_time_ms=4.0,
        battery_a_h=5.0,
        battery_ohm=0.02,
        motor_inertia_kg_m2=0.0025,
        backlash_deg=0.25,
    )

    def change(flown: Scenario) -> Scenario:
        pushes = flown.disturbances if disturbed else ()
        return replace(flown, air=air, actuators=actuators, disturbances=pushes)

    return change


# Of the suite perfect, in both cases.
CHANGES: dict[str, Change] = {
    "as believed": _as_it_is,
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

_FLOWN_WITH_A_SUITE: tuple[tuple[str, str, str, Change], ...] = (
    ("mocap", "I", "as the suite is", _as_it_is),
    ("mocap", "II", "as the suite is", _as_it_is),
    *(
        ("mocap", case, f"pose {latency:g} ms late", _pose_latency(latency))
        for latency in (10.0, 20.0, 30.0)
        for case in ("I", "II")
    ),
    ("vio", "I", "as the suite is", _as_it_is),
    ("vio", "II", "as the suite is", _as_it_is),
    ("rtk", "field", "as the suite is", _as_it_is),
)

# Light air (Beaufort 1: 0.3 to 1.5 m/s), 3 m above short grass; at 20 ft the profile of wind of
# MIL-F-8785C, 3.7.3, has 1.17 times as much.
_AIRS: dict[str, Change] = {
    "real air, still": _real_air(0.0, 0.0),
    "real air, 0.5 m/s of wind": _real_air(0.5, 0.6),
    "real air, 1 m/s, no other disturbance": _real_air(1.0, 1.2, disturbed=False),
}

_FAULTS: tuple[tuple[str, Sensor, FaultKind, float], ...] = (
    ("no pose for 2 s", Sensor.POSE, "silent", 2.0),
    ("IMU frozen for 2 s", Sensor.IMU, "frozen", 2.0),
    ("encoders frozen for 2 s", Sensor.ENCODERS, "frozen", 2.0),
    ("pose frozen for 0.3 s", Sensor.POSE, "frozen", 0.3),
    ("no pose for 10 ms", Sensor.POSE, "silent", 0.01),
    ("one attitude 75 deg over", Sensor.POSE, "over", 0.0),
    ("one frame of 1e6 m/s", Sensor.POSE, "fast", 0.0),
    ("one time stamp 10 s ahead", Sensor.POSE, "ahead", 0.0),
)
_ALL_LATE: Final = (14.0, 20.0)  # ms
# Exact states are believed where they are numbers and in range. In process the time of a frame is
# the tick's; the link refuses one that is ahead (tests/fsw/link/test_sim_link.py).
_OF_SUITES_ONLY: Final = ("frozen", "over", "ahead")


def cells(duration_s: float | None = None) -> list[Cell]:
    """All rows, in their order, for flights of their usual length or of ``duration_s`` [s]."""

    def cell(
        section: str,
        suite: str,
        case: str,
        name: str,
        change: Change = _as_it_is,
        fault: Fault | None = None,
    ) -> Cell:
        flown = change(_scenario(SCENARIOS[case], suite))
        if duration_s is not None:
            flown = replace(flown, duration_s=duration_s)
        return Cell(section, suite, case, name, flown, fault)

    found = [
        cell(SUITES, suite, case, name, change)
        for suite, case, name, change in _FLOWN_WITH_A_SUITE
        if SCENARIOS[case] in scenario_names()
    ]
    both = ("mocap", "perfect")
    found += [cell(AIR, suite, "I", name, _AIRS[name]) for suite in both for name in _AIRS]
    for suite in both:
        found += [
            cell(FAULTS, suite, "I", name, fault=Fault(sensor, kind, seconds, _begins(duration_s)))
            for name, sensor, kind, seconds in _FAULTS
            if suite != "perfect" or kind not in _OF_SUITES_ONLY
        ]
        found += [
            cell(FAULTS, suite, "I", f"all sensors {late:g} ms late", _late(late))
            for late in _ALL_LATE
        ]
    found += [
        cell(MODELS, "perfect", case, name, CHANGES[name])
        for case in ("I", "II")
        for name in CHANGES
    ]
    found.append(cell(MODELS, "perfect", "I", "grazing path", grazing))
    return found


def chosen(settings: Settings) -> list[Cell]:
    """The rows that the settings ask for.

    Raises:
        NoCellError: There is none.
    """
    every = cells(settings.duration_s)
    words = (settings.only or "").casefold()
    found = [
        cell
        for cell in every
        if settings.suite in (None, cell.suite)
        and words in f"{cell.section}: case {cell.case}, {cell.change}".casefold()
    ]
    if not found:
        known = ", ".join(dict.fromkeys(cell.change for cell in every))
        raise NoCellError(
            f'no row has the suite "{settings.suite or "any"}" and "{settings.only or ""}" in its '
            f"name; known: {known}"
        )
    return found


def config_of(cell: Cell, settings: Settings) -> FlightConfig:
    """The configuration as ``pandion fly`` flies it, for the body that the scenario judges."""
    config = configuration("full", "blf", settings.inner)
    planner = replace(config.planner, body=cell.flown.body)
    config = replace(config, planner=planner, soft=False)
    if cell.section != AIR:
        return config
    # Known are the joints' motors, nothing else of air and actuators.
    inertia = cell.flown.actuators.motor_inertia_kg_m2
    return tuned(config, ((BY_NAME["JNT_ARMATURE"].path, inertia),))


def run(settings: Settings, campaign: Campaign[Outcome]) -> Report:
    """Fly every row; always the full plant, the other has nothing to change."""
    rows = chosen(settings)
    jobs = [
        [
            Job("full", cell.flown, config_of(cell, settings), seed, cell.fault)
            for seed in settings.seeds
        ]
        for cell in rows
    ]
    summaries, errors = fly_jobs(campaign, jobs)
    found = list(zip(rows, summaries, strict=True))
    sections = dict.fromkeys(cell.section for cell in rows)
    return Report(
        title="Robustness of MPC-BLF, full plant, with the paper's disturbance",
        rows=[_row(cell, one) for cell, one in found],
        tables=tuple(
            _table(section, [pair for pair in found if pair[0].section == section])
            for section in sections
        ),
        deviations=deviations("robustness"),
        errors=errors,
    )


def _row(cell: Cell, one: Summary) -> dict[str, object]:
    return {
        "plant": "full",
        "section": cell.section,
        "suite": cell.suite,
        "case": cell.case,
        "change": cell.change,
        "fault": cell.fault is not None,
        "controller": "blf",
        **asdict(one),
    }


def _table(section: str, found: list[tuple[Cell, Summary]]) -> Table:
    headers = ("suite", "case", "change", *summary.HEADERS, "contacts", "reported", "mode changes")
    return Table(section, headers, tuple(_cells(cell, one) for cell, one in found))


def _cells(cell: Cell, one: Summary) -> tuple[str, ...]:
    return (
        cell.suite,
        cell.case,
        cell.change,
        *summary.cells(one),
        f"{one.contacts}/{one.total}",
        "–" if cell.fault is None else f"{one.reported}/{one.total}",
        "; ".join(f"{modes} {count}/{one.total}" for modes, count in one.modes.items()) or "none",
    )


def _begins(duration_s: float | None) -> tuple[float, ...]:
    """Times of faults that leave the rest of a flight of ``duration_s`` [s], or its middle [s]."""
    if duration_s is None:
        return BESIDE_S
    fit = tuple(start for start in BESIDE_S if start + 2.0 + _REST_S <= duration_s)
    return fit or (0.5 * duration_s,)


@cache
def _scenario(name: str, suite: str) -> Scenario:
    return load_scenario(name, suite)
