r"""The arm's joint loops: PID on angle, computed torque, what disturbs it observed, limits kept.

The arm is light: straight, 0.01 N m of friction in its elbow are 70 rad/s^2. Its disturbance
:math:`\hat\tau` is therefore observed, from the generalised momentum :math:`p = M\dot\theta`,
which needs no acceleration:

.. math:: \dot{\hat p} = \tau - b + \hat\tau + 2\beta(p - \hat p), \quad
          \dot{\hat\tau} = \beta^2(p - \hat p),

and taken off the torque. A coordinate of the arm (``model/arm_coordinates.py``) near its limit
may be accelerated towards it by no more than

.. math:: c^2(\theta_{max} - \theta) - 2c\,\dot\theta,

with which, critically damped, it comes to rest at it. This holds for what is measured, so that
neither a disturbed arm nor an integral passes the limit. The rate of each joint has the same of one
order less.

Source: docs/equations.md T3b.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

from numpy.typing import NDArray

from fsw.autopilot.control.pid import PidGains, pid_step
from fsw.autopilot.control.press import PressTuning, press, pressed_by, presses
from fsw.autopilot.geometry.vectors import clamp, clamp_magnitude
from fsw.autopilot.model.actuator_health import SOUND, STUCK
from fsw.autopilot.model.airframe import GRAVITY, Airframe
from fsw.autopilot.model.arm_coordinates import (
    ArmCoordinates,
    along_other,
    to_coordinates,
    to_joints,
)
from fsw.autopilot.model.multibody import (
    Bodies,
    factorise,
    joint_drift,
    joint_load,
    move_bodies,
    posture,
    solve,
)
from fsw.autopilot.signals import JointVector, StateEstimate, Vec3
from fsw.autopilot.tick_record import ArmTask, Joints, Multibody, Tick
from fsw.compiled import compilable, kernel, machine_code, packed
from fsw.record import JOINTS, Floats

_OBSERVER = 100.0  # rad/s
# Of the largest torque; more than friction and gusts make, and less than the servo has.
_DISTURBANCE = 0.15


def rest_joints(k: Joints, airframe: Airframe, estimate: StateEstimate) -> None:
    """Let joint loops begin."""
    k.numbers[:] = 0.0
    still = Tick()
    still.state_estimate = estimate
    _place(_packed(airframe), still.array)
    k.reference[:], k.momentum[:] = still.estimate.q_arm, still.bodies.momentum


def arm_damping(airframe: Airframe) -> JointVector:
    """About critical for the hanging arm (j,) [N m s/rad]: it is let down beside walls as well."""
    b = airframe.bodies
    m, found = posture(b, (0.0,) * b.joints), []
    for k in range(b.joints):
        stiffness = GRAVITY * math.hypot(*m.vq[3 * k : 3 * k + 3].tolist())
        found.append(2.0 * math.sqrt(stiffness * float(m.qq[JOINTS * k + k])))
    return tuple(found)


@lru_cache(maxsize=8)
def _packed(airframe: Airframe) -> NDArray[Any]:
    return packed(airframe)


@machine_code
@kernel
def _place(airframes: NDArray[Any], records: NDArray[Any]) -> None:
    airframe, r = airframes[0], records[0]
    move_bodies(r.bodies, airframe.bodies, airframe.joint_armature, r.estimate)


@compilable
def observe_disturbance(
    r: Tick, airframe: Airframe, torque: Floats, field: Vec3, dt: float
) -> None:
    """Momentum and disturbance ``dt`` [s] later, ``torque`` [N m] having been sent meanwhile.

    The ``field`` [m/s^2, B] is gravity less the base's acceleration, which is what thrust and
    disturbance make of it, whatever the attitude. What a closed gripper holds may be heavy.
    """
    k, share = r.joints, 1.0 if r.payload.gripped > 0.0 else _DISTURBANCE
    _observe(k.momentum, k.disturbance, share, r.bodies, airframe, torque, field, dt)


@compilable
def observe_contact(r: Tick, airframe: Airframe, torque: Floats, field: Vec3, dt: float) -> None:
    """The same of a tool that may press on something, as much as the drives can hold.

    ``torque`` (j,) [N m], ``field`` [m/s^2, B] and ``dt`` [s] as of ``observe_disturbance``.
    """
    k = r.pressing
    if k.near == 0:
        return
    _observe(k.momentum, k.external, 1.0, r.bodies, airframe, torque, field, dt)


@compilable
def _observe(
    momentum: Floats,
    disturbance: Floats,
    share: float,
    m: Multibody,
    airframe: Airframe,
    torque: Floats,
    field: Vec3,
    dt: float,
) -> None:
    for i in range(int(airframe.bodies.joints)):
        predicted = momentum[i] + dt * (torque[i] + joint_drift(m, i, field) + disturbance[i])
        surprise = m.momentum[i] - predicted
        momentum[i] = predicted + 2.0 * _OBSERVER * dt * surprise
        believed = disturbance[i] + _OBSERVER * _OBSERVER * dt * surprise
        disturbance[i] = clamp_magnitude(believed, share * airframe.joint_torque_max[i])


@compilable
def joint_torques(
    r: Tick,
    airframe: Airframe,
    arm: ArmCoordinates,
    gains: PidGains,
    tuning: PressTuning,
    field: Vec3,
    turning: Vec3,
    dt: float,
) -> None:
    """Torques within the servos' limit (computed torque). Writes wanted, the integrals in joints.

    ``turning`` [rad/s^2, B] is the base's angular acceleration, ``field`` [m/s^2, B] as of
    ``observe_disturbance``. Wanted are the reference in joints and the accelerations of what is
    flown; tick length ``dt`` [s]. Reads estimate, bodies, flown_u.
    """
    k, m, n = r.joints, r.bodies, int(airframe.bodies.joints)
    q, qd, qdd = r.estimate.q_arm, r.estimate.qd_arm, m.work
    pressing, off, rate_off, left = presses(r, tuning), 0.0, 0.0, 1.0
    if pressing:  # how far the tool is off along the normal is no error, and not to be integrated
        # Levers along the normal vanish as an arm gets straight, and what is made of them is as
        # large as it is wrong. It is bent instead: straight it would press with the whole vehicle.
        left = r.pressing.stroke
        for i in range(n):
            off += left * r.pressing.along[i] * (k.reference[i] - q[i])
            rate_off += left * r.pressing.along[i] * (k.reference_rate[i] - qd[i])
    for i in range(n):
        bent = (1.0 - left) * (airframe.home_posture[i] - k.reference[i])
        error = k.reference[i] + bent - q[i] - r.pressing.share[i] * off
        rate_error = left * k.reference_rate[i] - qd[i] - r.pressing.share[i] * rate_off
        wanted, k.integral[i] = pid_step(gains, k.integral[i], error, rate_error, dt)
        qdd[i] = wanted + left * r.flown_u.qdd_arm[i]
    limit_acceleration(airframe, arm, r.arm, q, qd, qdd)
    if pressing:
        _press_with(r, airframe, press(r, airframe, tuning, field, turning, dt), qdd)
        _stay_within(r, airframe, arm)
        for i in range(n):
            torque = joint_load(m, i, field, turning) + r.pressing.work[i]
            r.wanted.joint_torque[i] = clamp_magnitude(torque, airframe.joint_torque_max[i])
        return
    r.pressing.commanded = r.pressing.ramped = 0.0
    for i in range(n):
        torque = joint_load(m, i, field, turning) - k.disturbance[i]
        for j in range(n):
            torque += m.qq[JOINTS * i + j] * qdd[j]
        r.wanted.joint_torque[i] = clamp_magnitude(torque, airframe.joint_torque_max[i])


@compilable
def _press_with(r: Tick, airframe: Airframe, into: float, qdd: Floats) -> None:
    """Torques [N m] that press with the commanded force, and beside it give ``qdd`` (j,) [rad/s^2].

    Along the normal the tool accelerates ``into`` [m/s^2] the surface in place of that. What is
    observed there is not made up for: it is what is wanted. Reads bodies; writes pressing.work.
    """
    p, m, n, left = r.pressing, r.bodies, int(airframe.bodies.joints), r.pressing.stroke
    along = 0.0
    for i in range(n):
        along += p.along[i] * qdd[i]
    into, along = left * into, left * along
    for i in range(n):
        qdd[i] -= p.share[i] * along
    for i in range(n):
        p.work[i] = 0.0
        for j in range(n):
            p.work[i] += m.qq[JOINTS * i + j] * qdd[j]
    # What moves the tool aside must not press: where friction holds it, the surface takes it all.
    aside = left * pressed_by(p, p.work, n) if p.contact > 0 else 0.0
    for i in range(n):
        besides = p.external[i] - p.along[i] * left * p.pressed
        p.work[i] -= clamp_magnitude(besides, _DISTURBANCE * airframe.joint_torque_max[i])
        p.work[i] -= p.along[i] * (p.commanded + aside)
        for j in range(n):
            p.work[i] -= m.qq[JOINTS * i + j] * p.share[j] * into


@compilable
def _stay_within(r: Tick, airframe: Airframe, arm: ArmCoordinates) -> None:
    """Limit what presses, as the accelerations that it and what is observed give the joints.

    A surface that is gone no longer holds the arm. Reads estimate, bodies; writes pressing.work.
    """
    p, m, n, allowed = r.pressing, r.bodies, int(airframe.bodies.joints), r.arm.slope
    for i in range(n):
        m.work[i] = p.work[i] + p.external[i]
    factorise(m.factor, m.qq, n)
    solve(m.factor, m.work, n)
    for i in range(n):
        allowed[i] = m.work[i]
    limit_acceleration(airframe, arm, r.arm, r.estimate.q_arm, r.estimate.qd_arm, allowed)
    for i in range(n):
        for j in range(n):
            p.work[i] += m.qq[JOINTS * i + j] * (allowed[j] - m.work[j])


@compilable
def torques_of_failed(r: Tick, airframe: Airframe, field: Vec3, turning: Vec3) -> None:
    """Other torques for joints that have failed.

    ``field`` [m/s^2, B] and ``turning`` [rad/s^2, B] as of ``joint_torques``.

    A limp drive is asked for nothing. What keeps a stuck joint in its place acts on the base as
    well, so that is what it is asked for. Reads health, bodies; writes wanted.
    """
    for i in range(int(airframe.bodies.joints)):
        if r.health.joints[i] == STUCK:
            held = joint_load(r.bodies, i, field, turning)
            r.wanted.joint_torque[i] = clamp_magnitude(held, airframe.joint_torque_max[i])
        elif r.health.joints[i] != SOUND:
            r.wanted.joint_torque[i] = 0.0


# 1/s; somewhat quicker than the joint loop, which it overrules only where that would pass a limit.
# From the rate of a reference, 3.5 rad/s, it brakes with 120 rad/s^2: for that torques suffice.
_POLE = 30.0


@compilable
def limit_acceleration(
    airframe: Airframe, arm: ArmCoordinates, a: ArmTask, q: Floats, qd: Floats, qdd: Floats
) -> None:
    """``qdd`` (j,) [rad/s^2] of joints at ``q`` [rad] and ``qd`` [rad/s], as far as allowed.

    Writes c, rate, goal of the task ``a``.
    """
    n = int(arm.joints)
    for i in range(n):
        most = airframe.joint_rate_max[i]
        qdd[i] = clamp(qdd[i], _POLE * (-most - qd[i]), _POLE * (most - qd[i]))
    # Angles last: a rate can wait, an end stop cannot.
    to_coordinates(arm, q, a.c)
    to_coordinates(arm, qd, a.rate)
    to_coordinates(arm, qdd, a.goal)
    for i in range(n):
        a.goal[i] = _towards(a.c[i], a.rate[i], a.goal[i], arm.low[i], arm.high[i])
    to_joints(arm, a.goal, qdd)
    for i in range(int(arm.others)):
        wanted = along_other(arm, i, qdd)
        allowed = _towards(
            *(along_other(arm, i, q), along_other(arm, i, qd), wanted),
            *(arm.other_low[i], arm.other_high[i]),
        )
        row, size = JOINTS * i, 0.0
        for k in range(n):
            size += arm.other_row[row + k] * arm.other_row[row + k]
        for k in range(n):
            qdd[k] += (allowed - wanted) * arm.other_row[row + k] / size


@compilable
def _towards(angle: float, rate: float, acceleration: float, low: float, high: float) -> float:
    """Acceleration [rad/s^2] of an angle, as far as both of its limits allow."""
    damping = 2.0 * _POLE * rate
    least = _POLE * _POLE * (low - angle) - damping
    return clamp(acceleration, least, _POLE * _POLE * (high - angle) - damping)


@compilable
def accelerate_joints(r: Tick, bodies: Bodies, field: Vec3, turning: Vec3) -> None:
    """Accelerations [rad/s^2] of the joints under the torques sent last. Writes bodies.work.

    ``field`` [m/s^2, B] and ``turning`` [rad/s^2, B] as of ``joint_torques``. Reads sent, bodies.
    """
    m, n = r.bodies, int(bodies.joints)
    for i in range(n):
        m.work[i] = r.sent.joint_torque[i] - joint_load(m, i, field, turning)
    factorise(m.factor, m.qq, n)
    solve(m.factor, m.work, n)
