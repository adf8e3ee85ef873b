"""The record of a tick: what the fast loop starts from and leaves.

First come the estimate, the plan's state and its input, then the memory of the loops and of the
watch over the actuators. Which law reads and writes what says the law; their order is that of
``Autopilot.tick``, and of ``close_loops`` in ``fsw/autopilot/control/cascade.py``. Kernels read its
fields; its properties ``state_estimate``, ``plan_state``, ``plan_input`` and ``actuator_command``
are the values that Python hands around, made where they are asked for.
"""

from __future__ import annotations

import math
import struct
from typing import Annotated, Any, Final

from fsw.autopilot.signals import (
    ActuatorCommand,
    JointVector,
    PlanInput,
    PredictionState,
    StateEstimate,
    Vec2,
)
from fsw.record import (
    JOINTS,
    ROTORS,
    Floats,
    Four,
    Nine,
    PerJoint,
    PerRotor,
    Record,
    Six,
    Three,
    Two,
    padded,
    per_joint,
)


class Estimate(Record):
    """``StateEstimate``, for kernels."""

    t_us: int
    p_WB: Three  # m, NED
    v_WB: Three  # m/s, NED
    R_WB: Nine
    w_WB_B: Three  # rad/s, FRD
    yaw: float  # rad
    q_arm: PerJoint  # rad
    qd_arm: PerJoint  # rad/s
    specific_force: float  # m/s^2, along -z of the body


class PlanState(Record):
    """``PredictionState``, for kernels."""

    p: Three  # m, NED
    v: Three  # m/s
    a: Three  # m/s^2
    j: Two  # m/s^3, horizontal
    s: Two  # m/s^4, horizontal
    yaw: float  # rad
    yaw_rate: float  # rad/s
    q_arm: PerJoint  # rad
    qd_arm: PerJoint  # rad/s


class Accelerations(Record):
    """``PlanInput``, for kernels."""

    a: Three  # m/s^2, NED
    yaw_acc: float  # rad/s^2
    qdd_arm: PerJoint  # rad/s^2
    push: Three  # m/s^2, NED
    force: float  # N


# What laws take that Python calls as well, with values of its own.
AnyEstimate = StateEstimate | Estimate
AnyPlan = PredictionState | PlanState
AnyInput = PlanInput | Accelerations


class Sent(Record):
    """``ActuatorCommand``, for kernels."""

    rotor_thrust: PerRotor  # N
    joint_torque: PerJoint  # N m


class Health(Record):
    """``ActuatorHealth``, for kernels."""

    effectiveness: PerRotor  # thrust over what is commanded
    least: PerRotor  # N
    most: PerRotor  # N, beside the rotor's own limit
    joints: PerJoint  # SOUND, STUCK or LIMP


class Observed(Record):
    """What the observer believes between two velocity readings."""

    v: Three  # m/s, NED
    d: Three  # m/s^2, NED, disturbance acceleration
    disturbance_bias: Two  # m/s^2, horizontal part of d that stays: wind
    recent: float  # m/s^2, largest horizontal d of late: at once up, slowly down
    known: Three  # m/s^2, NED, part of d that a surface gives which the tool presses on


class Joints(Record):
    """What the joint loops carry from tick to tick."""

    reference: PerJoint  # rad, of the last tick
    reference_rate: PerJoint  # rad/s, of the last tick
    momentum: PerJoint  # N m s, as the observer believes
    disturbance: PerJoint  # N m, as the observer believes
    integral: PerJoint  # rad s, of the errors


class Pressing(Record):
    """What the tool does at a surface that it may touch (``fsw/autopilot/control/press.py``)."""

    near: int  # 1: there is one within reach; else all that follows is 0
    contact: int  # 1: the tool is pressed on it
    normal: Three  # out of the surface, NED
    zone: int  # its number in the safe set
    distance: float  # m, of the tool's ball to the surface
    moved: float  # m, along its normal, from where it was announced to where it was felt
    surface_speed: float  # m/s, of the surface along the normal
    most: float  # N
    stiffness: float  # N/m, at most
    dissipation: float  # s/m
    friction: float
    momentum: PerJoint  # N m s, as the observer believes
    external: PerJoint  # N m, on each joint from outside of the model
    force: Three  # N, NED, on the tool, observed
    pressed: float  # N, of that along the normal
    unsure: float  # N, by which that may be wrong
    mass: float  # kg, of the tool along the normal
    held_mass: float  # kg, the same of one that friction holds on the surface
    stroke: float  # share of a force that the arm gives, less where it is nearly straight
    speed: float  # m/s, of the tool into the surface
    mean_speed: float  # m/s, the same of late
    coming: float  # m/s, the most of it in the last ticks
    blow: float  # N, at most, with which the tool has met the surface
    balanced: float  # N along the normal, at most, whose moment about yaw rotors balance
    asked: float  # N, by the plan, as far as all bounds allow
    ramped: float  # N, of that
    commanded: float  # N, what the joints give
    lost_for: float  # s, that it has been asked to press on a surface that it no longer meets
    slip: Three  # m/s, NED, mean speed along the surface
    met: int  # 1: it has been in contact since it was asked to
    along: PerJoint  # m, what each joint moves the tool by along the normal
    share: PerJoint  # 1/m, of each joint's torque in a static force along it
    work: PerJoint
    load: PerJoint  # N m, torques of joints with those of the force on the tool


class Payload(Record):
    """What the gripper holds (``fsw/autopilot/control/payload.py``)."""

    gripped: float  # 1: the gripper is closed
    mass: float  # kg, of what is in it, at the end-effector


FILTER_ACTED: Final = 1  # the safety filter changed the acceleration
GATE_NEEDED: Final = 2  # the command is beyond the actuators' limits, or no number
IMPAIRED: Final = 4  # a part has failed: ``health`` is not that of a healthy vehicle
OFF_PLAN: Final = 8  # the base is out of the tube around the plan
BREACH: Final = 16  # the safety filter saw a margin that is negative, or no number
LIGHT: Final = 32  # the rotors carry so little that what flies would fall


class Watched(Record):
    """What the watch over the actuators knows (``fsw/autopilot/control/actuator_watch.py``)."""

    running: float  # s, since it began
    aloft: int  # the vehicle flies so high that no ground carries it
    thrust: PerRotor  # N, of rotors that give what is commanded
    rate: Three  # rad/s, of the last tick
    torque: Two  # N m about x and y, observed beside the model
    turned: Two  # N m, the same as quickly as rotors of this vehicle are watched
    lift: float  # N, observed the same, beside what lasts
    lasting: float  # share of the thrust that lasts along z
    # Means of products of what is observed, in newtons of a rotor: xx yy zz xy xz yz.
    products: Six
    extra: PerRotor  # N, of each rotor beside its command, by its pattern
    by_thrust: PerRotor  # N^2, of that and the thrust
    thrust2: PerRotor  # N^2, of the thrust
    slow: PerRotor  # N, of rotors that are twice as slow
    slow_torque: Two  # N m about x and y, what they would leave
    slow_by: float  # N^2, mean of what they would leave and what is observed
    slow2: float  # N^2, mean square of what they would leave
    suspect: int  # rotor, or NO_ROTOR
    suspected: float  # s, for how long
    failed: int  # rotor, or NO_ROTOR
    effect: float  # thrust over command, of the failed rotor, as allocation takes it
    failed2: float  # N^2, mean square of what it gives beside its command, by what turns
    failed_by_thrust: float  # N^2, mean of that and the thrust
    failed_thrust2: float  # N^2, of the thrust
    failed_more2: float  # N^2, mean square of what it gives too much
    gives: float  # N, of the failed rotor
    lost_for: float  # s
    others_lost_for: PerRotor  # s, of each rotor beside the failed one
    lost: int
    disobeys: int
    quiet_for: float  # s
    # Joints.
    arm_seen: float  # s, since encoders tell its angles
    momentum: PerJoint  # N m s
    undone: PerJoint  # N m, observed beside the model
    asked: PerJoint  # N m, as late as that
    odd2: float  # N^2 m^2, mean square of what base and arm do not feel of each other
    undone2: PerJoint  # means of squares, and of the product
    asked2: PerJoint
    undoing: PerJoint
    rate2: PerJoint  # rad^2/s^2
    behind2: PerJoint  # rad^2, mean square of the distance from the reference
    unseen: PerJoint  # rad, by which it must have moved unseen to hold a tool in contact
    yielding2: PerJoint  # rad^2/s^2, mean square of the rate that it had to have, seen or not
    stands_for: PerJoint  # s, that it has not had any of that
    joint_for: PerJoint  # s, for how long it has been suspected
    joint: PerJoint  # SOUND, STUCK or LIMP
    stood_at: PerJoint  # rad, where it was found stuck


_Vectors = Annotated[Floats, 3 * JOINTS]
_Rotations = Annotated[Floats, 9 * JOINTS]
_Matrix = Annotated[Floats, JOINTS * JOINTS]
_Sums = Annotated[Floats, 21 * JOINTS]


class Multibody(Record):
    """The vehicle in one pose and motion, in B about its origin; made anew where that is another.

    The mass matrix's blocks are named by their rows and columns: v, w and q.
    """

    of: Annotated[Floats, 4 + 2 * JOINTS]  # the base's rate, the joints' angles and rates, carried
    carried: float  # kg, at the end-effector, beside the vehicle's own

    rotation: _Rotations  # from the link's frame to B
    origin: _Vectors  # m, of the joint
    axis: _Vectors  # unit
    rate: _Vectors  # rad/s, of the link, inertial
    speed: _Vectors  # m/s, of the joint's origin, beside the base's
    of_link: _Sums  # what of a link is summed from the tip to the base
    centre: Three  # m, centre of mass of the vehicle
    vq: _Vectors  # kg m, (3,) a joint
    wq: _Vectors  # kg m^2, (3,) a joint
    qq: _Matrix  # kg m^2
    bias_v: Three  # N
    bias_w: Three  # N m
    bias: PerJoint  # N m
    momentum: PerJoint  # N m s, generalised
    drift: PerJoint  # N m, what changes it beside torques and the field
    # After the elimination.
    inertia: Nine  # kg m^2, J
    inverse: Nine  # of J
    reaction: _Vectors  # (3,) N m a N m of a joint, R
    swing: Nine  # m, velocity of the centre of mass over rate of a base with drives that are free
    wq_free: _Vectors  # kg m^2, as ``wq``, about the centre of mass: of a base that moves freely
    qq_free: _Matrix  # kg m^2, as ``qq``, the same
    factor: _Matrix  # Cholesky's of ``qq_free``
    work: PerJoint


class ArmTask(Record):
    """What the arm is to do, and what it takes to find that out; made anew in each tick.

    Coordinates are those of ``model/arm_coordinates.py``.
    """

    q: PerJoint  # rad, wanted of the joints
    qd: PerJoint  # rad/s, the same
    c: PerJoint  # rad, coordinates
    rate: PerJoint  # rad/s, the same
    goal: PerJoint  # rad
    rotation: _Rotations  # from the link's frame to B
    origin: _Vectors  # m, B, of each joint
    axis: _Vectors  # unit, B
    jacobian: _Vectors  # (3,) m a coordinate: what moves the end-effector in B
    tip: Three  # m, B, end-effector
    gram: _Matrix
    factor: _Matrix
    slope: PerJoint
    swung: PerJoint  # m^2/rad^2, how much farther a coordinate moves a joint than the end-effector
    low: PerJoint
    high: PerJoint
    step: PerJoint


class Mixer(Record):
    """What allocation and the watch reckon with; made anew wherever it is needed."""

    low: PerRotor  # N, least and most that the rotor can give
    top: PerRotor
    share: Annotated[Floats, 4 * ROTORS]  # N a N m of roll and pitch, a N of thrust, a N m of yaw
    mean: PerRotor  # N
    off: PerRotor  # N
    gram: _Matrix
    factor: _Matrix
    work: PerJoint


class Tick(Record):
    """The whole state of the fast loop."""

    estimate: Estimate
    plan: PlanState  # where the running plan wants the vehicle now
    u: Accelerations  # the plan's input
    has_estimate: int  # 1: there has been one
    has_plan: int  # 1: there is a plan's state
    rotor_count: int  # of the vehicle
    joint_count: int  # of the vehicle
    sent: Sent  # the last command; after a tick its own, which the safety gate has yet to pass
    rotors: PerRotor  # N, where the rotor model says they are
    mass: float  # kg, weighed in flight
    observed: Observed
    attitude: Three  # rad s, integrals
    height: float  # m s, integral
    joints: Joints
    off_plan: float  # m, largest deviation of late
    health: Health  # what has been found out about rotors and joints
    watch: Watched
    margin: float  # m, the least one that the safety filter saw in this tick
    flags: int  # what happened in this tick
    # What is flown: the plan's state and input, changed by the safety filter.
    flown: PlanState
    flown_u: Accelerations
    wanted: Sent  # what the loops ask for, until it is sent
    bodies: Multibody  # of the estimate
    mixer: Mixer
    arm: ArmTask
    pressing: Pressing
    payload: Payload

    @property
    def actuator_command(self) -> ActuatorCommand:
        """The last command, ``sent``."""
        found: Any = _COUNTED_COMMAND.unpack_from(self.memory, _COUNTS_AT)
        rotors, joints = 2 + found[0], 2 + ROTORS + found[1]
        return ActuatorCommand(found[2:rotors], found[2 + ROTORS : joints])

    @actuator_command.setter
    def actuator_command(self, command: ActuatorCommand) -> None:
        thrust, torque = padded(command.rotor_thrust, ROTORS), padded(command.joint_torque, JOINTS)
        _COMMAND.pack_into(self.memory, _SENT_AT, *thrust, *torque)

    @property
    def stamp_us(self) -> int:
        """The time of the estimate [us]."""
        return int(_WHOLE.unpack_from(self.memory, 0)[0])

    @property
    def down(self) -> float:
        """The third of the estimate's position [m, NED]."""
        return float(_ONE.unpack_from(self.memory, _DOWN_AT)[0])

    @property
    def upright(self) -> float:
        """The cosine of the estimate's tilt [1]."""
        return float(_ONE.unpack_from(self.memory, _UPRIGHT_AT)[0])

    @property
    def wind(self) -> Vec2:
        """What lasts of the disturbance [m/s^2, NED]."""
        north, east = _TWO.unpack_from(self.memory, _WIND_AT)
        return north, east

    @property
    def touches(self) -> bool:
        """Whether the tool is at something or asked to be, or holds something."""
        (contact,) = _WHOLE.unpack_from(self.memory, _CONTACT_AT)
        (asked,) = _ONE.unpack_from(self.memory, _ASKED_AT)
        (gripped,) = _ONE.unpack_from(self.memory, _GRIPPED_AT)
        return bool(contact or asked > 0.0 or gripped > 0.0)

    @property
    def joint_reference(self) -> JointVector:
        """What the joints were asked for (j,) [rad]."""
        return _JOINTS.unpack_from(self.memory, _REFERENCE_AT)[: self.joint_count]

    @property
    def state_estimate(self) -> StateEstimate | None:
        """The ``estimate``; None: there has been none yet."""
        known, _, _, joints = _HEAD.unpack_from(self.memory, _HEAD_AT)
        return estimate_in(self, 0, joints) if known else None

    @state_estimate.setter
    def state_estimate(self, x: StateEstimate) -> None:
        self.has_estimate = 1
        t_us, p, v, R, w, yaw, q, qd, force = x
        known = _ESTIMATES[len(q)]
        known.pack_into(self.memory, 0, t_us, *p, *v, *R, *w, yaw, *q, *qd, force)

    @property
    def plan_state(self) -> PredictionState | None:
        """The ``plan``'s state; None: there is none."""
        _, planned, _, joints = _HEAD.unpack_from(self.memory, _HEAD_AT)
        if not planned:
            return None
        n: Any = _PLAN.unpack_from(self.memory, _PLAN_AT)
        p, v, a, j, s = n[:3], n[3:6], n[6:9], n[9:11], n[11:13]
        q, qd = n[15 : 15 + joints], n[15 + JOINTS : 15 + JOINTS + joints]
        return PredictionState(p, v, a, j, s, n[13], n[14], q, qd)

    @plan_state.setter
    def plan_state(self, x: PredictionState | None) -> None:
        self.has_plan = int(x is not None)
        if x is not None:
            p, v, a, j, s, yaw, rate, q, qd = x
            arm = *padded(q, JOINTS), *padded(qd, JOINTS)
            _PLAN.pack_into(self.memory, _PLAN_AT, *p, *v, *a, *j, *s, yaw, rate, *arm)

    @property
    def plan_input(self) -> PlanInput:
        """The plan's input, ``u``."""
        n: Any = _INPUT.unpack_from(self.memory, _INPUT_AT)
        push = n[4 + JOINTS : 7 + JOINTS]
        return PlanInput(n[:3], n[3], n[4 : 4 + self.joint_count], push, n[-1])

    @plan_input.setter
    def plan_input(self, u: PlanInput) -> None:
        arm = padded(u.qdd_arm, JOINTS)
        _INPUT.pack_into(self.memory, _INPUT_AT, *u.a, u.yaw_acc, *arm, *u.push, u.force)

    def take_given(self, other: Tick) -> None:
        """Take estimate, plan and input of another one."""
        self.memory[:_SENT_AT] = other.memory[:_SENT_AT]


def estimate_in(record: Record, at: int, joints: int) -> StateEstimate:
    """The ``Estimate`` ``at`` [byte] of a record, of a vehicle of so many ``joints``."""
    x: Any = _ESTIMATES[joints].unpack_from(record.memory, at)
    p, v, R, w = x[1:4], x[4:7], x[7:16], x[16:19]
    q, qd = x[20 : 20 + joints], x[20 + joints : -1]
    return StateEstimate(x[0], p, v, R, w, x[19], q, qd, x[-1])


class Expected(Record):
    """What commands and loops tell the filter of a tick (``Cascade.expected``); zeros: nothing."""

    u: PerJoint  # rad/s^2, what torques make of the joints
    model: Four  # rad/s^2 (3,) and m/s^2, FRD: what rotors make of the vehicle; 0: not known
    pushed: Three  # m/s^2, NED: what surfaces that the tool touches make of it besides
    # Of each joint, for the watch over its encoder (estimation/faults/encoder_watch.py).
    undone: PerJoint  # N m, what acts against its torque
    unseen: PerJoint  # rad, by which it must have moved unseen to hold a tool on a surface
    felt: PerJoint  # share of what acts against it that is felt nearer to the base
    judges: int  # NOT_WATCHED, BEGINS_ANEW or JUDGES


NOT_WATCHED, BEGINS_ANEW, JUDGES = 0, 1, 2  # what the watch over the encoders does
NO_ROTOR: Final = -1
_ESTIMATES: Final = [struct.Struct(f"<q19d{2 * per_joint(n)}d") for n in range(JOINTS + 1)]
_PLAN: Final = struct.Struct(f"<{15 + 2 * JOINTS}d")
_INPUT: Final = struct.Struct(f"<{4 + JOINTS + 4}d")
_COMMAND: Final = struct.Struct(f"<{ROTORS + JOINTS}d")
_COUNTED_COMMAND: Final = struct.Struct(f"<2q{ROTORS + JOINTS}d")  # rotor_count, joint_count, sent
_JOINTS: Final = struct.Struct(f"<{JOINTS}d")
_HEAD: Final = struct.Struct("<4q")  # has_estimate, has_plan, rotor_count, joint_count
_WHOLE: Final = struct.Struct("<q")
_ONE: Final = struct.Struct("<d")
_TWO: Final = struct.Struct("<2d")


_DOWN_AT: Final = Tick.place("estimate", "p_WB") + 2 * 8
_UPRIGHT_AT: Final = Tick.place("estimate", "R_WB") + 8 * 8
_PLAN_AT: Final = Tick.place("plan")
_INPUT_AT: Final = Tick.place("u")
_SENT_AT: Final = Tick.place("sent")
_HEAD_AT: Final = Tick.place("has_estimate")
_COUNTS_AT: Final = Tick.place("rotor_count")
_WIND_AT: Final = Tick.place("observed", "disturbance_bias")
_REFERENCE_AT: Final = Tick.place("joints", "reference")
_CONTACT_AT: Final = Tick.place("pressing", "contact")
_ASKED_AT: Final = Tick.place("pressing", "asked")
_GRIPPED_AT: Final = Tick.place("payload", "gripped")


def new_tick(mass: float, rotors: int, joints: int) -> Tick:
    """One in which nothing is known yet, of a healthy vehicle of ``mass`` [kg]."""
    r = Tick()
    r.rotor_count, r.joint_count = rotors, joints
    r.mass, r.margin = mass, math.inf
    r.health.effectiveness[:], r.health.most[:] = 1.0, math.inf
    r.observed.recent = _NOT_KNOWN
    watch_anew(r.watch)
    return r


def watch_anew(s: Watched) -> None:
    """Begin a watch that knows of nothing."""
    s.numbers[:] = 0.0
    s.suspect = s.failed = NO_ROTOR
    s.effect = 1.0


_NOT_KNOWN: Final = 1.0  # m/s^2; nothing was observed yet, and what is to come may be large
