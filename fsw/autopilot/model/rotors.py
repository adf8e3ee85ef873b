r"""Where the rotors are, and what that does to the vehicle's motion.

Thrust, jerk and snap cannot be measured at 500 Hz without noise; they follow from the
commands through the rotor lag. With f the total thrust over the mass and b1, b2, b3 the
body axes,

.. math:: a = g e_3 - f b_3, \quad j = -f(\omega_y b_1 - \omega_x b_2), \quad
          s = -f(\dot\omega_y b_1 - \dot\omega_x b_2)

(horizontal parts; products of rates and the vertical jerk are left out).

Source: docs/equations.md T1.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from fsw.autopilot.geometry.vectors import clamp
from fsw.autopilot.model.airframe import GRAVITY, Airframe
from fsw.autopilot.signals import StateEstimate, Vec2, Vec3, Vec4
from fsw.autopilot.tick_record import Estimate
from fsw.compiled import compilable
from fsw.record import Floats

WEIGHING_TIME = 1.0  # s
_WEIGHING_THRUST = 5.0  # m/s^2


class MotionState(NamedTuple):
    """Derivatives of the body's position that the rotors produce right now."""

    thrust: float  # N, total
    a: Vec3  # m/s^2, without disturbance
    j: Vec2  # m/s^3, horizontal
    s: Vec2  # m/s^4, horizontal
    turning: Vec2 = (0.0, 0.0)  # rad/s^2, about body x and y


@compilable
def lag_rotors(thrust: Vec4 | Floats, command: Vec4, decay: float) -> Vec4:
    """``thrust`` [N] of each rotor a tick later under ``command`` [N]; ``decay`` [1] per tick."""
    return (
        command[0] + (thrust[0] - command[0]) * decay,
        command[1] + (thrust[1] - command[1]) * decay,
        command[2] + (thrust[2] - command[2]) * decay,
        command[3] + (thrust[3] - command[3]) * decay,
    )


def rotor_decay(airframe: Airframe, dt: float) -> float:
    """Share of a rotor's thrust error left after ``dt`` [s]: exp(-dt / lag)."""
    return math.exp(-dt / airframe.rotor_lag)


@compilable
def estimate_mass(
    airframe: Airframe, mass: float, rotors: Vec4 | Floats, specific_force: float, seconds: float
) -> float:
    """The vehicle's mass [kg], from what the accelerometer makes of the rotors' thrust.

    The tracking loop is quick, and its gain is thrust over mass: 20 % less mass than believed
    makes it diverge. A second of averaging keeps gusts and arm motion out, and the estimate stays
    within 30 % of the believed mass. ``mass`` [kg] is the last estimate, ``rotors`` [N] the thrust
    of each, ``specific_force`` [m/s^2] along -z of the body, ``seconds`` [s] the time since.
    """
    thrust = rotors[0] + rotors[1] + rotors[2] + rotors[3]
    if not (thrust > _WEIGHING_THRUST * airframe.mass and specific_force > _WEIGHING_THRUST):
        return mass  # hardly flying: a quotient of small numbers
    moved = mass + seconds / WEIGHING_TIME * (thrust / specific_force - mass)
    return clamp(moved, 0.7 * airframe.mass, 1.3 * airframe.mass)


class HangingArm(NamedTuple):
    """What the arm adds to a roll; in pitch its drives push off the base instead."""

    roll_inertia: float  # kg m^2 of the whole vehicle, about its centre of mass
    depth: float  # m, centre of mass below the body origin


@compilable
def hanging_arm(airframe: Airframe, q_arm: Vec2 | Floats) -> HangingArm:
    """The arm as a rigid pendulum across its plane, at the joint angles ``q_arm`` [rad]."""
    upright1, upright2 = math.cos(q_arm[0]), math.cos(q_arm[0] + q_arm[1])
    m1, m2 = airframe.link_mass[0], airframe.link_mass[1]
    z1 = airframe.link_com[0] * upright1
    z2 = airframe.link_length[0] * upright1 + airframe.link_com[1] * upright2
    depth = (m1 * z1 + m2 * z2) / airframe.mass
    inertia = airframe.inertia[0] + m1 * z1 * z1 + m2 * z2 * z2
    return HangingArm(inertia - airframe.mass * depth * depth, depth)


@compilable
def motion_state(
    airframe: Airframe,
    mass: float,
    estimate: StateEstimate | Estimate,
    rotors: Vec4 | Floats,
    joint1_torque: float,
) -> MotionState:
    """Acceleration, jerk and snap of the body origin from the rotor model.

    ``mass`` [kg] of the whole vehicle, thrust of the ``rotors`` [N], ``joint1_torque`` [N m] on
    link 1 about +y of the body; the base feels minus it.
    """
    R = estimate.R_WB
    wx, wy = estimate.w_WB_B[0], estimate.w_WB_B[1]
    f1, f2, f3, f4 = rotors[0], rotors[1], rotors[2], rotors[3]
    thrust = f1 + f2 + f3 + f4
    f = thrust / mass
    wdx = airframe.rotor_arm * (f2 - f4) / hanging_arm(airframe, estimate.q_arm).roll_inertia
    wdy = (airframe.rotor_arm * (f3 - f1) - joint1_torque) / airframe.inertia[1]
    return MotionState(
        thrust,
        (-f * R[2], -f * R[5], GRAVITY - f * R[8]),
        (-f * (wy * R[0] - wx * R[1]), -f * (wy * R[3] - wx * R[4])),
        (-f * (wdy * R[0] - wdx * R[1]), -f * (wdy * R[3] - wdx * R[4])),
        (wdx, wdy),
    )
