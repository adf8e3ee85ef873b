r"""The arm's joint loops: PID on angle, computed torque, what disturbs it observed, limits kept.

The arm is light: straight, 0.01 N m of friction in its elbow are 70 rad/s^2. Its disturbance
:math:`\hat\tau` is therefore observed, from the generalised momentum :math:`p = M\dot\theta`,
which needs no acceleration:

.. math:: \dot{\hat p} = \tau - b + \hat\tau + 2\beta(p - \hat p), \quad
          \dot{\hat\tau} = \beta^2(p - \hat p),

and taken off the torque. A link near its limit may be accelerated towards it by no more than

.. math:: c^2(\theta_{max} - \theta) - 2c\,\dot\theta,

with which a critically damped link comes to rest at it. This holds for what is measured, so that
neither a disturbed arm nor an integral passes the limit. The rate of each joint has the same of one
order less.

Source: docs/equations.md T3b.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from fsw.autopilot.control.pid import PidGains, pid_step
from fsw.autopilot.geometry.vectors import clamp, clamp_magnitude
from fsw.autopilot.model.actuator_health import SOUND, STUCK
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.signals import StateEstimate, Vec2, Vec3
from fsw.autopilot.tick_record import Estimate, Joints
from fsw.compiled import compilable
from fsw.record import Floats

_OBSERVER = 100.0  # rad/s
_DISTURBANCE = 0.3  # N m; more than friction and gusts make, and less than the servo has


class ArmDynamics(NamedTuple):
    """Of the planar two-link arm in one state; link 1 against the inertial frame, then joint 2."""

    inertia: Vec3  # kg m^2, m11, m12, m22; with what the joints' motors add
    bias: Vec2  # N m, which velocities and the field take up
    momentum: Vec2  # N m s
    drift: Vec2  # N m, what changes the momentum besides the torques


def rest_joints(k: Joints, airframe: Airframe, estimate: StateEstimate) -> None:
    """Let joint loops begin."""
    k.numbers[:] = 0.0
    momentum = arm_dynamics(airframe, estimate, (0.0, 0.0)).momentum
    k.reference[: len(momentum)], k.momentum[: len(momentum)] = estimate.q_arm, momentum


@compilable
def observe_disturbance(k: Joints, arm: ArmDynamics, torque: Vec2 | Floats, dt: float) -> None:
    """Momentum and disturbance ``dt`` [s] later, ``torque`` [N m] having been sent meanwhile."""
    for i in range(len(arm.momentum)):
        predicted = k.momentum[i] + dt * (torque[i] + arm.drift[i] + k.disturbance[i])
        surprise = arm.momentum[i] - predicted
        k.momentum[i] = predicted + 2.0 * _OBSERVER * dt * surprise
        believed = k.disturbance[i] + _OBSERVER * _OBSERVER * dt * surprise
        k.disturbance[i] = clamp_magnitude(believed, _DISTURBANCE)


@compilable
def joint_torques(
    k: Joints,
    airframe: Airframe,
    gains: PidGains,
    estimate: StateEstimate | Estimate,
    qdd: Vec2 | Floats,
    arm: ArmDynamics,
    pitch_acceleration: float,
    dt: float,
) -> Vec2:
    """Torques [N m] within the servos' limit (computed torque). Writes the integrals in ``k``.

    ``pitch_acceleration`` [rad/s^2] is the base's about body y. Wanted are the angles and rates of
    the reference in ``k`` and the accelerations ``qdd`` [rad/s^2]; tick length ``dt`` [s].
    """
    q, qd = estimate.q_arm, estimate.qd_arm
    wanted1, k.integral[0] = pid_step(
        gains, k.integral[0], k.reference[0] - q[0], k.reference_rate[0] - qd[0], dt
    )
    wanted2, k.integral[1] = pid_step(
        gains, k.integral[1], k.reference[1] - q[1], k.reference_rate[1] - qd[1], dt
    )
    qdd1, qdd2 = limited_acceleration(airframe, q, qd, (wanted1 + qdd[0], wanted2 + qdd[1]))
    torque1, torque2 = torques_for(arm, (qdd1 + pitch_acceleration, qdd2))
    torque1 -= airframe.joint_armature * pitch_acceleration  # the motor turns with the base
    bound = airframe.joint_torque_max
    return (
        clamp_magnitude(torque1 - k.disturbance[0], bound),
        clamp_magnitude(torque2 - k.disturbance[1], bound),
    )


@compilable
def torques_of_failed(
    airframe: Airframe,
    kinds: Vec2 | Floats,
    torques: Vec2,
    arm: ArmDynamics,
    pitch_acceleration: float,
) -> Vec2:
    """``torques`` [N m] of joints of which one at least has failed in one of the ``kinds`` [1].

    A limp drive is asked for nothing. What keeps a stuck joint in its place acts on the base as
    well, so that is what it is asked for. ``pitch_acceleration`` [rad/s^2] is the base's.
    """
    held1, held2 = torques_for(arm, (pitch_acceleration, 0.0))
    held1 -= airframe.joint_armature * pitch_acceleration
    bound = airframe.joint_torque_max
    first, second = torques
    if kinds[0] != SOUND:
        first = clamp_magnitude(held1, bound) if kinds[0] == STUCK else 0.0
    if kinds[1] != SOUND:
        second = clamp_magnitude(held2, bound) if kinds[1] == STUCK else 0.0
    return first, second


# 1/s; somewhat quicker than the joint loop, which it overrules only where that would pass a limit.
# From the rate of a reference, 3.5 rad/s, it brakes with 120 rad/s^2: for that torques suffice.
_POLE = 30.0


@compilable
def limited_acceleration(
    airframe: Airframe, q: Vec2 | Floats, qd: Vec2 | Floats, qdd: Vec2
) -> Vec2:
    """``qdd`` [rad/s^2] of the joints at ``q`` [rad] and ``qd`` [rad/s], as far as allowed."""
    most = airframe.joint_rate_max
    first = clamp(qdd[0], _POLE * (-most - qd[0]), _POLE * (most - qd[0]))
    second = clamp(qdd[1], _POLE * (-most - qd[1]), _POLE * (most - qd[1]))
    # Angles last: a rate can wait, an end stop cannot.
    both = _towards(q[0] + q[1], qd[0] + qd[1], first + second, airframe.joint12_limit)
    first = _towards(q[0], qd[0], first, airframe.joint1_limit)
    return first, both - first


@compilable
def _towards(angle: float, rate: float, acceleration: float, limit: float) -> float:
    """Acceleration [rad/s^2] of a link, as far as both limits of its angle allow."""
    damping = 2.0 * _POLE * rate
    low = _POLE * _POLE * (-limit - angle) - damping
    high = _POLE * _POLE * (limit - angle) - damping
    return clamp(acceleration, low, high)


@compilable
def torques_for(arm: ArmDynamics, qdd: Vec2) -> Vec2:
    """Joint torques [N m] for ``qdd`` [rad/s^2] of link 1 in the inertial frame and of joint 2."""
    m11, m12, m22 = arm.inertia
    return (
        m11 * qdd[0] + m12 * qdd[1] + arm.bias[0],
        m12 * qdd[0] + m22 * qdd[1] + arm.bias[1],
    )


@compilable
def accelerations_of(arm: ArmDynamics, torque: Vec2) -> Vec2:
    """Accelerations [rad/s^2] under a ``torque`` [N m]: the inverse of ``torques_for``.

    Of link 1 in the inertial frame, and of joint 2.
    """
    m11, m12, m22 = arm.inertia
    first, second = torque[0] - arm.bias[0], torque[1] - arm.bias[1]
    determinant = m11 * m22 - m12 * m12
    return (
        (m22 * first - m12 * second) / determinant,
        (m11 * second - m12 * first) / determinant,
    )


@compilable
def arm_dynamics(
    airframe: Airframe, estimate: StateEstimate | Estimate, field: Vec2
) -> ArmDynamics:
    """The planar two-link arm (Lagrange form) in a ``field`` [m/s^2] along body x and z.

    The field is gravity minus the base's acceleration, which is what thrust and disturbance make of
    it, whatever the attitude.
    """
    m1, m2 = airframe.link_mass[0], airframe.link_mass[1]
    l1, c1, c2 = airframe.link_length[0], airframe.link_com[0], airframe.link_com[1]
    i1, i2 = airframe.link_inertia[0], airframe.link_inertia[1]
    th1, th2 = estimate.q_arm[0], estimate.q_arm[1]
    field_x, field_z = field
    across1 = field_z * math.sin(th1) - field_x * math.cos(th1)
    across12 = field_z * math.sin(th1 + th2) - field_x * math.cos(th1 + th2)
    cos2, sin2 = math.cos(th2), math.sin(th2)
    w1 = estimate.qd_arm[0] + estimate.w_WB_B[1]  # link 1 against the inertial frame
    w2 = estimate.qd_arm[1]
    coupling = m2 * l1 * c2
    m22 = i2 + m2 * c2 * c2
    m12 = m22 + coupling * cos2
    m11 = i1 + m1 * c1 * c1 + m2 * l1 * l1 + m12 + coupling * cos2
    # Motors feel how their joints turn, not how the base does.
    spin1, spin2 = airframe.joint_armature * estimate.qd_arm[0], airframe.joint_armature * w2
    centrifugal = coupling * sin2
    lever2 = m2 * c2 * across12
    lever1 = (m1 * c1 + m2 * l1) * across1 + lever2
    return ArmDynamics(
        (m11 + airframe.joint_armature, m12, m22 + airframe.joint_armature),
        (lever1 - centrifugal * (2.0 * w1 + w2) * w2, lever2 + centrifugal * w1 * w1),
        (m11 * w1 + m12 * w2 + spin1, m12 * w1 + m22 * w2 + spin2),
        (-lever1, -lever2 - centrifugal * w1 * (w1 + w2)),
    )
