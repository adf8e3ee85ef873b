"""One fast cycle: from the plan and the estimate to rotors and joints."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal

from numpy.typing import NDArray

from fsw.autopilot.barriers.safe_approach import BarrierTuning
from fsw.autopilot.control.actuator_watch import felt_inside
from fsw.autopilot.control.allocation import allocate, authority_left
from fsw.autopilot.control.arm_compensation import compensate, lately_off_plan
from fsw.autopilot.control.gains import LoopGains, tracking_gains
from fsw.autopilot.control.joint_reference import refer
from fsw.autopilot.control.joints import (
    accelerate_joints,
    joint_torques,
    observe_contact,
    observe_disturbance,
    rest_joints,
    torques_of_failed,
)
from fsw.autopilot.control.payload import let_go, weigh_payload
from fsw.autopilot.control.pid import attitude_pid, attitude_reference, height_pid
from fsw.autopilot.control.press import look_for_surface, weigh_tool
from fsw.autopilot.control.safety_filter import (
    FilterLaw,
    FilterProbes,
    FilterTuning,
    filter_law,
    filter_probes,
    filtered,
)
from fsw.autopilot.control.tilt_limit import limited_turn
from fsw.autopilot.control.tracking import (
    TrackingLaw,
    follow_plan,
    observe,
    velocity_of_mass,
    wanted_accelerations,
)
from fsw.autopilot.control.tube import TubeAround, beyond_covered
from fsw.autopilot.geometry.rotation import rotate_back, wrap_angle
from fsw.autopilot.geometry.vectors import add, add_scaled, clamp_magnitude, cross, subtract, three
from fsw.autopilot.model.actuator_health import SOUND
from fsw.autopilot.model.airframe import GRAVITY, Airframe
from fsw.autopilot.model.arm_coordinates import ArmCoordinates, arm_coordinates
from fsw.autopilot.model.body import Body, body_of, reaches, tool_radius
from fsw.autopilot.model.multibody import load_on_base, move_bodies, torque_to_turn
from fsw.autopilot.model.rotors import (
    MotionState,
    estimate_mass,
    is_light,
    lag_rotor,
    load_of_tip,
    motion_state,
    rotor_decay,
)
from fsw.autopilot.shapes.zones import Zones
from fsw.autopilot.signals import Mat3, Setpoint, StateEstimate, Vec3
from fsw.autopilot.tick_record import (
    BEGINS_ANEW,
    BREACH,
    FILTER_ACTED,
    GATE_NEEDED,
    IMPAIRED,
    JUDGES,
    LIGHT,
    OFF_PLAN,
    Expected,
    Tick,
    new_tick,
)
from fsw.compiled import compilable, kernel, machine_code, packed

Inner = Literal["tracking", "pid", "px4"]
_NONE: Vec3 = (0.0, 0.0, 0.0)
_LEVEL: Mat3 = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


def at_rest(airframe: Airframe, estimate: StateEstimate, before: Tick | None = None) -> Tick:
    """Record of a vehicle whose rotors stand still; ``before`` had its plan and its actuators."""
    r = new_tick(airframe.mass, airframe.rotors, airframe.bodies.joints)
    if before is not None:
        r.take_given(before)
        r.watch = before.watch
    r.state_estimate = estimate
    r.observed.v[:] = estimate.v_WB
    rest_joints(r.joints, airframe, estimate)
    return r


def in_hover(airframe: Airframe, estimate: StateEstimate, before: Tick | None = None) -> Tick:
    """Record of a vehicle taken over in hover."""
    r = at_rest(airframe, estimate, before)
    n = airframe.rotors
    r.rotors[:n] = r.sent.rotor_thrust[:n] = airframe.mass * GRAVITY / n
    return r


@dataclass(frozen=True, slots=True)
class KeepClear:
    """What the safety filter keeps off zones, and how."""

    body: Body
    barriers: tuple[BarrierTuning, BarrierTuning] = (BarrierTuning(), BarrierTuning())
    tuning: FilterTuning = field(default_factory=FilterTuning)
    speed: float = math.inf  # m/s, up to which it pushes


@dataclass(frozen=True, slots=True)
class CascadeLaw:
    """Everything the loops need that does not change in flight."""

    airframe: Airframe
    arm: ArmCoordinates
    tuning: LoopGains
    tracking: TrackingLaw
    follows_plan: bool  # or only the plan's acceleration
    filter: FilterLaw
    tool_radius: float  # m, of the ball about the end-effector
    rotor_decay: float  # share of a rotor's error left after a tick
    dt: float  # s, tick length


def cascade_law(
    airframe: Airframe,
    tuning: LoopGains,
    tracking: TrackingLaw,
    clear: KeepClear,
    lag: float,
    dt: float,
    *,
    follows_plan: bool,
) -> CascadeLaw:
    """The laws of a tick of ``dt`` [s], whose loops follow an acceleration with a ``lag`` [s]."""
    level, reach = tracking.tuning.acceleration_limit, reaches(clear.body, airframe.bodies)[0]
    return CascadeLaw(
        airframe,
        arm_coordinates(airframe),
        tuning,
        tracking,
        follows_plan,
        filter_law(clear.tuning, clear.barriers, reach, lag, level, clear.speed),
        tool_radius(body_of("full", airframe)),
        rotor_decay(airframe, dt),
        dt,
    )


class Cascade:
    """The inner loops of one configuration, as ``flight/fast_loop.py`` flies them."""

    def __init__(
        self,
        airframe: Airframe,
        tuning: LoopGains,
        inner: Inner,
        dt: float,
        keep_clear: KeepClear | None = None,
    ) -> None:
        """Choose the inner loop and design its gains for a tick of ``dt`` [s], before flight.

        The loop ``tracking`` follows the plan's state, ``pid`` only its acceleration.
        """
        clear = keep_clear or KeepClear(body=body_of("points", airframe))
        gains = tracking_gains(tuning.tracking, airframe.rotor_lag, dt)
        loop = TrackingLaw(airframe.attitude_lag, tuning.tracking, gains)
        lag, follows = gains.k[3] / gains.k[2], inner == "tracking"
        self.law = cascade_law(airframe, tuning, loop, clear, lag, dt, follows_plan=follows)
        self._load(clear)

    def _load(self, clear: KeepClear) -> None:
        """Make ready what kernels take of the law."""
        self.probes, self.packed = filter_probes(clear.body), packed(self.law)
        self._motion = machine_code(_motion, self.packed, Tick().array)

    def motion(self, r: Tick, estimate: StateEstimate) -> MotionState:
        """Acceleration to snap right now, from the rotor model."""
        now = r.copy()
        now.state_estimate = estimate
        return self._motion(self.packed, now.array)

    def setpoint(self, r: Tick) -> Setpoint | None:
        """What another autopilot is asked for; None: these loops command rotors."""
        return None


@compilable
def close_loops(r: Tick, law: CascadeLaw, ticks: int, zones: Zones, probes: FilterProbes) -> None:
    """One tick, or several at once where some were missed: from estimate and plan to a command.

    Each law writes what those after it read; ``sent`` is the last command until the end, where the
    new one takes its place, not yet gated. The safety filter keeps the ``probes`` off the
    ``zones``, those of ``moving_zones``.
    """
    airframe, tuning, dt = law.airframe, law.tuning, law.dt
    estimate = r.estimate
    settle_rotors(r, law, ticks)
    lift = -rotate_back(estimate.R_WB, r.pressing.force)[2]
    r.mass = estimate_mass(airframe, r.mass, r.rotors, estimate.specific_force, dt * ticks, lift)
    let_go(r)
    move_bodies(r.bodies, airframe.bodies, airframe.joint_armature, estimate)
    look_for_surface(r, airframe.bodies, tuning.press, law.tool_radius, zones, dt * ticks)
    motion = motion_state(airframe, r, r.rotors, r.sent.joint_torque)
    v = velocity_of_mass(estimate, r.bodies.swing)
    for _ in range(ticks):
        observe(r.observed, v, motion.a, tuning.tracking, dt)
    keep_off_zones(r, law, motion, zones, probes)
    if law.follows_plan:
        turn, thrust = turn_to_plan(r, law, motion)
    else:
        turn, thrust = turn_by_pid(r, law)
    left = authority_left(r, airframe)
    turn = limited_turn(airframe, estimate, motion.turning, turn, left)
    refer_joints(r, law, dt * ticks)
    drive_joints(r, law, motion, ticks)
    pushed, turned = load_of_tip(r, airframe.bodies, r.wanted.joint_torque)
    lifted = add(pushed, (0.0, 0.0, -thrust))
    load = subtract(load_on_base(r.bodies, airframe.bodies, lifted, r.pressing.load), turned)
    torque = torque_to_turn(r.bodies, airframe.bodies, turn, load, knows_arm=law.follows_plan)
    surface_yaw = subtract(cross(three(r.bodies.centre, 0), pushed), turned)[2]
    allocate(r, airframe, torque, thrust, tuning.yaw_thrust_limit, surface_yaw)
    send(r, airframe)


@compilable
def settle_rotors(r: Tick, law: CascadeLaw, ticks: int) -> None:
    """Where the rotors are by now. Reads sent, health; writes rotors."""
    for i in range(int(law.airframe.rotors)):
        settling_at = r.health.effectiveness[i] * r.sent.rotor_thrust[i]
        for _ in range(ticks):
            r.rotors[i] = lag_rotor(r.rotors[i], settling_at, law.rotor_decay)


@compilable
def keep_off_zones(
    r: Tick, law: CascadeLaw, motion: MotionState, zones: Zones, probes: FilterProbes
) -> None:
    """What is flown: plan and input such that the loops ask for a filtered acceleration.

    Reads estimate, plan, u, observed; writes flown, flown_u, margin, flags.
    """
    r.flown, r.flown_u = r.plan, r.u
    r.flags, r.margin = r.flags & IMPAIRED, math.inf
    if zones.shape[0] == 0 or not law.filter.tuning.enabled > 0:
        return
    asked = (r.u.a[0], r.u.a[1], r.u.a[2])
    if law.follows_plan:
        asked = wanted_accelerations(law.tracking, r.estimate, motion, r.observed, r.plan, r.u)
    level = law.filter.level
    surface = r.observed.known  # add it: what is filtered is motion, not thrust
    asked = asked[0] + surface[0], asked[1] + surface[1], asked[2] + surface[2]
    wanted = clamp_magnitude(asked[0], level), clamp_magnitude(asked[1], level), asked[2]
    a = add_scaled(motion.a, r.observed.d, 1.0)
    safe, changed = filter_asked(r, law, zones, probes, a, wanted)
    if changed:
        push = subtract(safe, asked)
        for axis in range(2):
            r.flown.a[axis] += push[axis]
        for axis in range(3):
            r.flown_u.a[axis] += push[axis]


@compilable
def filter_asked(
    r: Tick, law: CascadeLaw, zones: Zones, probes: FilterProbes, a: Vec3, asked: Vec3
) -> tuple[Vec3, bool]:
    """The filtered acceleration, and whether it is another than ``asked`` [m/s^2, NED].

    The base accelerates by ``a`` [m/s^2, NED] now. Reads estimate, observed; writes margin, flags.
    """
    safe, changed, margin = filtered(
        law.filter, law.airframe.bodies, probes, zones, r.estimate, r.observed.v, a, asked
    )
    r.margin = margin
    if not margin >= 0.0:
        r.flags |= BREACH
    if changed:
        r.flags |= FILTER_ACTED
    return safe, changed


@compilable
def turn_to_plan(r: Tick, law: CascadeLaw, motion: MotionState) -> tuple[Vec3, float]:
    """Angular acceleration [rad/s^2, FRD] and thrust [N] that follow the plan's state."""
    (x, y), thrust = follow_plan(
        law.tracking, r.mass, r.bodies.swing, r.estimate, motion, r.observed, r.flown, r.flown_u
    )
    gains, plan = law.tuning.yaw, r.flown
    error = wrap_angle(plan.yaw - r.estimate.yaw)
    raw = gains.kp * error + gains.kd * (plan.yaw_rate - r.estimate.w_WB_B[2])
    return (x, y, r.flown_u.yaw_acc + clamp_magnitude(raw, gains.limit)), thrust


@compilable
def turn_by_pid(r: Tick, law: CascadeLaw) -> tuple[Vec3, float]:
    """The same by the paper's loops, of the plan's acceleration. Writes attitude, height."""
    tuning, reference = law.tuning, attitude_reference(r.flown_u.a, r.flown.yaw)
    turn, kept = attitude_pid(tuning.attitude, r.attitude, r.estimate, reference, law.dt)
    for axis in range(3):
        r.attitude[axis] = kept[axis]
    thrust, r.height = height_pid(
        law.airframe, tuning.height, r.height, r.estimate, r.flown, r.flown_u, law.dt
    )
    return turn, thrust


@compilable
def refer_joints(r: Tick, law: CascadeLaw, seconds: float) -> None:
    """The joints' reference, ``seconds`` [s] later. Writes off_plan, arm, joints.reference."""
    airframe, tuning, plan = law.airframe, law.tuning, r.flown
    if law.follows_plan and tuning.compensate and _joints_are_sound(r, airframe):
        limits = tuning.compensation_near if r.pressing.near > 0 else tuning.compensation
        r.off_plan = lately_off_plan(limits, r.off_plan, r.estimate, plan, seconds)
        compensate(
            *(r.arm, airframe.bodies, law.arm, limits, tuning.joint_limits),
            *(r.off_plan, r.estimate, plan),
        )
    else:
        for i in range(int(airframe.bodies.joints)):
            r.arm.q[i], r.arm.qd[i] = plan.q_arm[i], plan.qd_arm[i]
    refer(r.joints, r.arm, airframe, law.arm, tuning.joint_limits, seconds)


@compilable
def drive_joints(r: Tick, law: CascadeLaw, motion: MotionState, ticks: int) -> None:
    """Reads sent, mass, observed, health; writes joints, payload, pressing, observed, wanted."""
    airframe = law.airframe
    # Gravity less the base's acceleration.
    pushed = rotate_back(r.estimate.R_WB, r.observed.d)
    field = -pushed[0], -pushed[1], motion.thrust / r.mass - pushed[2]
    for _ in range(ticks):
        torque = r.sent.joint_torque
        observe_disturbance(r, airframe, torque, field, law.dt)
        observe_contact(r, airframe, torque, field, law.dt)
    weigh_payload(r, airframe, field, law.dt * ticks)
    weigh_tool(r, airframe, law.tuning.press)
    # Not what is commanded: the rotors take their lag to give it.
    joint_torques(
        r, airframe, law.arm, law.tuning.joint, law.tuning.press, field, motion.turning, law.dt
    )
    if not _joints_are_sound(r, airframe):
        torques_of_failed(r, airframe, field, motion.turning)


@compilable
def send(r: Tick, airframe: Airframe) -> None:
    """The new command for what is wanted. Reads health; writes sent, flags."""
    wanted = r.wanted
    for i in range(int(airframe.rotors)):
        r.sent.rotor_thrust[i] = wanted.rotor_thrust[i] / r.health.effectiveness[i]
        if not 0.0 <= r.sent.rotor_thrust[i] <= airframe.rotor_thrust_max[i]:
            r.flags |= GATE_NEEDED
    for j in range(int(airframe.bodies.joints)):
        r.sent.joint_torque[j] = wanted.joint_torque[j]
        most = airframe.joint_torque_max[j]
        if not -most <= wanted.joint_torque[j] <= most:
            r.flags |= GATE_NEEDED


@compilable
def compare_with_plan(r: Tick, tube: TubeAround) -> None:
    """Flag a base that left the plan's tube. Reads estimate, plan, observed; writes flags."""
    bias = r.observed.disturbance_bias
    aside = beyond_covered(tube, (bias[0], bias[1]))
    most = tube.radius + max(aside[0], aside[1]) + tube.unsure
    for i in range(3):
        if not -most <= r.estimate.p_WB[i] - r.plan.p[i] <= most:
            r.flags |= OFF_PLAN


@compilable
def note_weight(r: Tick, airframe: Airframe) -> None:
    """Flag a vehicle that its rotors hardly carry. Reads rotors; writes flags."""
    if is_light(airframe, r.rotors):
        r.flags |= LIGHT


@compilable
def expect_next_tick(
    r: Tick, airframe: Airframe, rotor_decay: float, found: Expected, explains: bool, judged: bool
) -> None:
    """Write what is expected of the next tick, after which ``rotor_decay`` [1] of a lag is left.

    Of a vehicle that stands thrust does not say how it moves: then it ``explains`` nothing.
    Encoders are ``judged`` unless a joint has failed. Reads estimate, sent, rotors, health, watch,
    pressing, observed, payload; writes bodies, mixer.
    """
    for i in range(int(airframe.rotors)):
        settling_at = r.health.effectiveness[i] * r.sent.rotor_thrust[i]
        r.mixer.mean[i] = lag_rotor(r.rotors[i], settling_at, rotor_decay)
    move_bodies(r.bodies, airframe.bodies, airframe.joint_armature, r.estimate)
    motion = motion_state(airframe, r, r.mixer.mean, r.sent.joint_torque)
    # The accelerometer knows of gusts, and of the ground.
    field = 0.0, 0.0, r.estimate.specific_force
    accelerate_joints(r, airframe.bodies, field, motion.turning)
    felt_inside(r, airframe, found.felt)
    for i in range(int(airframe.bodies.joints)):
        found.u[i], found.undone[i] = r.bodies.work[i], r.watch.undone[i]
        found.unseen[i] = r.watch.unseen[i]
    for i in range(3):
        found.pushed[i] = r.observed.known[i]
        found.model[i] = motion.turning[i] if explains else 0.0
    # Not by the mass that is flown: it goes by the accelerometer, which this is a witness against.
    lift = motion.thrust / (airframe.mass + r.payload.mass)
    found.model[3] = lift if explains else 0.0
    found.judges = JUDGES if judged else BEGINS_ANEW


@compilable
def _joints_are_sound(r: Tick, airframe: Airframe) -> bool:
    sound = True
    for i in range(int(airframe.bodies.joints)):
        sound = sound and r.health.joints[i] == SOUND
    return sound


@kernel
def _motion(laws: NDArray[Any], records: NDArray[Any]) -> MotionState:
    law, r = laws[0], records[0]
    settle_rotors(r, law, 1)
    move_bodies(r.bodies, law.airframe.bodies, law.airframe.joint_armature, r.estimate)
    return motion_state(law.airframe, r, r.rotors, r.sent.joint_torque)
