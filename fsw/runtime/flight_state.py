"""What the flight software remembers from tick to tick, all of it."""

from __future__ import annotations

from dataclasses import field

from fsw.control.cascade import CascadeMemory
from fsw.control.tracking import Observed
from fsw.frozen import dataclass
from fsw.model.airframe import AIRFRAME
from fsw.signals import (
    STOPPED,
    AttitudeSetpoint,
    BatteryState,
    Charge,
    ConstraintReport,
    EndEffectorTarget,
    Home,
    JointSetpoint,
    Mode,
    MotionSetpoint,
    Plan,
    PlannerCounters,
    PredictionState,
    SafeSet,
    SolverStatus,
    StateEstimate,
    Vec2,
    Vec3,
)
from fsw.tuning import Tuning
from fsw.vehicle.mission import MissionFlight
from fsw.vehicle.offboard import Tilt
from fsw.vehicle.repeats import Answered
from fsw.vehicle.steering import Aim, Lead

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
    home: Home | None = None
    station_us: int = -1  # when a ground station was last heard; -1: not since it was given up
    answered: tuple[Answered, ...] = ()  # each sender's last command
    standby: Mode = Mode.HOLD  # what arming leads to
    standby_us: int = 0  # when that was chosen
    failsafe_from: Mode | None = None  # what was flown when a failsafe took over
    charge: Charge = Charge.OK  # the worst that was told since arming
    look_at: Vec3 | None = None  # m, where the nose is to point
    speed: float | None = None  # m/s, on the way to places; None: as usual

    @property
    def armed(self) -> bool:
        """Whether anything may move."""
        return self.mode is not Mode.DISARMED and self.mode is not Mode.FAULT

    @property
    def flies(self) -> bool:
        """Whether the loops are closed."""
        return self.armed and not self.landed


@dataclass(frozen=True, slots=True)
class SteerMemory:
    """The reference that is steered; there is a lead only in hold, return and offboard."""

    lead: Lead | None = None
    aim: Aim | None = None
    waypoints: tuple[Vec3, ...] = ()  # after the aim's place


@dataclass(frozen=True, slots=True)
class OffboardMemory:
    """Set-points for now, flown or not: the newest ones, and how many there were."""

    motion: MotionSetpoint | None = None
    attitude: AttitudeSetpoint | None = None
    joints: JointSetpoint | None = None
    motion_us: int = -1  # when motion or attitude came
    joints_us: int = -1
    accepted: int = 0
    refused: int = 0
    tilt: Tilt = field(default_factory=Tilt)


@dataclass(frozen=True, slots=True)
class MissionMemory:
    """What was sent to be flown and to be kept clear of."""

    stream: tuple[EndEffectorTarget, ...] = ()
    safe_set: SafeSet = field(default_factory=SafeSet)  # in force: announced and fence together
    refused_set: SafeSet | None = None  # announced in flight, and of no use
    refusals: tuple[str, ...] = ()  # why this configuration cannot keep the safe set
    announced: SafeSet = field(default_factory=SafeSet)
    fence: SafeSet = field(default_factory=SafeSet)
    rally: tuple[Vec2, ...] = ()  # m, where a return may lead beside home
    flight: MissionFlight = field(default_factory=MissionFlight)


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
    steer: SteerMemory = field(default_factory=SteerMemory)
    offboard: OffboardMemory = field(default_factory=OffboardMemory)
    battery: BatteryState = field(default_factory=BatteryState)
    arming_refusal: str = ""
