"""Every value that crosses a boundary of the flight software.

Frames: W is the local NED world, B the body (FRD), E the end-effector. ``R_WB`` maps body
components to world components and is stored row by row. Units are SI and radians. The tick
runs at 500 Hz, so its values are tuples of plain floats: at this size NumPy costs more than
it saves (docs/decisions/0003-plain-floats-in-the-fast-loop.md). What goes in and out of the
compiled loops is a NamedTuple, which numba reads by name and which is made in a fifth of the
time of a frozen dataclass (docs/decisions/0017-one-compiled-call-a-tick.md).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum, IntEnum
from typing import Final, NamedTuple

from fsw.autopilot.measurements import ImuSample, Sample
from fsw.autopilot.measurements import JointVector as JointVector
from fsw.autopilot.measurements import RotorVector as RotorVector
from fsw.autopilot.measurements import Vec2 as Vec2
from fsw.autopilot.measurements import Vec3 as Vec3
from fsw.autopilot.measurements import Vec4 as Vec4
from fsw.autopilot.tuning import Tuning
from fsw.frozen import dataclass

MAX_DISTANCE = 1000.0  # m from the origin; a place farther off is a slip: of frame, unit or sign
MAX_MISSION_SPEED = 1.0  # m/s, of a mission's segment
Mat3 = tuple[float, float, float, float, float, float, float, float, float]  # row-major


class Mode(Enum):
    """Where the vehicle is in its flight; each flight mode has a file in ``flight/modes``."""

    __hash__ = object.__hash__  # an Enum's own runs Python, for each look into a table

    DISARMED = "disarmed"
    TAKEOFF = "takeoff"
    HOLD = "hold"
    MISSION = "mission"
    RETURN = "return"
    LAND = "land"
    OFFBOARD = "offboard"
    ORBIT = "orbit"
    TRAJECTORY = "trajectory"
    DESCEND = "descend"
    FAULT = "fault"

    @property
    def armed(self) -> bool:
        """Whether actuators may move."""
        return self is not _DISARMED and self is not _FAULT


# A name of the module is looked up ten times faster than a member of an enumeration.
_DISARMED, _FAULT = Mode.DISARMED, Mode.FAULT


class SolverStatus(IntEnum):
    """Outcome of one planning cycle; values equal PANDION_SOLVER_STATUS of the dialect."""

    UNKNOWN = 0
    SOLVED = 1
    ALMOST_SOLVED = 2
    INFEASIBLE = 3
    TIME_LIMIT = 4
    NUMERICAL_ERROR = 5
    INPUT_REFUSED = 6


class SetpointKind(IntEnum):
    """What is flown offboard; values equal PANDION_SETPOINT_KIND of the dialect."""

    NONE = 0
    BODY = 1
    END_EFFECTOR = 2
    ATTITUDE = 3
    JOINTS = 4


class ConstraintKind(IntEnum):
    """Which safe set is active; values equal PANDION_CONSTRAINT_KIND of the dialect."""

    NONE = 0
    WALLS = 1
    WORKSPACE = 2
    OBSTACLES = 3  # any shape that is no wall; beside them there may be walls


# ---------------------------------------------------------------- inputs of a tick


@dataclass(frozen=True, slots=True)
class SensorFrame:
    """Sensor readings of one instant."""

    t_us: int  # sensor time, the only clock a tick knows
    p_WB: Vec3  # m
    v_WB: Vec3  # m/s, world components
    q_WB: Vec4  # unit quaternion [w, x, y, z]
    gyro_B: Vec3  # rad/s
    accel_B: Vec3  # m/s^2, specific force
    q_arm: JointVector  # rad
    qd_arm: JointVector  # rad/s


_NO_VECTOR: Final[Vec3] = (math.nan, math.nan, math.nan)
_NO_ATTITUDE: Final[Vec4] = (math.nan, *_NO_VECTOR)


def frame_of_samples(t_us: int, samples: Sequence[Sample], joints: int) -> SensorFrame:
    """The frame of a tick that has ``samples`` instead, of a vehicle with so many ``joints``.

    It has the time, and what the inertial unit measured where that is the last sample. What is not
    known is ``math.nan`` itself: two such frames of the same numbers are equal.
    """
    newest = samples[-1] if samples else None
    rate, force = _NO_VECTOR, _NO_VECTOR
    if type(newest) is ImuSample:
        rate, force = newest.rate, newest.acceleration
    arm = (math.nan,) * joints
    return SensorFrame(t_us, _NO_VECTOR, _NO_VECTOR, _NO_ATTITUDE, rate, force, arm, arm)


def is_frame_of(frame: SensorFrame, imu: ImuSample | None) -> bool:
    """Whether a frame is one of ``frame_of_samples``, and has of them what ``imu`` measured."""
    if imu is None or frame.p_WB is not _NO_VECTOR:
        return False
    return frame.gyro_B == imu.rate and frame.accel_B == imu.acceleration


@dataclass(frozen=True, slots=True)
class EndEffectorTarget:
    """One point of the end-effector reference and the instant at which to meet it."""

    t_us: int
    p_WE: Vec3  # m
    v_WE: Vec3  # m/s
    a_WE: Vec3  # m/s^2
    yaw: float = 0.0  # rad
    force: float = 0.0  # N, with which the tool presses on the touchable zone there


class PositionFrom(Enum):
    """What the position of a setpoint counts from."""

    ORIGIN = "origin"  # of the local frame
    VEHICLE = "vehicle"  # body or end-effector, where it is when the setpoint arrives
    HOME_HEIGHT = "home height"  # north and east from the origin, down from home


@dataclass(frozen=True, slots=True)
class MotionSetpoint:
    """Where the body or the end-effector should be or move from now on; None leaves it open.

    NaN leaves one axis of a vector open: each axis has a position, a velocity or an acceleration.
    """

    of_end_effector: bool
    p: Vec3 | None = None  # m
    v: Vec3 | None = None  # m/s
    a: Vec3 | None = None  # m/s^2
    yaw: float | None = None  # rad
    yaw_rate: float | None = None  # rad/s
    along_heading: bool = False  # v and a in the body's level frame: forward, right, down
    p_from: PositionFrom = PositionFrom.ORIGIN  # with along_heading, p from the vehicle is as v


@dataclass(frozen=True, slots=True)
class AttitudeSetpoint:
    """An attitude or body rates, and a thrust."""

    thrust: float  # 0 to 1, of what all rotors give
    q_WB: Vec4 | None = None  # unit quaternion [w, x, y, z]; None: rates alone
    w_WB_B: Vec3 | None = None  # rad/s


@dataclass(frozen=True, slots=True)
class JointSetpoint:
    """Where the arm's joints should be."""

    q_arm: JointVector  # rad


@dataclass(frozen=True, slots=True)
class Origin:
    """Where on Earth the local frame begins."""

    latitude: float  # deg
    longitude: float  # deg
    altitude: float  # m above mean sea level


@dataclass(frozen=True, slots=True)
class Home:
    """Where a return leads to."""

    p: Vec3  # m, the body's place while it stands there
    yaw: float  # rad


class Facing(IntEnum):
    """Where the nose points on an orbit; values equal ORBIT_YAW_BEHAVIOUR of MAVLink."""

    CENTRE = 0
    INITIAL = 1  # as it was when the orbit began
    TANGENT = 3  # along the flight


@dataclass(frozen=True, slots=True)
class Orbit:
    """A level circle that the body flies."""

    centre: Vec3  # m, NED; z is the height that is flown
    radius: float  # m
    speed: float  # m/s along the circle
    clockwise: bool = True  # seen from above
    facing: Facing = Facing.CENTRE


class Shape(NamedTuple):
    """Geometry only; kinds and what their numbers mean: ``fsw/autopilot/shapes``, a file each."""

    kind: str  # a name in fsw.autopilot.shapes.BY_NAME
    numbers: tuple[float, ...]  # m, NED


_POINTS: Final = 3  # of the paper's body
TARGET_SPHERE: Final = "target sphere"  # the shape that follows the end-effector's target


class Touch(NamedTuple):
    """What the tool meets where it may touch a zone."""

    force_max: float  # N, along the normal, never exceeded
    stiffness_low: float  # N/m, of the surface and what is behind it: at least
    stiffness_high: float  # N/m, at most
    dissipation: float = 0.0  # s/m, of Hunt and Crossley
    friction: float = 0.0  # of the tool along the surface


@dataclass(frozen=True, slots=True)
class Zone:
    """A shape to keep out of, or inside of, that may move."""

    shape: Shape
    clearance: float  # m, kept from its surface: s_min of eq 14, d_s of eq 11
    keep_in: bool = False
    velocity: Vec3 = (0.0, 0.0, 0.0)  # m/s, NED
    t_us: int = 0  # when the shape was where its numbers say
    touch: Touch | None = None  # what the tool may touch, as no other part may; None: nothing


@dataclass(frozen=True, slots=True)
class SafeSet:
    """Where the vehicle may be: out of some zones (Case I) and inside of others (Case II)."""

    zones: tuple[Zone, ...] = ()

    @property
    def kind(self) -> ConstraintKind:
        """The family that telemetry names."""
        kinds = {zone.shape.kind for zone in self.zones}
        if TARGET_SPHERE in kinds:
            return ConstraintKind.WORKSPACE
        if kinds - {"half-space"}:
            return ConstraintKind.OBSTACLES
        return ConstraintKind.WALLS if kinds else ConstraintKind.NONE

    @property
    def touchable(self) -> bool:
        """Whether the tool may touch one of them."""
        return any(zone.touch is not None for zone in self.zones)


Sender = tuple[int, int]
"""MAVLink system and component."""
# Who commands on the vehicle's own link: the scenario's pilot, and what follows PX4's modes.
VEHICLE_PILOT: Sender = (1, 195)


@dataclass(frozen=True, slots=True)
class MessageSource:
    """Who sent a message, as far as its link can say."""

    system: int  # MAVLink ids, which anyone can write into a frame
    component: int
    link: str  # "simulator", "gcs" or "api"
    address: str = ""  # host:port; empty where the link has a single peer
    signed: bool = False  # with the link's key

    def __str__(self) -> str:
        """As an operator reads it."""
        where = self.link + (f" {self.address}" if self.address else "")
        return f"{self.system}/{self.component} ({where})"

    @property
    def sender(self) -> Sender:
        """Its MAVLink ids."""
        return self.system, self.component

    @property
    def place(self) -> tuple[str, str]:
        """Link and address, which no frame can choose."""
        return self.link, self.address

    def is_same(self, other: MessageSource | None) -> bool:
        """Whether both are one sender: of the same address, unless signatures vouch for both."""
        if other is None:
            return False
        ids = (self.system, self.component, self.link, self.signed)
        return ids == (other.system, other.component, other.link, other.signed) and (
            self.signed or self.address == other.address
        )


@dataclass(frozen=True, slots=True)
class SafeSetAnnouncement:
    """A safe set, whole, and who wants it."""

    source: MessageSource
    safe_set: SafeSet


# ---------------------------------------------------------------- commands


class CommandResult(IntEnum):
    """Answer to a command; values equal MAV_RESULT."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4
    IN_PROGRESS = 5  # another one answers


@dataclass(frozen=True, slots=True)
class Place:
    """A place in the local frame, as far as a command names one; None: where the vehicle is."""

    north_east: Vec2 | None = None  # m
    height: float | None = None  # m above the origin, or above home
    above_home: bool = False


@dataclass(frozen=True, slots=True)
class Arm:
    """Close the loops."""

    force: bool = False  # against all checks but that of the estimate


@dataclass(frozen=True, slots=True)
class Disarm:
    """Stop the rotors."""

    force: bool = False  # in the air as well


@dataclass(frozen=True, slots=True)
class SwitchMode:
    """Fly in another mode."""

    mode: Mode


@dataclass(frozen=True, slots=True)
class TakeOff:
    """Climb straight up."""

    to: Place  # its height; None: the usual climb


@dataclass(frozen=True, slots=True)
class GoTo:
    """Hold at another place."""

    place: Place
    yaw: float | None = None  # rad; None: as it is
    speed: float | None = None  # m/s; None: as usual
    may_switch_mode: bool = False  # or only while in Hold


@dataclass(frozen=True, slots=True)
class FlyOrbit:
    """Fly a level circle."""

    centre: Place
    radius: float  # m
    speed: float | None = None  # m/s; None: as usual
    clockwise: bool = True
    facing: Facing = Facing.CENTRE


@dataclass(frozen=True, slots=True)
class LookAt:
    """Point the nose at a place from now on; None: along the flight again."""

    place: Place | None


@dataclass(frozen=True, slots=True)
class ChangeSpeed:
    """Fly to places at another speed from now on."""

    speed: float | None  # m/s; None: as usual


@dataclass(frozen=True, slots=True)
class MoveJoints:
    """Move the arm."""

    # Of each joint -1 to 1, of the limit of its angle, or of the sum of joints that ends with it;
    # None leaves it as it is, and so do joints that are not there.
    shares: tuple[float | None, ...]


@dataclass(frozen=True, slots=True)
class SetHome:
    """Where a return leads to; None: here."""

    place: Place | None


@dataclass(frozen=True, slots=True)
class StartMission:
    """Fly the uploaded mission from a step on, to its end."""

    first: float = 0.0
    last: float = 0.0  # 0: to the end


@dataclass(frozen=True, slots=True)
class SetMissionStep:
    """Make another step the current one."""

    number: float  # -1: the current step
    reset: bool = False


@dataclass(frozen=True, slots=True)
class InjectFailure:
    """Let a unit of the simulated vehicle fail, or work again; the simulator knows which."""

    unit: int  # FAILURE_UNIT
    kind: int  # FAILURE_TYPE
    instance: int  # 0: all


@dataclass(frozen=True, slots=True)
class Grip:
    """Close the gripper and hold what is in it, or open it."""

    closes: bool


class Order(Enum):
    """Commands without parameters."""

    TERMINATE = "terminate"
    PAUSE_MISSION = "pause mission"
    CONTINUE_MISSION = "continue mission"
    CHECK_ARMING = "check arming"
    RESTART = "restart"
    NOTHING = "nothing"  # accepted, and nothing to do


@dataclass(frozen=True, slots=True)
class Rejected:
    """A command that means nothing to this vehicle, as the link found out."""

    result: CommandResult
    reason: str = ""


CommandAction = (
    Arm
    | Disarm
    | SwitchMode
    | TakeOff
    | GoTo
    | FlyOrbit
    | LookAt
    | ChangeSpeed
    | MoveJoints
    | SetHome
    | StartMission
    | SetMissionStep
    | InjectFailure
    | Grip
    | Order
    | Rejected
)
"""What a command asks for, without MAVLink's numbers."""


@dataclass(frozen=True, slots=True)
class CommandRequest:
    """A MAVLink command (COMMAND_LONG or COMMAND_INT) addressed to this vehicle, as it came."""

    command: int  # MAV_CMD
    params: tuple[float, float, float, float, float, float, float]  # NaN where not used
    source_system: int
    source_component: int
    confirmation: int = 0
    frame: int | None = None  # MAV_FRAME of a COMMAND_INT, None for a COMMAND_LONG

    @property
    def sender(self) -> Sender:
        """Who sent it."""
        return self.source_system, self.source_component

    def answer(self, result: int) -> CommandAck:
        """The acknowledgement to its sender, a MAV_RESULT."""
        return CommandAck(self.command, result, *self.sender)


@dataclass(frozen=True, slots=True)
class Command:
    """What a command asks for, and the message it came in, which is logged and acknowledged."""

    action: CommandAction
    request: CommandRequest


# ---------------------------------------------------------------- mission


class MissionAction(Enum):
    """What one step of a mission does."""

    TAKE_OFF = "take off"
    GO = "go"  # to a position, then stay for hold_s
    DELAY = "delay"  # stay for hold_s
    SPEED = "speed"  # of the legs that follow
    LAND = "land"
    RETURN = "return"
    LOOK_AT = "look at"  # from now on: a place, or nothing
    CIRCLE = "circle"  # some turns about a position, then stay for hold_s
    JUMP = "jump"  # to another step, some times
    PUSH = "push"  # on the surface at a position, with force for press_s
    GRIP = "grip"  # close the gripper and hold what is in it
    RELEASE = "release"
    SKIP = "skip"  # it is for a payload that this vehicle does not have


@dataclass(frozen=True, slots=True)
class MissionStep:
    """One step, as read from the mission item of the same number."""

    action: MissionAction
    position: Vec3 | None = None  # m, of the end-effector (takeoff: of the base); None: right here
    above_home: bool = False  # position's z counts from home's
    yaw: float | None = None  # rad; None: as it is
    hold_s: float = 0.0
    acceptance: float = 0.1  # m, end-effector to position
    speed: float | None = None  # m/s; None: the usual
    stop_after: bool = False  # hold until commanded to continue
    radius: float = 0.0  # m, of a circle; negative: anticlockwise as seen from above
    turns: float = 0.0
    target: int = 0  # of a jump: the step to go on with
    repeats: int = 0  # of a jump: how often it is taken; negative: without end
    here: bool = False  # position gives the height alone: north and east stay as they are
    force: float = 0.0  # N, of a push, along the normal of the surface
    press_s: float = 0.0  # with all of that force


@dataclass(frozen=True, slots=True)
class MissionUpdate:
    """What a ground station wants changed, all of it or nothing; None where it does not."""

    steps: tuple[MissionStep, ...] | None = None
    fence: SafeSet | None = None
    rally: tuple[Vec2, ...] | None = None  # m, north and east
    current: int | None = None  # the step to fly next
    source: MessageSource | None = None  # who uploaded it


class MissionState(IntEnum):
    """How far a mission is; values equal MISSION_STATE of MAVLink."""

    NO_MISSION = 1
    NOT_STARTED = 2
    ACTIVE = 3
    PAUSED = 4
    COMPLETE = 5


@dataclass(frozen=True, slots=True)
class MissionProgress:
    """Mission state as reported to ground stations."""

    state: MissionState = MissionState.NO_MISSION
    current: int = 0
    total: int = 0
    reached: int = -1  # the last step that was
    reached_count: int = 0  # grows with each, so that none is missed


# ---------------------------------------------------------------- estimate


class StateEstimate(NamedTuple):
    """What the vehicle believes about itself."""

    t_us: int
    p_WB: Vec3  # m
    v_WB: Vec3  # m/s
    R_WB: Mat3
    w_WB_B: Vec3  # rad/s
    yaw: float  # rad, ZYX
    q_arm: JointVector  # rad
    qd_arm: JointVector  # rad/s
    specific_force: float = 9.81  # m/s^2, accelerometer along -z of the body


# ---------------------------------------------------------------- planner


class PredictionState(NamedTuple):
    """State of the prediction model: for two joints the paper's twelve plus seven of the lag."""

    p: Vec3  # m, body origin
    v: Vec3  # m/s
    a: Vec3  # m/s^2
    j: Vec2  # m/s^3, horizontal
    s: Vec2  # m/s^4, horizontal
    yaw: float  # rad
    yaw_rate: float  # rad/s
    q_arm: JointVector  # rad
    qd_arm: JointVector  # rad/s


class PlanInput(NamedTuple):
    """The paper's u for one step of the horizon: [a_d, yaw acceleration, joint accelerations]."""

    a: Vec3  # m/s^2, commanded, of thrust
    yaw_acc: float  # rad/s^2
    qdd_arm: JointVector  # rad/s^2
    push: Vec3 = (0.0, 0.0, 0.0)  # m/s^2, NED, what pressing on a surface is taken to add
    force: float = 0.0  # N, with which the tool is to press


@dataclass(frozen=True, slots=True)
class PlanRequest:
    """One question to the planner."""

    plan_id: int
    t_apply_us: int  # when the answer takes effect; ``start`` is the state predicted for it
    start: PredictionState
    targets: tuple[EndEffectorTarget, ...]  # n + 1 points, one a node, first at t_apply_us
    safe_set: SafeSet
    from_nominal: bool  # start carried over from the running plan, not measured
    tuning: Tuning = ()  # of the planner's configuration
    # rad, joints to hold at the nodes; empty: the planner chooses
    joint_targets: tuple[JointVector, ...] = ()
    # m/s^2, largest horizontal disturbance observed of late; infinite: not known
    recent_disturbance: float = math.inf
    mode: Mode = Mode.TRAJECTORY  # in which the plan is flown
    # m/s^2, NED, in each step: what pressing adds to what thrust does; empty: nothing is pressed on
    pushes: tuple[Vec3, ...] = ()


@dataclass(frozen=True, slots=True)
class PlanTimings:
    """Wall time of one planning cycle by stage [us]; never used by control. Negative: unknown."""

    linearise_us: float
    solve_us: float
    total_us: float


@dataclass(frozen=True, slots=True)
class Plan:
    """A horizon of inputs, valid from ``t_us`` on."""

    plan_id: int
    t_us: int
    period_us: int
    start: PredictionState
    inputs: tuple[PlanInput, ...]  # one a period
    status: SolverStatus
    cost: float
    slack_max: float  # largest softening of a barrier row, 0 where all hold
    barrier: tuple[float, ...]  # h of each constraint at ``start`` [m/s]
    sqp_iterations: int
    solver_iterations: int
    timings: PlanTimings


@dataclass(frozen=True, slots=True)
class PlanFailure:
    """The planner's refusal; the running plan goes on and the failure is counted."""

    plan_id: int
    status: SolverStatus
    reason: str  # where the status does not say it
    timings: PlanTimings


# ---------------------------------------------------------------- outputs of a tick


class ActuatorCommand(NamedTuple):
    """What leaves the flight software."""

    rotor_thrust: RotorVector  # N
    joint_torque: JointVector  # N m


class Setpoint(NamedTuple):
    """Where an autopilot that has loops of its own is asked to bring the vehicle."""

    p: Vec3  # m, NED, body origin
    v: Vec3  # m/s, NED
    a: Vec3  # m/s^2, NED, beside what its loops make of the rest
    yaw: float  # rad
    yaw_rate: float  # rad/s
    q_arm: JointVector  # rad


@dataclass(frozen=True, slots=True)
class CommandAck:
    """Answer to one CommandRequest."""

    command: int  # MAV_CMD
    result: int  # CommandResult, MAV_RESULT
    target_system: int
    target_component: int


class Severity(IntEnum):
    """MAV_SEVERITY. As PX4 has it: refusals and failsafes are critical, what goes well is INFO."""

    EMERGENCY = 0
    CRITICAL = 2
    WARNING = 4
    NOTICE = 5
    INFO = 6


class FailsafeEvent(NamedTuple):
    """A condition of the failsafe table that began or ended, for programs."""

    condition: str  # its name
    action: str  # what is done about it
    severity: Severity
    over: bool = False  # it has ended
    later: str = ""  # what is done when ``delay_us`` has passed, unless it ends; empty: nothing
    delay_us: int = 0


@dataclass(frozen=True, slots=True)
class StatusText:
    """A sentence for the operator."""

    severity: Severity
    text: str
    event: FailsafeEvent | None = None  # that it is about
    prompt: bool = False  # an answer, or a change of mode: news even in the same words


@dataclass(frozen=True, slots=True)
class PlannerCounters:
    """What happened to plans since start."""

    plans: int = 0
    missed_deadlines: int = 0
    fallbacks: int = 0


@dataclass(frozen=True, slots=True)
class SafetyCounters:
    """What should not happen, since start, in episodes."""

    departures: int = 0  # from the tube around the plan
    breaches: int = 0  # of the safe set
    interventions: int = 0  # of the safety filter
    refusals: int = 0  # of what was announced, streamed or uploaded, each message counted


@dataclass(frozen=True, slots=True)
class ConstraintReport:
    """Margins of the active safe set, from the vehicle's own estimate."""

    kind: ConstraintKind = ConstraintKind.NONE
    margins: tuple[float, ...] = ()  # m, of each zone and part of the body, zone by zone
    barrier: tuple[float, ...] = ()  # h, m/s, same order
    per_zone: tuple[int, ...] = ()  # how many of them belong to each zone
    # m, kept from each zone beyond its clearance because the estimate is not sure; empty: nothing
    added: tuple[float, ...] = ()
    shortfall: float = 0.0  # m, largest shortfall of that of a zone

    def shown(self, most: int) -> tuple[tuple[float, ...], tuple[float, ...], int | None]:
        """Margins [m] and barrier values [m/s] for a record with room for ``most``, and the least.

        All of a body of three points, if they fit; otherwise the least of each zone, of the first
        zones. The index of the least margin may lie behind them; None without margins.
        """
        margins, barrier = self.margins, self.barrier
        if len(margins) > most or max(self.per_zone, default=1) > _POINTS:
            margins, barrier = self._of_zones(margins), self._of_zones(barrier)
        least = margins.index(min(margins)) if margins else None
        return margins[:most], barrier[:most], least

    def _of_zones(self, values: tuple[float, ...]) -> tuple[float, ...]:
        begin, least = 0, []
        for count in self.per_zone:
            least.append(min(values[begin : begin + count]))
            begin += count
        return tuple(least)


class BatteryWarning(IntEnum):
    """How much is left, by the thresholds of the parameters."""

    OK = 0
    LOW = 1
    CRITICAL = 2
    EMERGENCY = 3


@dataclass(frozen=True, slots=True)
class BatteryState:
    """What a model of the battery says, corrected by what is measured of it, if anything is."""

    voltage: float = 16.8  # V
    current: float = 0.0  # A
    consumed: float = 0.0  # A h
    remaining: float = 1.0  # share of the capacity
    charge: BatteryWarning = BatteryWarning.OK
    usual_current: float = 0.0  # A, of late
    time_left: float = math.inf  # s, at the usual current
    voltage_error: float = 0.0  # V, measured minus modelled, when it was measured last


@dataclass(frozen=True, slots=True)
class OffboardReport:
    """The setpoint in use while offboard, and how many were refused since start."""

    kind: SetpointKind = SetpointKind.NONE  # NONE unless flying offboard
    motion: MotionSetpoint | None = None
    attitude: AttitudeSetpoint | None = None
    joints: JointSetpoint | None = None
    accepted: int = 0
    refused: int = 0
    age_us: int = 0  # of the newest accepted one


class SensorReport(NamedTuple):
    """One sensor, as the estimator sees it."""

    name: str
    silent_us: int  # since its newest reading came; -1: never
    fault: str = ""  # what is wrong with it; empty: nothing
    ratio: tuple[float, ...] = ()  # innovation over its limit, of each part of the last reading
    innovation: tuple[float, ...] = ()  # m, m/s, rad


class TestRatios(NamedTuple):
    """Innovation over its limit, the largest of all sensors that measure it; 1: refused."""

    velocity: float = math.nan
    place: float = math.nan  # level
    height: float = math.nan
    heading: float = math.nan
    above_ground: float = math.nan


@dataclass(frozen=True, slots=True)
class SatelliteFix:
    """The newest reading of a receiver, as far as it was measured."""

    t_us: int  # of the measurement
    p: Vec3  # m, NED; the last known one, NaN where there never was a fix
    v: Vec3  # m/s, NED
    position_sigma: Vec3  # m, NED
    velocity_sigma: float  # m/s
    kind: int = 3  # GPS_FIX_TYPE; 1, no fix, where it is silent
    satellites: int = 255  # that it sees; 255: not known


@dataclass(frozen=True, slots=True)
class EstimatorReport:
    """What an estimator from sensors of their own times says about itself."""

    t_us: int
    pose_covariance: tuple[float, ...]  # (21,) upper triangle: m^2 NED, rad^2 about the body's axes
    velocity_covariance: tuple[float, ...]  # (21,) the same: m^2/s^2 and rad^2/s^2, body
    accel_bias: Vec3  # m/s^2, body
    gyro_bias: Vec3  # rad/s, body
    accel_bias_variance: Vec3
    gyro_bias_variance: Vec3
    pose_delay: float  # s
    sensors: tuple[SensorReport, ...]
    ratios: TestRatios
    unaided_us: int  # since a position was used last; -1: none ever was
    resets: int  # of the estimate
    flags: int  # ESTIMATOR_STATUS_FLAGS
    fix: SatelliteFix | None = None  # where there is a receiver

    @property
    def level_accuracy(self) -> float:
        """Standard deviation of the horizontal position [m]."""
        return math.sqrt(self.pose_covariance[0] + self.pose_covariance[6])

    @property
    def vertical_accuracy(self) -> float:
        """Standard deviation of the height [m]."""
        return math.sqrt(self.pose_covariance[11])

    def innovation(self, name: str, count: int) -> tuple[float, ...]:
        """The last innovation of a sensor, ``count`` numbers; NaN where there is none."""
        for one in self.sensors:
            if one.name == name and len(one.innovation) == count:
                return one.innovation
        return (math.nan,) * count


@dataclass(frozen=True, slots=True)
class ArmingReport:
    """What is wrong: of a disarmed vehicle the arming checks say it, of an armed one conditions."""

    failed: tuple[int, ...] = ()  # checks, by their places in the table
    ill: tuple[str, ...] = ()  # conditions that make a component ill, by name


class ActuatorReport(NamedTuple):
    """What has been found out about rotors and joints in flight."""

    rotor: int = 0  # that has failed, from 1; 0: none
    effect: float = 1.0  # thrust over command of that rotor, as allocation takes it
    lost: bool = False  # it gives nothing
    disobeys: bool = False  # it gives something else than is commanded
    joints: JointVector = ()  # 0 sound, 1 stuck, 2 limp; empty: all are sound


class ContactReport(NamedTuple):
    """What the tool does at a surface that it may touch and that is near."""

    contact: bool
    force: Vec3  # N, NED, on the tool, observed
    pressed: float  # N, of that along the normal
    unsure: float  # N, by which that may be wrong
    commanded: float  # N, what the joints press with
    asked: float  # N, by the plan
    most: float  # N, that the surface allows
    distance: float  # m, of the tool to where the surface is


class PayloadReport(NamedTuple):
    """What the gripper does, and what it holds."""

    closed: bool
    mass: float  # kg, at the end-effector, weighed


@dataclass(frozen=True, slots=True)
class FlightSnapshot:
    """The vehicle as telemetry shows it after a tick; messages compute what follows from it."""

    t_us: int
    mode: Mode
    armed: bool
    estimate: StateEstimate
    reference: EndEffectorTarget | None  # end-effector setpoint in use when last planned
    plan_state: PredictionState | None  # where the running plan wants the vehicle now
    plan_input: PlanInput | None
    actuators: ActuatorCommand
    plan: Plan | None  # last accepted
    plan_status: SolverStatus  # of the last cycle, accepted or not
    counters: PlannerCounters
    constraints: ConstraintReport
    failures: tuple[str, ...] = ()  # active faults, by name
    landed: bool = False  # stands on the ground, armed or not
    home: Home | None = None
    battery: BatteryState = BatteryState()
    offboard: OffboardReport = OffboardReport()
    intended_mode: Mode = Mode.HOLD  # what arming would lead to
    mission: MissionProgress = MissionProgress()
    failsafe_from: Mode | None = None  # what was flown when a failsafe took over; None: none did
    orbit: Orbit | None = None  # that is being flown
    accel_B: Vec3 = (0.0, 0.0, -9.81)  # m/s^2, specific force as measured
    safety: SafetyCounters = SafetyCounters()
    estimator: EstimatorReport | None = None  # None: states are exact
    log_failure: str = ""  # why the flight log is not written as it should be
    arming: ArmingReport = ArmingReport()
    safe_set: SafeSet = SafeSet()  # in force: announced and fence together
    safe_set_owner: MessageSource | None = None  # of what is announced
    actuators_found: ActuatorReport = ActuatorReport()
    sensors_lost: tuple[str, ...] = ()  # that are of no use, beside the pose
    touching: ContactReport | None = None  # None: no surface that may be touched is near
    payload: PayloadReport | None = None  # None: the gripper was never told anything


@dataclass(frozen=True, slots=True)
class HostHealth:
    """What the loop around the tick found out about its machine, of the last second."""

    missed_ticks: int = 0  # late, skipped, or without readings of their own
    log_failure: str = ""  # why the flight log is not written as it should be; empty: it is
    disk_left_us: int = -1  # how long the disk will take the log; -1: long enough
    datagrams: int = 0  # from the ground, read or dropped
    clock_jump_us: int = 0  # of the wall clock against the monotonic one


@dataclass(frozen=True, slots=True)
class BatteryReading:
    """What a battery's sensor says."""

    voltage: float  # V, under load
    remaining: float  # share of the capacity


@dataclass(frozen=True, slots=True)
class TickInputs:
    """Everything one tick may look at."""

    sensors: SensorFrame  # its stamp is the instant of the tick
    plan: Plan | PlanFailure | None = None  # newly arrived, at most one
    commands: tuple[Command, ...] = ()
    targets: tuple[EndEffectorTarget, ...] = ()
    announced: tuple[SafeSetAnnouncement, ...] = ()  # safe sets, in order of arrival
    # The newest offboard setpoints; at most one of motion and attitude.
    motion: MotionSetpoint | None = None
    attitude: AttitudeSetpoint | None = None
    joints: JointSetpoint | None = None
    refused_setpoints: int = 0  # that were of no use, since the last tick
    ground_station_heard: bool = False  # a heartbeat, since the last tick
    mission: MissionUpdate | None = None  # newly uploaded
    tuning: Tuning | None = None  # requested, whole
    stale_us: int = 0  # how much older the sensors' readings are, where no newer ones had come
    # What sensors with times of their own measured; with any, the frame gives the time alone.
    samples: tuple[Sample, ...] = ()
    battery: BatteryReading | None = None  # newly measured
    host: HostHealth | None = None  # where it differs from the last one
    # By how much the sensors' clock has jumped. The times in here are the vehicle's: none has.
    sensor_clock_jump_us: int = 0
    refused: tuple[str, ...] = ()  # what a link refused since the last tick, and why
    setpoint_problem: str = ""  # why the newest of the refused setpoints is; empty: it is not ours

    @property
    def has_only_sensors(self) -> bool:
        """Whether nothing came but what sensors have measured, and that in time."""
        return self.tuning is None and not (
            self.stale_us
            or self.plan
            or self.targets
            or self.commands
            or self.announced
            or self.motion
            or self.attitude
            or self.joints
            or self.refused
            or self.refused_setpoints
            or self.ground_station_heard
            or self.mission
            or self.battery
            or self.host
            or self.sensor_clock_jump_us
        )


@dataclass(frozen=True, slots=True)
class TickOutputs:
    """Everything one tick says; before it is concluded, what goes out at once."""

    actuators: ActuatorCommand
    mode: Mode
    armed: bool
    setpoint: Setpoint | None = None  # for an autopilot with loops of its own; None: nothing flown
    gripper: float = 0.0  # 1: closes and holds, -1: opens, 0: was never told
    shown: FlightSnapshot | None = None  # None: the tick is not concluded
    plan_request: PlanRequest | None = None
    acks: tuple[CommandAck, ...] = ()
    texts: tuple[StatusText, ...] = ()
    tuning_taken: bool | None = None  # whether the requested one is in use; None: none was
    upload_taken: bool | None = None  # whether all of the mission update is; None: there was none

    @property
    def snapshot(self) -> FlightSnapshot:
        """The vehicle as telemetry shows it."""
        assert self.shown is not None, "the tick is not concluded"
        return self.shown
