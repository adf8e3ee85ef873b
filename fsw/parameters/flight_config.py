"""Every tunable of the flight software, typed, and the presets that are flown."""

from __future__ import annotations

from dataclasses import dataclass, field

from fsw.control.cascade import Inner
from fsw.control.inner_tuning import InnerTuning
from fsw.model.airframe import AIRFRAME, Airframe
from fsw.mpc.planner_config import PlannerConfig
from fsw.mpc.variants import VARIANTS

CONTROLLERS = tuple(VARIANTS)
INNERS: tuple[Inner, ...] = ("tracking", "pid")


@dataclass(frozen=True, slots=True)
class FlightLimits:
    """How the vehicle climbs, descends and decides that it stands."""

    takeoff_climb: float = 1.0  # m
    climb_speed: float = 0.4  # m/s
    land_speed: float = 0.25  # m/s
    landed_height: float = 0.05  # m above standing
    landed_speed: float = 0.05  # m/s
    landed_time_us: int = 500_000  # at rest this long
    idle_thrust: float = 0.8  # N a rotor while armed on the ground


@dataclass(frozen=True, slots=True)
class FlightConfig:
    """One configuration of the whole flight software."""

    controller: str = "blf"
    inner: Inner = "tracking"
    airframe: Airframe = AIRFRAME
    planner: PlannerConfig = field(default_factory=PlannerConfig)
    tuning: InnerTuning = field(default_factory=InnerTuning)
    limits: FlightLimits = field(default_factory=FlightLimits)
    tick_period_us: int = 2_000
    mpc_period_us: int = 100_000
    # 10 ms between question and answer: 10 times the planner's median, and a fixed number of
    # ticks, so that a slow machine flies exactly like a fast one.
    plan_delay_ticks: int = 5
    # Farther from the plan than this, plan from the measurement.
    upset_distance: float = 0.15  # m
    upset_yaw: float = 0.35  # rad


def flight_config(controller: str = "blf", inner: Inner = "tracking") -> FlightConfig:
    """The configuration of a controller and an inner loop, by name.

    Raises:
        ValueError: for an unknown name, listing the known ones.
    """
    if controller not in CONTROLLERS:
        raise ValueError(f"unknown controller '{controller}'; known: {', '.join(CONTROLLERS)}")
    if inner not in INNERS:
        raise ValueError(f"unknown inner loop '{inner}'; known: {', '.join(INNERS)}")
    return FlightConfig(
        controller=controller, inner=inner, planner=PlannerConfig(controller=controller)
    )
