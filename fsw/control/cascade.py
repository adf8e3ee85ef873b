"""One fast cycle: from the plan and the estimate to rotors and joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from fsw.control.allocation import allocate
from fsw.control.arm_compensation import compensated_joints
from fsw.control.attitude import attitude_pid, attitude_reference
from fsw.control.height import height_pid
from fsw.control.inner_tuning import InnerTuning, tracking_gains
from fsw.control.joints import joint_torques
from fsw.control.pid import PidGains
from fsw.control.tracking import Observed, TrackingLaw, follow_plan, observe
from fsw.geometry.rotation import wrap_angle
from fsw.model.airframe import GRAVITY, Airframe
from fsw.model.prediction import LagModel
from fsw.model.rotors import MotionState, lag_rotors, motion_state, rotor_decay, weigh
from fsw.signals import (
    STOPPED,
    ActuatorCommand,
    PlanInput,
    PredictionState,
    StateEstimate,
    Vec2,
    Vec3,
    Vec4,
)

Inner = Literal["tracking", "pid"]

_NONE: Vec3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class CascadeMemory:
    """What the fast loops carry from tick to tick."""

    rotors: Vec4  # N, where the rotor model says they are
    commanded: ActuatorCommand  # what was sent last tick, after the safety gate
    observed: Observed
    mass: float  # kg, weighed in flight
    attitude: Vec3 = (0.0, 0.0, 0.0)  # rad s, integrals
    height: float = 0.0  # m s, integral
    joints: Vec2 = (0.0, 0.0)  # rad s, integrals

    def after_sending(self, sent: ActuatorCommand) -> CascadeMemory:
        """The memory for the next tick, once the safety gate has decided."""
        return CascadeMemory(
            self.rotors, sent, self.observed, self.mass, self.attitude, self.height, self.joints
        )


def at_rest(airframe: Airframe, estimate: StateEstimate) -> CascadeMemory:
    """Memory of a vehicle whose rotors stand still."""
    return CascadeMemory(
        STOPPED.rotor_thrust, STOPPED, Observed(estimate.v_WB, _NONE), airframe.mass
    )


def in_hover(airframe: Airframe, estimate: StateEstimate) -> CascadeMemory:
    """Memory of a vehicle taken over in hover."""
    each = 0.25 * airframe.mass * GRAVITY
    thrust = (each, each, each, each)
    return CascadeMemory(
        thrust, ActuatorCommand(thrust, (0.0, 0.0)), Observed(estimate.v_WB, _NONE), airframe.mass
    )


class Cascade:
    """The inner loops of one configuration; laws are pure, memory goes in and comes out."""

    def __init__(
        self, airframe: Airframe, lag: LagModel, tuning: InnerTuning, inner: Inner, dt: float
    ) -> None:
        """Choose the inner loop and design its gains, before flight.

        Args:
            airframe: The vehicle.
            lag: Attitude model of the plan.
            tuning: Gains of every loop.
            inner: ``tracking`` follows the plan's state, ``pid`` only its acceleration.
            dt: Tick length [s].
        """
        self._airframe = airframe
        self._tuning = tuning
        self._dt = dt
        self._decay = rotor_decay(airframe, dt)
        self._follows_plan = inner == "tracking"
        gains = tracking_gains(tuning.tracking, airframe.rotor_lag, dt)
        self._law = TrackingLaw(airframe, lag, tuning.tracking, gains)

    def motion(self, memory: CascadeMemory, estimate: StateEstimate) -> MotionState:
        """Acceleration to snap right now, from the rotor model."""
        rotors = lag_rotors(memory.rotors, memory.commanded.rotor_thrust, self._decay)
        return motion_state(
            self._airframe, memory.mass, estimate, rotors, memory.commanded.joint_torque[0]
        )

    def step(
        self,
        memory: CascadeMemory,
        estimate: StateEstimate,
        plan: PredictionState,
        u: PlanInput,
        ticks: int = 1,
    ) -> tuple[ActuatorCommand, CascadeMemory]:
        """One tick.

        Args:
            memory: From the last tick.
            estimate: The vehicle now.
            plan: Where the plan wants the vehicle now.
            u: The plan's input now.
            ticks: Ticks since the last call; more than one where some were missed.

        Returns:
            Actuator command, not yet gated, and the memory to pass back after sending.
        """
        airframe, tuning, dt = self._airframe, self._tuning, self._dt
        rotors, observed = memory.rotors, memory.observed
        for _ in range(ticks):
            rotors = lag_rotors(rotors, memory.commanded.rotor_thrust, self._decay)
        mass = weigh(airframe, memory.mass, rotors, estimate.specific_force, dt * ticks)
        motion = motion_state(airframe, mass, estimate, rotors, memory.commanded.joint_torque[0])
        for _ in range(ticks):
            observed = observe(
                observed, estimate.v_WB, motion.a, tuning.tracking.observer_bandwidth, dt
            )
        attitude, height = memory.attitude, memory.height
        if self._follows_plan:
            (wdx, wdy), thrust = follow_plan(self._law, mass, estimate, motion, observed, plan, u)
            wdz = u.yaw_acc + _yaw_correction(tuning.yaw, estimate, plan)
        else:
            (wdx, wdy, wdz), attitude = attitude_pid(
                tuning.attitude, attitude, estimate, attitude_reference(u.a, plan.yaw), dt
            )
            thrust, height = height_pid(airframe, tuning.height, height, estimate, plan, u, dt)
        q_ref, qd_ref = plan.q_arm, plan.qd_arm
        if self._follows_plan and tuning.compensate:
            q_ref, qd_ref = compensated_joints(airframe, tuning.compensation, estimate, plan)
        joints, kept = joint_torques(
            airframe,
            tuning.joint,
            memory.joints,
            estimate,
            (q_ref, qd_ref, u.qdd_arm),
            motion.thrust / mass,
            wdy,
            dt,
        )
        torque = _body_torque(airframe, estimate, (wdx, wdy, wdz), joints[0])
        command = ActuatorCommand(
            allocate(airframe, torque, thrust, tuning.yaw_thrust_limit), joints
        )
        return command, CascadeMemory(rotors, command, observed, mass, attitude, height, kept)


def _yaw_correction(gains: PidGains, estimate: StateEstimate, plan: PredictionState) -> float:
    error = wrap_angle(plan.yaw - estimate.yaw)
    raw = gains.kp * error + gains.kd * (plan.yaw_rate - estimate.w_WB_B[2])
    return min(max(raw, -gains.limit), gains.limit)


def _body_torque(
    airframe: Airframe, estimate: StateEstimate, wd: Vec3, joint1_torque: float
) -> Vec3:
    """Rotor torque for an angular acceleration: inertia, gyroscopic part, arm's reaction."""
    ix, iy, iz = airframe.inertia
    wx, wy, wz = estimate.w_WB_B
    return (
        ix * wd[0] + (iz - iy) * wy * wz,
        iy * wd[1] + (ix - iz) * wz * wx + joint1_torque,
        iz * wd[2] + (iy - ix) * wx * wy,
    )
