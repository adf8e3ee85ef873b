"""What the flight software remembers from tick to tick, all of it."""

from __future__ import annotations

from dataclasses import field

from fsw.control.cascade import CascadeMemory
from fsw.control.tracking import Observed
from fsw.frozen import dataclass
from fsw.model.airframe import AIRFRAME
from fsw.signals import (
    STOPPED,
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
from fsw.tuning import Tuning

_NOWHERE: Vec3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class VehicleMemory:
    """Mode and what it needs; changes with commands, faults and milestones."""

    mode: Mode = Mode.DISARMED
    landed: bool = True
    still_since_us: int = 0  # landing detector
    anchor: Vec3 = _NOWHERE  # where a mode's own reference begins, end-effector [m]
    anchor_yaw: float = 0.0  # rad
    climb: float = 0.0  # m, of a takeoff
    anchor_us: int = 0
    failures: tuple[str, ...] = ()

    @property
    def armed(self) -> bool:
        """Whether anything may move."""
        return self.mode is not Mode.DISARMED and self.mode is not Mode.FAULT

    @property
    def flies(self) -> bool:
        """Whether the loops are closed."""
        return self.armed and not self.landed


@dataclass(frozen=True, slots=True)
class MissionMemory:
    """What was sent to be flown and to be kept clear of."""

    stream: tuple[EndEffectorTarget, ...] = ()
    safe_set: SafeSet = field(default_factory=SafeSet)
    refusals: tuple[str, ...] = ()  # why this configuration cannot keep the safe set


@dataclass(frozen=True, slots=True)
class PlanMemory:
    """The running plan and the question that is out."""

    running: Plan | None = None
    since_us: int = 0  # when the running plan began, or the vehicle was taken over
    awaited_id: int = -1  # -1: nothing is out
    awaited_us: int = 0
    awaited_missed: bool = False
    next_id: int = 0
    status: SolverStatus = SolverStatus.UNKNOWN
    refused: bool = False
    counters: PlannerCounters = field(default_factory=PlannerCounters)


@dataclass(frozen=True, slots=True)
class FlightState:
    """Everything a tick starts from; the upper half changes every tick, the lower rarely."""

    index: int = -1  # of the last tick on the absolute grid, missed ones counted
    t_us: int = 0  # of the last tick
    estimate: StateEstimate | None = None  # last valid
    invalid_ticks: int = 0
    nominal: PredictionState | None = None  # where the running plan wants the vehicle now
    output_replaced: bool = False
    cascade: CascadeMemory = field(
        default_factory=lambda: CascadeMemory(
            STOPPED.rotor_thrust, STOPPED, Observed(_NOWHERE, _NOWHERE), AIRFRAME.mass
        )
    )

    vehicle: VehicleMemory = field(default_factory=VehicleMemory)
    mission: MissionMemory = field(default_factory=MissionMemory)
    plan: PlanMemory = field(default_factory=PlanMemory)
    constraints: ConstraintReport = field(default_factory=ConstraintReport)
    reference: EndEffectorTarget | None = None  # in use when last planned
    tuning: Tuning = ()  # in use: what differs from the configuration of the start
