"""What the flight software remembers from tick to tick, all of it."""

from __future__ import annotations

from dataclasses import dataclass, field

from fsw.control.cascade import NO_ACTION, CascadeMemory
from fsw.signals import (
    ConstraintReport,
    EndEffectorTarget,
    Mode,
    Plan,
    PlannerCounters,
    PredictionState,
    SafeSet,
    SolverStatus,
    StateEstimate,
    Vec3,
)

_NOWHERE: Vec3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class PlanMemory:
    """The running plan and the question that is out."""

    running: Plan | None = None
    since_us: int = 0  # when the running plan began, or the vehicle was taken over
    nominal: PredictionState | None = None  # where the running plan wants the vehicle now
    awaited_id: int = -1  # -1: nothing is out
    awaited_us: int = 0
    awaited_missed: bool = False
    next_id: int = 0
    status: SolverStatus = SolverStatus.UNKNOWN
    refused: bool = False
    counters: PlannerCounters = field(default_factory=PlannerCounters)


@dataclass(frozen=True, slots=True)
class FlightState:
    """Everything a tick starts from."""

    index: int = 0
    mode: Mode = Mode.DISARMED
    landed: bool = True
    still_since_us: int = 0  # landing detector
    estimate: StateEstimate | None = None  # last valid
    invalid_ticks: int = 0
    anchor: Vec3 = _NOWHERE  # where a mode's own reference begins, end-effector [m]
    anchor_us: int = 0
    stream: tuple[EndEffectorTarget, ...] = ()
    safe_set: SafeSet = field(default_factory=SafeSet)
    plan: PlanMemory = field(default_factory=PlanMemory)
    cascade: CascadeMemory = field(
        default_factory=lambda: CascadeMemory(NO_ACTION.rotor_thrust, NO_ACTION, _NOWHERE)
    )
    constraints: ConstraintReport = field(default_factory=ConstraintReport)
    output_replaced: bool = False
    failures: tuple[str, ...] = ()
