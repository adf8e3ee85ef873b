"""What telemetry shows beside the snapshot of a tick: facts of the build and timing of the loop."""

from __future__ import annotations

from dataclasses import dataclass, field

from fsw.geometry.geodesy import DEFAULT_ORIGIN
from fsw.model.periods import PLANNING_US, TICK_US
from fsw.signals import Origin, Vec2

GENERIC, PX4 = 0, 12  # MAV_AUTOPILOT


@dataclass(frozen=True, slots=True)
class GroupTiming:
    """Real-time health of one rate group: counts since start, statistics of the last interval."""

    period_us: int
    ticks: int = 0
    late_ticks: int = 0  # ended after the next release
    skipped_ticks: int = 0  # never executed
    execution_p50_us: float = 0.0
    execution_p99_us: float = 0.0
    execution_max_us: float = 0.0
    lateness_p50_us: float = 0.0
    lateness_p99_us: float = 0.0
    lateness_max_us: float = 0.0
    load: float = 0.0  # share of the period spent executing, mean over the interval


@dataclass(frozen=True, slots=True)
class VehicleFacts:
    """What does not change in flight."""

    rotor_thrust_max: float  # N, one rotor
    joint_torque_max: float  # N m
    link_length: Vec2  # m
    tick_period_us: int
    mpc_period_us: int
    mpc_delay_us: int  # from a request to the first use of its plan
    horizon: int  # steps
    sqp_iterations: int


@dataclass(slots=True)
class LoopHealth:
    """The latest timing of the rate groups; the loop replaces them once a second."""

    inner: GroupTiming = field(default_factory=lambda: GroupTiming(period_us=TICK_US))
    mpc: GroupTiming = field(default_factory=lambda: GroupTiming(period_us=PLANNING_US))
    telemetry: GroupTiming = field(default_factory=lambda: GroupTiming(period_us=TICK_US))
    housekeeping: GroupTiming = field(default_factory=lambda: GroupTiming(period_us=1_000_000))
    vibration: Vec2 = (0.0, 0.0)  # rad/s, m/s^2: gyro and accelerometer, high-pass filtered


@dataclass(slots=True)
class PlanIds:
    """What tells the uploaded lists from other ones, 0 for an empty one; the mission store's."""

    mission: int = 0
    fence: int = 0
    rally: int = 0


@dataclass(frozen=True, slots=True)
class TelemetryContext:
    """Second argument of every encoder."""

    facts: VehicleFacts
    health: LoopHealth
    autopilot: int = PX4
    origin: Origin = DEFAULT_ORIGIN
    start_unix_us: int = 0  # wall time at sensor time 0 [us since 1970]
    plan_ids: PlanIds = field(default_factory=PlanIds)
