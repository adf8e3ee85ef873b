"""Records for tests: made of tuples, changed by name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from fsw.autopilot.control import tracking
from fsw.autopilot.control.allocation import allocate
from fsw.autopilot.control.arm_compensation import CompensationLimits, compensate
from fsw.autopilot.control.cascade import Cascade
from fsw.autopilot.control.gains import TrackingTuning
from fsw.autopilot.control.joint_reference import JointReferenceLimits, refer
from fsw.autopilot.estimation.tuning import EstimatorTuning
from fsw.autopilot.flight.fast_loop import FastLoop
from fsw.autopilot.flight.state import FlightState
from fsw.autopilot.model.actuator_health import HEALTHY, ActuatorHealth, note_health
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.model.arm_coordinates import arm_coordinates
from fsw.autopilot.model.multibody import joint_load, move_bodies
from fsw.autopilot.model.nominal import NominalModel
from fsw.autopilot.model.rotors import MotionState, motion_state
from fsw.autopilot.signals import (
    JointVector,
    PlanInput,
    PredictionState,
    StateEstimate,
    Vec2,
    Vec3,
    Vec4,
)
from fsw.autopilot.tick_record import ArmTask, Joints, Multibody, Observed, Tick, new_tick
from fsw.record import JOINTS, Record

Kind = TypeVar("Kind", bound=Record)


def fast_loop(cascade: Cascade) -> FastLoop:
    """A flight's, with these loops."""
    law = cascade.law
    return FastLoop(cascade, NominalModel(law.airframe, law.dt), EstimatorTuning())


def changed(record: Kind, **fields: Any) -> Kind:
    """A copy with other fields; an array's entries that are not given are zero."""
    after = record.copy()
    for name, value in fields.items():
        now = getattr(after, name)
        if isinstance(now, np.ndarray):
            now[:] = 0.0
            now[: len(value)] = value
        else:
            setattr(after, name, value)
    return after


def with_given(before: Tick, estimate: StateEstimate, plan: PredictionState, u: PlanInput) -> Tick:
    """The record of a tick that is given these, before the loops are closed."""
    r = before.copy()
    r.state_estimate, r.plan_state, r.plan_input = estimate, plan, u
    return r


def with_record(state: FlightState, **fields: Any) -> FlightState:
    """A state whose record has other fields or ``state_estimate``."""
    return replace(state, record=changed(state.record, **fields))


def placed(airframe: Airframe, estimate: StateEstimate, mass: float | None = None) -> Tick:
    """A record whose bodies are those of an estimate."""
    r = new_tick(airframe.mass if mass is None else mass, airframe.rotors, airframe.bodies.joints)
    r.state_estimate = estimate
    move_bodies(r.bodies, airframe.bodies, airframe.joint_armature, estimate)
    return r


def torques_for(m: Multibody, field: Vec3, turning: Vec3, qdd: Sequence[float]) -> list[float]:
    """Torques [N m] of joints that get ``qdd`` [rad/s^2]."""
    return [
        joint_load(m, i, field, turning) + float(m.qq[JOINTS * i : JOINTS * i + len(qdd)] @ qdd)
        for i in range(len(qdd))
    ]


def allocated(
    airframe: Airframe,
    torque: Vec3,
    thrust: float,
    yaw_limit: float,
    health: ActuatorHealth = HEALTHY,
    known: float = 0.0,
) -> tuple[float, ...]:
    """Thrust [N] of each rotor for a torque [N m] and a thrust [N]."""
    r = new_tick(airframe.mass, airframe.rotors, airframe.bodies.joints)
    note_health(r.health, health)
    allocate(r, airframe, torque, thrust, yaw_limit, known)
    return tuple(r.wanted.rotor_thrust[: airframe.rotors].tolist())


def measured_motion(
    airframe: Airframe, estimate: StateEstimate, rotors: Vec4, torque: Vec2 = (0.0, 0.0)
) -> MotionState:
    """The motion of an estimated vehicle whose rotors and joints give this."""
    return motion_state(airframe, placed(airframe, estimate), rotors, torque)


def observed(v: Vec3, d: Vec3, recent: float = 1.0) -> Observed:
    """An observer that believes in ``v`` [m/s] and ``d`` [m/s^2]."""
    return changed(Observed(), v=v, d=d, recent=recent)


def observe(before: Observed, v: Vec3, a: Vec3, tuning: TrackingTuning, dt: float) -> Observed:
    """What it believes a tick of ``dt`` [s] later."""
    after = before.copy()
    tracking.observe(after, v, a, tuning, dt)
    return after


def boundless(airframe: Airframe, most: float = 3.0) -> Airframe:
    """A vehicle with wide limits of its joints' angles [rad]."""
    wide = [replace(limit, low=-most, high=most) for limit in airframe.angle_limits]
    return replace(airframe, angle_limits=tuple(wide))


Motion = tuple[JointVector, JointVector]
"""Angles [rad] and rates [rad/s] of joints."""


def compensated_joints(
    airframe: Airframe,
    limits: CompensationLimits,
    joint_limits: JointReferenceLimits,
    off_plan: float,
    estimate: StateEstimate,
    plan: PredictionState,
) -> Motion:
    """What the arm is asked for where the base is off its plan."""
    a, arm = ArmTask(), arm_coordinates(airframe)
    compensate(a, airframe.bodies, arm, limits, joint_limits, off_plan, estimate, plan)
    return _of_joints(a.q, arm.joints), _of_joints(a.qd, arm.joints)


def joint_reference(
    airframe: Airframe, limits: JointReferenceLimits, last: Motion, wanted: Motion, dt: float
) -> Motion:
    """The reference ``dt`` [s] after the last one."""
    a, arm = ArmTask(), arm_coordinates(airframe)
    k = changed(Joints(), reference=last[0], reference_rate=last[1])
    a.q[: arm.joints], a.qd[: arm.joints] = wanted
    refer(k, a, airframe, arm, limits, dt)
    return _of_joints(k.reference, arm.joints), _of_joints(k.reference_rate, arm.joints)


def _of_joints(values: Any, joints: int) -> JointVector:
    return tuple(values[:joints].tolist())
