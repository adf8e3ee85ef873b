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
from typing import Final, NamedTuple

from fsw.autopilot.geometry.rotation import rotate_back
from fsw.autopilot.geometry.vectors import add, clamp, cross, dot, norm
from fsw.autopilot.model.airframe import GRAVITY, Airframe
from fsw.autopilot.model.multibody import (
    Bodies,
    base_acceleration,
    lever_of,
    place_of_tip,
    posture,
)
from fsw.autopilot.signals import JointVector, RotorVector, Vec2, Vec3
from fsw.autopilot.tick_record import Tick
from fsw.compiled import compilable
from fsw.record import Floats

_SIDES: Final = (
    *("front", "front right", "right", "rear right"),
    *("rear", "rear left", "left", "front left"),
)
WEIGHING_TIME = 1.0  # s
_CARRIED = 0.7  # of the weight as configured; what flies is at most so much lighter
_WEIGHING_THRUST = 5.0  # m/s^2


class MotionState(NamedTuple):
    """Derivatives of the base's position that rotors and joints produce right now."""

    thrust: float  # N, total along -z of the body
    a: Vec3  # m/s^2, without disturbance
    j: Vec2  # m/s^3, horizontal
    s: Vec2  # m/s^4, horizontal
    turning: Vec3 = (0.0, 0.0, 0.0)  # rad/s^2, of the base, FRD


@compilable
def lag_rotor(thrust: float, command: float, decay: float) -> float:
    """``thrust`` [N] of a rotor a tick later under ``command`` [N]; ``decay`` [1] per tick."""
    return command + (thrust - command) * decay


@compilable
def is_light(airframe: Airframe, rotors: Floats) -> bool:
    """Whether ``rotors`` (ROTORS,) [N] carry so little of the weight that what flies would fall."""
    carried = 0.0
    for i in range(int(airframe.rotors)):
        carried += rotors[i]
    return carried < _CARRIED * airframe.mass * GRAVITY


def rotor_decay(airframe: Airframe, dt: float) -> float:
    """Share of a rotor's thrust error left after ``dt`` [s]: exp(-dt / lag)."""
    return math.exp(-dt / airframe.rotor_lag)


@compilable
def estimate_mass(
    airframe: Airframe,
    mass: float,
    rotors: RotorVector | Floats,
    specific_force: float,
    seconds: float,
    lift: float = 0.0,
) -> float:
    """The vehicle's mass [kg], from what the accelerometer makes of the rotors' thrust.

    The tracking loop is quick, and its gain is thrust over mass: 20 % less mass than believed
    makes it diverge. A second of averaging keeps gusts and arm motion out, and the estimate stays
    within 30 % of the believed mass. ``mass`` [kg] is the last estimate, ``rotors`` [N] the thrust
    of each, ``specific_force`` [m/s^2] along -z of the body, ``seconds`` [s] the time since.
    A surface that the tool presses on gives a ``lift`` [N] along -z besides.
    """
    force, _ = rotor_wrench(airframe, rotors)
    thrust = lift - force[2]
    if not (thrust > _WEIGHING_THRUST * airframe.mass and specific_force > _WEIGHING_THRUST):
        return mass  # hardly flying: a quotient of small numbers
    moved = mass + seconds / WEIGHING_TIME * (thrust / specific_force - mass)
    return clamp(moved, 0.7 * airframe.mass, 1.3 * airframe.mass)


@compilable
def rotor_wrench(airframe: Airframe, thrust: RotorVector | Floats) -> tuple[Vec3, Vec3]:
    """Force [N, B] and torque [N m, B] about B's origin of rotors that give ``thrust`` [N] each."""
    w, fx, fy, fz, tx, ty, tz = airframe.wrench, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(int(airframe.rotors)):
        f, at = thrust[i], 6 * i
        fx, fy, fz = fx + w[at] * f, fy + w[at + 1] * f, fz + w[at + 2] * f
        tx, ty, tz = tx + w[at + 3] * f, ty + w[at + 4] * f, tz + w[at + 5] * f
    return (fx, fy, fz), (tx, ty, tz)


@compilable
def load_of_tip(r: Tick, b: Bodies, torque: JointVector | Floats) -> tuple[Vec3, Vec3]:
    """Force [N, B] and torque [N m, B] about B's origin of the observed force on the tool.

    What it does to the joints is added to their ``torque`` (j,) [N m], into pressing.load. Reads
    estimate, bodies.
    """
    k, m = r.pressing, r.bodies
    if k.near == 0:
        for i in range(int(b.joints)):
            k.load[i] = torque[i]
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    force = rotate_back(r.estimate.R_WB, k.force)
    tip = place_of_tip(m, b)
    for i in range(int(b.joints)):
        k.load[i] = torque[i] + dot(lever_of(m, i, tip), force)
    return force, cross(tip, force)


@compilable
def motion_state(
    airframe: Airframe, r: Tick, rotors: RotorVector | Floats, torque: JointVector | Floats
) -> MotionState:
    """Acceleration, jerk and snap of the body origin from the rotor model.

    Thrust of the ``rotors`` [N], ``torque`` [N m] of the joints. Reads estimate, mass, bodies.
    """
    R = r.estimate.R_WB
    wx, wy = r.estimate.w_WB_B[0], r.estimate.w_WB_B[1]
    force, turn = rotor_wrench(airframe, rotors)
    thrust = -force[2]
    f = thrust / r.mass
    pushed, turned = load_of_tip(r, airframe.bodies, torque)
    turning = base_acceleration(
        r.bodies, airframe.bodies, add(turn, turned), add(force, pushed), r.pressing.load
    )
    wdx, wdy = turning[0], turning[1]
    return MotionState(
        thrust,
        (-f * R[2], -f * R[5], GRAVITY - f * R[8]),
        (-f * (wy * R[0] - wx * R[1]), -f * (wy * R[3] - wx * R[4])),
        (-f * (wdy * R[0] - wdx * R[1]), -f * (wdy * R[3] - wdx * R[4])),
        turning,
    )


def agility(airframe: Airframe) -> float:
    """Angular acceleration [rad/s^2] that rotors give with a torque of hover thrust at their lever.

    About roll or pitch, whichever is larger.
    """
    J = posture(airframe.bodies, airframe.home_posture).inertia
    return airframe.mass * GRAVITY * airframe.rotor_lever / float(min(J[0], J[4]))


def swing(airframe: Airframe) -> float:
    """Angular acceleration [rad/s^2] for each m/s^2 of a push at B's origin, the largest.

    The centre of mass is elsewhere: a heavy arm under a light body makes of a push a torque.
    """
    m, b, push = posture(airframe.bodies, airframe.home_posture), airframe.bodies, airframe.mass
    pushes = (push, 0.0, 0.0), (0.0, push, 0.0), (0.0, 0.0, push)
    still, free = (0.0, 0.0, 0.0), (0.0,) * b.joints
    return max(norm(base_acceleration(m, b, still, one, free)) for one in pushes)


def rotor_names(airframe: Airframe) -> list[str]:
    """What to call each rotor: its number, and its side where no other rotor is on that."""
    w, sides = airframe.wrench, []
    for at in range(0, 6 * airframe.rotors, 6):
        # A thrust along -z turns the vehicle by where it acts: x forward, y to the right.
        sides.append(_SIDES[round(math.atan2(-w[at + 3], w[at + 4]) / (0.25 * math.pi)) % 8])
    return [
        f"rotor {k} ({side})" if sides.count(side) == 1 else f"rotor {k}"
        for k, side in enumerate(sides, start=1)
    ]
