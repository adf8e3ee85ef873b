"""The arm's joint loops: PID on angle with the arm's own dynamics fed forward."""

from __future__ import annotations

import math

from fsw.compiled import compilable
from fsw.control.pid import PidGains, pid_step
from fsw.geometry.vectors import clamp_magnitude
from fsw.model.airframe import Airframe
from fsw.signals import StateEstimate, Vec2


@compilable
def joint_torques(
    airframe: Airframe,
    gains: PidGains,
    integral: Vec2,
    estimate: StateEstimate,
    reference: tuple[Vec2, Vec2, Vec2],
    specific_thrust: float,
    pitch_acceleration: float,
    dt: float,
) -> tuple[Vec2, Vec2]:
    """Torques [N m] within the servos' limit (computed torque), and the integrals to pass back.

    The arm hangs in the field the thrust makes: in the body frame, gravity minus the base's
    acceleration is ``specific_thrust`` [m/s^2] along +z, whatever the attitude.
    ``pitch_acceleration`` [rad/s^2] is the base's about body y. The reference has angles, rates and
    accelerations [rad, rad/s, rad/s^2]; ``integral`` [rad s] of the errors, tick length ``dt`` [s].
    """
    q_ref, qd_ref, qdd_ref = reference
    wanted1, kept1 = pid_step(
        gains, integral[0], q_ref[0] - estimate.q_arm[0], qd_ref[0] - estimate.qd_arm[0], dt
    )
    wanted2, kept2 = pid_step(
        gains, integral[1], q_ref[1] - estimate.q_arm[1], qd_ref[1] - estimate.qd_arm[1], dt
    )
    torque1, torque2 = arm_inverse_dynamics(
        airframe,
        estimate,
        (wanted1 + qdd_ref[0] + pitch_acceleration, wanted2 + qdd_ref[1]),
        specific_thrust,
    )
    bound = airframe.joint_torque_max
    torques = (clamp_magnitude(torque1, bound), clamp_magnitude(torque2, bound))
    return torques, (kept1, kept2)


@compilable
def arm_inverse_dynamics(
    airframe: Airframe, estimate: StateEstimate, qdd: Vec2, field: float
) -> Vec2:
    """Joint torques [N m] of the planar two-link arm (Lagrange form) in a field along body +z.

    ``field`` [m/s^2]; ``qdd`` [rad/s^2] is of link 1 against the inertial frame and of joint 2.
    """
    m1, m2 = airframe.link_mass[0], airframe.link_mass[1]
    l1, c1, c2 = airframe.link_length[0], airframe.link_com[0], airframe.link_com[1]
    i1, i2 = airframe.link_inertia[0], airframe.link_inertia[1]
    th1, th2 = estimate.q_arm
    sin1, sin12 = math.sin(th1), math.sin(th1 + th2)
    cos2, sin2 = math.cos(th2), math.sin(th2)
    w1 = estimate.qd_arm[0] + estimate.w_WB_B[1]  # link 1 against the inertial frame
    w2 = estimate.qd_arm[1]
    coupling = m2 * l1 * c2
    m22 = i2 + m2 * c2 * c2
    m12 = m22 + coupling * cos2
    m11 = i1 + m1 * c1 * c1 + m2 * l1 * l1 + m12 + coupling * cos2
    centrifugal = coupling * sin2
    lever2 = field * m2 * c2 * sin12
    lever1 = field * (m1 * c1 + m2 * l1) * sin1 + lever2
    return (
        m11 * qdd[0] + m12 * qdd[1] - centrifugal * (2.0 * w1 + w2) * w2 + lever1,
        m12 * qdd[0] + m22 * qdd[1] + centrifugal * w1 * w1 + lever2,
    )
