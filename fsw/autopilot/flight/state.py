"""The complete state of the flight software between two ticks."""

from __future__ import annotations

from dataclasses import field
from typing import Final, NamedTuple

from fsw.autopilot.estimation.faults.sensor_fault import SensorFault, sentence
from fsw.autopilot.estimation.frame_dropout import Dropout
from fsw.autopilot.estimation.fusion_memory import FusionMemory
from fsw.autopilot.flight.commands.dedup import Answers
from fsw.autopilot.flight.failsafe.conditions import Condition, FailsafeMemory
from fsw.autopilot.flight.mission.sequencer import MissionFlight
from fsw.autopilot.flight.safety.accuracy_watch import AccuracyMemory
from fsw.autopilot.flight.safety.progress_watch import ProgressMemory
from fsw.autopilot.flight.safety.uncertain_clearance import InflatedSafeSet
from fsw.autopilot.flight.setpoints.generator import PositionGoal, ReferenceState
from fsw.autopilot.flight.setpoints.offboard_setpoint import Tilt
from fsw.autopilot.measurements import RangeSample, Sensor
from fsw.autopilot.model.actuator_health import HEALTHY, ActuatorHealth
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.signals import (
    ActuatorReport,
    ArmingReport,
    AttitudeSetpoint,
    BatteryState,
    ConstraintReport,
    EndEffectorTarget,
    EstimatorReport,
    Home,
    HostHealth,
    JointSetpoint,
    JointVector,
    MessageSource,
    Mode,
    MotionSetpoint,
    Plan,
    PlannerCounters,
    PredictionState,
    SafeSet,
    SafeSetAnnouncement,
    SafetyCounters,
    Sender,
    SolverStatus,
    StateEstimate,
    Vec2,
    Vec3,
)
from fsw.autopilot.tick_record import Tick, new_tick
from fsw.autopilot.tuning import Tuning
from fsw.frozen import dataclass

_NOWHERE: Vec3 = (0.0, 0.0, 0.0)
HEIGHT_UNKNOWN: Final = 0.5  # m, standard deviation
_DISARMED, _FAULT = Mode.DISARMED, Mode.FAULT


@dataclass(frozen=True, slots=True)
class VehicleMemory:
    """Mode and what belongs to it."""

    mode: Mode = Mode.DISARMED
    landed: bool = True
    moved_us: int = 0  # when the vehicle last moved, for the land detector
    # On contact with the ground rotors idle: since when, and the velocity down [m/s] at that time.
    unloaded: tuple[int, float] | None = None
    ranges: tuple[RangeSample, ...] = ()  # of the rangefinder, of the last 0.1 s
    mode_origin: Vec3 = _NOWHERE  # where a mode's own reference begins, end-effector [m]
    mode_yaw: float = 0.0  # rad, there
    mode_begin_us: int = 0
    is_up: bool = False  # whether the mode's reference was above the lowest height
    climb: float = 0.0  # m, of a takeoff
    conditions: tuple[Condition, ...] = ()  # that are active
    failsafe: FailsafeMemory = FailsafeMemory()  # what is being done about them
    home: Home | None = None
    gcs_heard_us: int = -1  # when a ground station was last heard; -1: never
    answered: Answers = ()  # each sender's last command
    intended_mode: Mode = Mode.HOLD  # what arming leads to
    intended_us: int = 0  # when that was chosen
    failsafe_from: Mode | None = None  # what was flown when a failsafe took over
    look_at: Vec3 | None = None  # m, where the nose is to point
    speed: float | None = None  # m/s, on the way to places; None: as usual
    restarts: bool = False  # the next tick begins anew
    gripper: float = 0.0  # 1 closed, -1 open, 0 never told

    @property
    def armed(self) -> bool:
        """Whether actuators may move."""
        return self.mode is not _DISARMED and self.mode is not _FAULT

    @property
    def flies(self) -> bool:
        """Whether the loops are closed."""
        # Not by ``armed``: asked some ten times a tick.
        return not self.landed and self.mode is not _DISARMED and self.mode is not _FAULT


@dataclass(frozen=True, slots=True)
class SetpointMemory:
    """The generated setpoint; there is one only in Hold, Return, Orbit and Offboard.

    Descend has a goal alone: where it draws back to while no position is measured.
    """

    reference: ReferenceState | None = None
    goal: PositionGoal | None = None
    waypoints: tuple[Vec3, ...] = ()  # after the goal's place


@dataclass(frozen=True, slots=True)
class OffboardMemory:
    """Setpoints for now, flown or not: the newest ones, and how many there were."""

    motion: MotionSetpoint | None = None
    attitude: AttitudeSetpoint | None = None
    joints: JointSetpoint | None = None
    motion_us: int = -1  # when motion or attitude came
    joints_us: int = -1
    accepted: int = 0
    refused: int = 0
    tilt: Tilt = field(default_factory=Tilt)
    problem: str = ""  # why the newest refused one was
    problem_us: int = -1  # when it came
    told_us: int = -1  # when a problem was reported last

    @property
    def last_received_us(self) -> int:
        """When the newest setpoint of any kind came; -1: never."""
        return max(self.motion_us, self.joints_us)

    def is_fresh(self, now_us: int, timeout_us: int) -> bool:
        """Whether the newest setpoint is within the timeout."""
        return is_young(self.last_received_us, now_us, timeout_us)


def is_young(last_received_us: int, now_us: int, timeout_us: int) -> bool:
    """Whether what came at ``last_received_us``, negative for never, is within the timeout."""
    return last_received_us >= 0 and now_us - last_received_us < timeout_us


@dataclass(frozen=True, slots=True)
class MissionMemory:
    """The uploaded mission, targets and safe set."""

    stream: tuple[EndEffectorTarget, ...] = ()
    safe_set: SafeSet = field(default_factory=SafeSet)  # in force: announced and fence together
    refused: SafeSetAnnouncement | None = None  # the last one
    refused_count: int = 0  # messages that were refused since start
    refusals: tuple[str, ...] = ()  # why this configuration cannot keep the safe set
    announced: SafeSet = field(default_factory=SafeSet)
    fence: SafeSet = field(default_factory=SafeSet)
    owner: MessageSource | None = None  # of what is announced
    owner_heard_us: int = -1  # when it was announced last; -1: not since the vehicle disarmed
    fence_owner: MessageSource | None = None  # who uploaded the fence; None: there is none
    upload_taken: bool = True  # the last one
    accepted: tuple[SafeSetAnnouncement, ...] = ()  # the last one of each source
    silent_zones: int = 0  # that moved, timed out, and are held where they were
    rally: tuple[Vec2, ...] = ()  # m, where a return may lead beside home
    # May change where a return ends while armed; None: the first sender that changes it.
    home_owner: Sender | None = None
    flight: MissionFlight = field(default_factory=MissionFlight)


@dataclass(frozen=True, slots=True)
class PlanMemory:
    """The running plan and the request that is out."""

    running: Plan | None = None
    since_us: int = 0  # when the running plan began, or the vehicle was taken over
    awaited_id: int = -1  # -1: no request is out
    awaited_us: int = 0
    awaited_missed: bool = False
    next_id: int = 0
    status: SolverStatus = SolverStatus.UNKNOWN
    refused: bool = False
    reason: str = ""  # why, where the status does not say it
    counters: PlannerCounters = field(default_factory=PlannerCounters)


@dataclass(frozen=True, slots=True)
class SafetyMemory:
    """Episodes off the plan and outside the safe set, and what else is unsafe.

    ``off_plan_us``, ``breach_us``, ``fence_us`` and ``filter_us`` are when it was last so, the
    ``us`` of roll, pitch and thrust since when it has been so; -1: it is not.
    """

    off_plan_us: int = -1
    off_plan_by: float = 0.0  # m, when it began
    replan: bool = False  # from the measurement, next time
    breach_us: int = -1  # of the announced safe set
    breach_by: float = 0.0  # m, when it began
    fence_us: int = -1  # the same of the uploaded fence, told and acted upon by itself
    fence_by: float = 0.0
    filter_us: int = -1  # when the safety filter changed an acceleration last
    rolled_us: int = -1  # since when the roll has been beyond its limit; -1: it is not
    pitched_us: int = -1  # the same of the pitch
    light_us: int = -1  # since when rotors have carried too little to fly; -1: they carry enough
    jump_us: int = 0  # how far time or the sensors' clock jumped at ``jumped_us``
    jumped_us: int = -1  # when it jumped last, from one tick to the next
    counters: SafetyCounters = field(default_factory=SafetyCounters)

    @property
    def is_open(self) -> bool:
        """Whether an episode goes on that a later tick may end, or act upon."""
        since_us = self.off_plan_us, self.breach_us, self.fence_us, self.filter_us
        return max(*since_us, self.rolled_us, self.pitched_us, self.light_us) >= 0


_HEADING_KEPT: Final = 0.5  # of the thrust of a rotor; hover needs half of its command


class Damage(NamedTuple):
    """Parts that have failed; what detects it sets it, and the failsafe table acts on it."""

    rotor: str = ""  # which one and how, for the operator; empty: none has
    rotor_us: int = 0  # since when
    joint: str = ""
    joint_us: int = 0
    report: ActuatorReport = ActuatorReport()
    health: ActuatorHealth = HEALTHY  # what loops reckon with
    spared: bool = False  # the rotor is lost, and the others fly without it
    balance: JointVector | None = None  # rad, joints with which they hold the heading; None: any

    @property
    def severe(self) -> bool:
        """Whether the heading is not controlled any more, or in one posture of the arm alone."""
        if self.spared and self.balance is None:
            return self.report.disobeys
        return self.report.disobeys or self.report.effect < _HEADING_KEPT


class LostSensor(NamedTuple):
    """A sensor that every tick needs and that is of no use."""

    sensor: Sensor
    fault: SensorFault
    since_us: int

    def sentence(self, now_us: int) -> str:
        """What is wrong, and for how long at ``now_us`` [us]."""
        seconds = 1e-6 * (now_us - self.since_us)
        return f"{sentence(self.sensor, self.fault)}, for {seconds:.2f} s"


class Aiding(NamedTuple):
    """What keeps the estimate from drifting, and what of it is missing."""

    unaided_us: int = 0  # since a position was used last
    pose: Sensor = Sensor.POSE  # that gives positions
    pose_fault: SensorFault = SensorFault.STALE
    position_sigma: float = 0.0  # m, of the worst axis, without what lasts of a sensor's error
    elsewhere: float = 0.0  # m, how far the refused positions lie from the estimate
    unproven: Vec3 = _NOWHERE  # m, NED, sum of unexpected jumps of the estimate
    velocity_sigma: float = 0.0  # m/s, as of the position
    attitude_sigma: float = 0.0  # rad, of roll and pitch
    height_sigma: float = 0.0  # m, with what lasts of a sensor's error
    lost: tuple[LostSensor, ...] = ()  # others that are of no use
    gyro_lost: bool = False  # rotors' torques stand in
    half_pose: bool = False  # poses are used without their attitudes
    disputed_us: int = 0  # since sensors began to contradict each other; 0: they do not
    suspects: str = ""  # of which one is wrong then

    def holds_attitude(self, unaided_us: int) -> bool:
        """Whether an inertial unit does, or a pose less than ``unaided_us`` [us] ago.

        Else the rotors' model stands in, and the attitude gets worse with time.
        """
        by_pose = self.pose is Sensor.POSE and self.unaided_us < unaided_us
        return (by_pose and not self.half_pose) or not self.has_lost(Sensor.IMU)

    def has_lost(self, sensor: Sensor) -> bool:
        """Whether a sensor that every tick needs is of no use."""
        return any(one.sensor is sensor for one in self.lost)

    @property
    def feels_nothing(self) -> bool:
        """Whether height and force are those of the rotors' model: no ground would be noticed."""
        sigma = min(self.height_sigma, self.position_sigma)
        return sigma > HEIGHT_UNKNOWN and self.has_lost(Sensor.IMU)


AIDED: Final = Aiding()
COMPLETE: Final = Dropout()


@dataclass(frozen=True, slots=True)
class FlightState:
    """Everything a tick starts from."""

    record: Tick
    index: int = -1  # of the last tick on the absolute grid, missed ones counted
    t_us: int = 0  # of the last tick
    invalid_ticks: int = 0
    output_replaced: bool = False

    vehicle: VehicleMemory = field(default_factory=VehicleMemory)
    mission: MissionMemory = field(default_factory=MissionMemory)
    plan: PlanMemory = field(default_factory=PlanMemory)
    constraints: ConstraintReport = field(default_factory=ConstraintReport)
    reference: EndEffectorTarget | None = None  # in use when last planned
    tuning: Tuning = ()  # in use: what differs from the configuration of the start
    setpoint: SetpointMemory = field(default_factory=SetpointMemory)
    offboard: OffboardMemory = field(default_factory=OffboardMemory)
    battery: BatteryState = field(default_factory=BatteryState)
    arming: ArmingReport = field(default_factory=ArmingReport)
    safety: SafetyMemory = field(default_factory=SafetyMemory)
    fusion: FusionMemory | None = None  # where sensors have times of their own
    estimator: EstimatorReport | None = None  # what telemetry says of it, once a planning period
    aiding: Aiding = AIDED
    dropout: Dropout = COMPLETE  # where states are exact
    # The safe set, with clearances for an estimate that is not sure.
    kept: InflatedSafeSet = InflatedSafeSet()
    accuracy: AccuracyMemory = AccuracyMemory()  # of the estimate, until it is told
    host: HostHealth = field(default_factory=HostHealth)
    damage: Damage = Damage()
    progress: ProgressMemory = ProgressMemory()
    limited: str = ""  # why the reference is not what was asked for; empty: it is

    @property
    def estimate(self) -> StateEstimate | None:
        """The last valid one, made anew each time."""
        return self.record.state_estimate

    @property
    def plan_state(self) -> PredictionState | None:
        """Where the running plan wants the vehicle now, made anew each time."""
        return self.record.plan_state


def first_state(airframe: Airframe) -> FlightState:
    """What the first tick of a vehicle starts from."""
    return FlightState(record=new_tick(airframe.mass, airframe.rotors, airframe.bodies.joints))
