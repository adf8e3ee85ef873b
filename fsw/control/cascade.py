"""One fast cycle: from the plan and the estimate to rotors and joints."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fsw.barriers.safe_approach import BarrierTuning
from fsw.compiled import compilable, compiled, kernel, machine_code, packed
from fsw.control.allocation import allocate
from fsw.control.arm_compensation import compensated_joints, lately_off_plan
from fsw.control.attitude import attitude_pid, attitude_reference
from fsw.control.gains import LoopGains, tracking_gains
from fsw.control.height import height_pid
from fsw.control.joint_reference import joint_reference
from fsw.control.joints import (
    JointMemory,
    accelerations_of,
    arm_dynamics,
    joint_torques,
    joints_at_rest,
    observe_disturbance,
    torques_of_failed,
)
from fsw.control.pid import PidGains
from fsw.control.safety_filter import (
    FilterLaw,
    FilterTuning,
    filter_law,
    filter_probes,
    filtered,
)
from fsw.control.tilt_limit import limited_turn
from fsw.control.tracking import (
    Observed,
    TrackingLaw,
    follow_plan,
    observe,
    velocity_of_mass,
    wanted_accelerations,
)
from fsw.frozen import made
from fsw.geometry.rotation import rotate_back, wrap_angle
from fsw.geometry.vectors import add_scaled, clamp_magnitude, subtract
from fsw.model.actuator_health import (
    HEALTHY,
    SOUND,
    ActuatorHealth,
    commanded_for,
    given,
)
from fsw.model.airframe import GRAVITY, Airframe
from fsw.model.body import Body, body_of
from fsw.model.nominal import REST_INPUT, REST_STATE
from fsw.model.rotors import (
    MotionState,
    estimate_mass,
    hanging_arm,
    lag_rotors,
    motion_state,
    rotor_decay,
)
from fsw.shapes.zones import NO_ZONES
from fsw.signals import (
    STOPPED,
    ActuatorCommand,
    Mat3,
    PlanInput,
    PredictionState,
    StateEstimate,
    Vec2,
    Vec3,
    Vec4,
)

Inner = Literal["tracking", "pid"]
Guarded = tuple[bool, float]
"""Whether the safety filter changed the acceleration, and the least margin that it saw [m]."""
UNGUARDED: Guarded = (False, math.inf)
Model = Vec4
"""What rotors make of it: angular accelerations [rad/s^2, FRD], thrust over mass [m/s^2]."""

_NONE: Vec3 = (0.0, 0.0, 0.0)
_LEVEL: Mat3 = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
_SOMEWHERE = StateEstimate(0, _NONE, _NONE, _LEVEL, _NONE, 0.0, (0.0, 0.0), (0.0, 0.0))


class CascadeMemory(NamedTuple):
    """What the fast loops carry from tick to tick."""

    rotors: Vec4  # N, where the rotor model says they are
    commanded: ActuatorCommand  # what was sent last tick, after the safety gate
    observed: Observed
    mass: float  # kg, weighed in flight
    attitude: Vec3 = (0.0, 0.0, 0.0)  # rad s, integrals
    height: float = 0.0  # m s, integral
    joints: JointMemory = JointMemory((0.0, 0.0), (0.0, 0.0))
    off_plan: float = 0.0  # m, largest deviation of late
    health: ActuatorHealth = HEALTHY  # what has been found out about rotors and joints

    def after_sending(self, sent: ActuatorCommand) -> CascadeMemory:
        """The memory for the next tick, once the safety gate has decided."""
        return self if sent is self.commanded else self._replace(commanded=sent)


def at_rest(airframe: Airframe, estimate: StateEstimate) -> CascadeMemory:
    """Memory of a vehicle whose rotors stand still."""
    return CascadeMemory(
        STOPPED.rotor_thrust,
        STOPPED,
        Observed(estimate.v_WB, _NONE),
        airframe.mass,
        joints=joints_at_rest(airframe, estimate),
    )


def in_hover(airframe: Airframe, estimate: StateEstimate) -> CascadeMemory:
    """Memory of a vehicle taken over in hover."""
    each = 0.25 * airframe.mass * GRAVITY
    thrust = (each, each, each, each)
    return CascadeMemory(
        thrust,
        ActuatorCommand(thrust, (0.0, 0.0)),
        Observed(estimate.v_WB, _NONE),
        airframe.mass,
        joints=joints_at_rest(airframe, estimate),
    )


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
    tuning: LoopGains
    tracking: TrackingLaw
    follows_plan: bool  # or only the plan's acceleration
    filter: FilterLaw
    rotor_decay: float  # share of a rotor's error left after a tick
    dt: float  # s, tick length


class Cascade:
    """The inner loops of one configuration; laws are pure, memory goes in and comes out."""

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
        self.law = CascadeLaw(
            airframe,
            tuning,
            TrackingLaw(airframe.attitude_lag, tuning.tracking, gains),
            inner == "tracking",
            filter_law(
                clear.tuning,
                clear.barriers,
                airframe.link_length,
                gains.k[3] / gains.k[2],
                tuning.tracking.acceleration_limit,
                clear.speed,
            ),
            rotor_decay(airframe, dt),
            dt,
        )
        self.probes = filter_probes(clear.body)
        self.packed = packed(self.law)
        memory = CascadeMemory(STOPPED.rotor_thrust, STOPPED, Observed(_NONE, _NONE), 1.0)
        around = (NO_ZONES, self.probes)
        example = (self.packed, memory, _SOMEWHERE, REST_STATE, REST_INPUT, 1, *around)
        self._close_loops = machine_code(_close_loops, *example)
        sent = memory.rotors, STOPPED.rotor_thrust, STOPPED.joint_torque
        arm = _SOMEWHERE.w_WB_B, _SOMEWHERE.q_arm, _SOMEWHERE.qd_arm, _SOMEWHERE.specific_force
        self._expected = machine_code(_expected, self.packed, *sent, *arm, 1.0)

    def motion(self, memory: CascadeMemory, estimate: StateEstimate) -> MotionState:
        """Acceleration to snap right now, from the rotor model."""
        rotors = lag_rotors(memory.rotors, _settling_at(memory), self.law.rotor_decay)
        return motion_state(
            self.law.airframe, memory.mass, estimate, rotors, memory.commanded.joint_torque[0]
        )

    def expected(self, memory: CascadeMemory, estimate: StateEstimate) -> tuple[Vec2, Model]:
        """What the commands sent last make of the joints [rad/s^2] and of the vehicle."""
        return self._expected(
            self.packed,
            memory.rotors,
            _settling_at(memory),
            memory.commanded.joint_torque,
            estimate.w_WB_B,
            estimate.q_arm,
            estimate.qd_arm,
            estimate.specific_force,
            memory.mass,
        )

    def joint_acceleration(self, memory: CascadeMemory, estimate: StateEstimate) -> Vec2:
        """The joints' part of ``expected`` [rad/s^2]."""
        return self.expected(memory, estimate)[0]

    def step(
        self,
        memory: CascadeMemory,
        estimate: StateEstimate,
        plan: PredictionState,
        u: PlanInput,
        ticks: int = 1,
        zones: NDArray[np.float64] = NO_ZONES,
    ) -> tuple[ActuatorCommand, CascadeMemory, Guarded]:
        """See ``close_loops``, of which this is the machine code; ``zones`` (zones, k) [SI]."""
        sent, rotors, believed, mass, integrals, joints, off_plan, guarded = self._close_loops(
            self.packed, memory, estimate, plan, u, ticks, zones, self.probes
        )
        command = made(ActuatorCommand, sent)
        moved = made(Observed, believed), mass, *integrals, made(JointMemory, joints), off_plan
        kept = made(CascadeMemory, (rotors, command, *moved, memory.health))
        return command, kept, guarded


@compilable
def close_loops(
    law: CascadeLaw,
    memory: CascadeMemory,
    estimate: StateEstimate,
    plan: PredictionState,
    u: PlanInput,
    ticks: int,
    zones: NDArray[np.float64],
    probes: NDArray[np.float64],
) -> tuple[ActuatorCommand, CascadeMemory, Guarded]:
    """One tick, or several at once where some were missed.

    Returns the actuator command, not yet gated, the memory to pass back after sending, and what the
    safety filter found: about the ``zones`` (zones, k) [SI] of ``moving_zones``, for the ``probes``
    (probes, 12) [SI] of ``filter_probes``.
    """
    airframe, tuning, dt = law.airframe, law.tuning, law.dt
    rotors, observed, health = memory.rotors, memory.observed, memory.health
    settling_at = given(health, memory.commanded.rotor_thrust)
    sound = health.joints[0] == SOUND and health.joints[1] == SOUND
    for _ in range(ticks):
        rotors = lag_rotors(rotors, settling_at, law.rotor_decay)
    mass = estimate_mass(airframe, memory.mass, rotors, estimate.specific_force, dt * ticks)
    motion = motion_state(airframe, mass, estimate, rotors, memory.commanded.joint_torque[0])
    arm = hanging_arm(airframe, estimate.q_arm)
    v = velocity_of_mass(estimate, arm.depth)
    for _ in range(ticks):
        observed = observe(observed, v, motion.a, tuning.tracking, dt)
    attitude, height, guarded = memory.attitude, memory.height, (False, math.inf)
    if zones.shape[0] > 0 and law.filter.tuning.enabled > 0:
        plan, u, guarded = _kept_off(law, zones, probes, estimate, motion, observed, plan, u)
    if law.follows_plan:
        (wdx, wdy), thrust = follow_plan(
            law.tracking, mass, arm.depth, estimate, motion, observed, plan, u
        )
        wdz = u.yaw_acc + _yaw_correction(tuning.yaw, estimate, plan)
        roll_inertia = arm.roll_inertia
    else:
        (wdx, wdy, wdz), attitude = attitude_pid(
            tuning.attitude, attitude, estimate, attitude_reference(u.a, plan.yaw), dt
        )
        roll_inertia = airframe.inertia[0]  # the paper's loop knows no arm
        thrust, height = height_pid(airframe, tuning.height, height, estimate, plan, u, dt)
    wdx, wdy, wdz = limited_turn(airframe, estimate, motion.turning, (wdx, wdy, wdz))
    wanted, off_plan = (plan.q_arm, plan.qd_arm), memory.off_plan
    if law.follows_plan and tuning.compensate and sound:
        off_plan = lately_off_plan(tuning.compensation, off_plan, estimate, plan, dt * ticks)
        wanted = compensated_joints(
            airframe, tuning.compensation, tuning.joint_limits, off_plan, estimate, plan
        )
    last = memory.joints.reference, memory.joints.reference_rate
    q_ref, qd_ref = joint_reference(airframe, tuning.joint_limits, last, wanted, dt * ticks)
    dynamics = arm_dynamics(airframe, estimate, _field(estimate, motion.thrust / mass, observed.d))
    arm_memory = memory.joints
    for _ in range(ticks):
        arm_memory = observe_disturbance(arm_memory, dynamics, memory.commanded.joint_torque, dt)
    joints, arm_memory = joint_torques(
        airframe,
        tuning.joint,
        arm_memory,
        estimate,
        (q_ref, qd_ref, u.qdd_arm),
        dynamics,
        motion.turning[1],  # not what is commanded: the rotors take 40 ms to give it
        dt,
    )
    if not sound:
        joints = torques_of_failed(airframe, health.joints, joints, dynamics, motion.turning[1])
    torque = _body_torque(airframe, roll_inertia, estimate, (wdx, wdy, wdz), joints[0])
    thrusts = allocate(airframe, torque, thrust, tuning.yaw_thrust_limit, health)
    command = ActuatorCommand(commanded_for(health, thrusts), joints)
    memory = CascadeMemory(
        rotors, command, observed, mass, attitude, height, arm_memory, off_plan, health
    )
    return command, memory, guarded


@compilable
def _kept_off(
    law: CascadeLaw,
    zones: NDArray[np.float64],
    probes: NDArray[np.float64],
    estimate: StateEstimate,
    motion: MotionState,
    observed: Observed,
    plan: PredictionState,
    u: PlanInput,
) -> tuple[PredictionState, PlanInput, Guarded]:
    """The plan's state and input, changed such that the loops ask for a filtered acceleration."""
    asked = u.a
    if law.follows_plan:
        asked = wanted_accelerations(law.tracking, estimate, motion, observed, plan, u)
    level = law.filter.level
    wanted = (
        clamp_magnitude(asked[0], level),
        clamp_magnitude(asked[1], level),
        asked[2],
    )
    a = add_scaled(motion.a, observed.d, 1.0)
    safe, changed, margin = filtered(law.filter, probes, zones, estimate, observed.v, a, wanted)
    if not changed:
        return plan, u, (False, margin)
    dx, dy, dz = subtract(safe, asked)
    moved = PredictionState(
        plan.p,
        plan.v,
        (plan.a[0] + dx, plan.a[1] + dy, plan.a[2]),
        plan.j,
        plan.s,
        plan.yaw,
        plan.yaw_rate,
        plan.q_arm,
        plan.qd_arm,
    )
    a_d = (u.a[0] + dx, u.a[1] + dy, u.a[2] + dz)
    return moved, PlanInput(a_d, u.yaw_acc, u.qdd_arm), (True, margin)


@compiled
def _close_loops(
    law: NDArray[Any],
    memory: CascadeMemory,
    estimate: StateEstimate,
    plan: PredictionState,
    u: PlanInput,
    ticks: int,
    zones: NDArray[np.float64],
    probes: NDArray[np.float64],
) -> tuple[
    tuple[Vec4, Vec2],
    Vec4,
    tuple[Vec3, Vec3, Vec2, float],
    float,
    tuple[Vec3, float],
    tuple[Vec2, Vec2, Vec2, Vec2, Vec2],
    float,
    Guarded,
]:
    """``close_loops`` that returns plain tuples, which leave machine code at half the cost."""
    command, kept, guarded = close_loops(law[0], memory, estimate, plan, u, ticks, zones, probes)
    return (
        (command.rotor_thrust, command.joint_torque),
        kept.rotors,
        (
            kept.observed.v,
            kept.observed.d,
            kept.observed.disturbance_bias,
            kept.observed.recent,
        ),
        kept.mass,
        (kept.attitude, kept.height),
        (
            kept.joints.reference,
            kept.joints.momentum,
            kept.joints.disturbance,
            kept.joints.integral,
            kept.joints.reference_rate,
        ),
        kept.off_plan,
        guarded,
    )


@kernel
def _expected(
    laws: NDArray[Any],
    rotors: Vec4,
    commanded: Vec4,
    torque: Vec2,
    rate: Vec3,
    q_arm: Vec2,
    qd_arm: Vec2,
    specific_force: float,
    mass: float,
) -> tuple[Vec2, Model]:
    """Of the numbers that it needs alone: to hand over whole records takes longer than all else."""
    airframe = laws[0].airframe
    f = lag_rotors(rotors, commanded, laws[0].rotor_decay)
    rolling = airframe.rotor_arm * (f[1] - f[3]) / hanging_arm(airframe, q_arm).roll_inertia
    yawing = airframe.yaw_per_thrust * (f[0] - f[1] + f[2] - f[3]) / airframe.inertia[2]
    pitching = (airframe.rotor_arm * (f[2] - f[0]) - torque[0]) / airframe.inertia[1]
    arm = StateEstimate(0, _NONE, _NONE, _LEVEL, rate, 0.0, q_arm, qd_arm, specific_force)
    # The accelerometer knows of gusts, and of the ground.
    dynamics = arm_dynamics(airframe, arm, (0.0, specific_force))
    carried = airframe.joint_armature * pitching
    first, second = accelerations_of(dynamics, (torque[0] + carried, torque[1]))
    model = rolling, pitching, yawing, (f[0] + f[1] + f[2] + f[3]) / mass
    return (first - pitching, second), model


def _settling_at(memory: CascadeMemory) -> Vec4:
    """Thrust [N] of each rotor that the command sent last leads to."""
    commanded = memory.commanded.rotor_thrust
    return commanded if memory.health is HEALTHY else given(memory.health, commanded)


@compilable
def _yaw_correction(gains: PidGains, estimate: StateEstimate, plan: PredictionState) -> float:
    error = wrap_angle(plan.yaw - estimate.yaw)
    raw = gains.kp * error + gains.kd * (plan.yaw_rate - estimate.w_WB_B[2])
    return clamp_magnitude(raw, gains.limit)


@compilable
def _field(estimate: StateEstimate, specific_thrust: float, d: Vec3) -> Vec2:
    """Gravity minus the base's acceleration [m/s^2] along body x and z."""
    pushed_x, _, pushed_z = rotate_back(estimate.R_WB, d)
    return -pushed_x, specific_thrust - pushed_z


@compilable
def _body_torque(
    airframe: Airframe,
    roll_inertia: float,
    estimate: StateEstimate,
    wd: Vec3,
    joint1_torque: float,
) -> Vec3:
    """Rotor torque for an angular acceleration: inertia, gyroscopic part, arm's reaction."""
    inertia = airframe.inertia
    ix, iy, iz = inertia[0], inertia[1], inertia[2]
    wx, wy, wz = estimate.w_WB_B
    return (
        roll_inertia * wd[0] + (iz - iy) * wy * wz,
        iy * wd[1] + (ix - iz) * wz * wx + joint1_torque,
        iz * wd[2] + (iy - ix) * wx * wy,
    )
