"""Which force, stiffness and disturbance a vehicle can promise at a surface that it may touch.

By statics, in the home posture, pressing straight ahead of the arm or along the vertical, whichever
the surface's normal is nearer to:

* the force must be more than what the joints' friction and a push that is not yet seen leave
  unknown of it, or the bound on it leaves nothing to press with;
* the hardest surface must be met no faster than the tool can stop, and that at a speed at all;
* the thrust that presses must be left by the tilt after the worst disturbance;
* the arm must take up what the base is pushed off its plan, both ways.

Source: docs/equations.md T8.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fsw.autopilot.control.press import PressTuning
from fsw.autopilot.control.tube import Tube
from fsw.autopilot.model.airframe import GRAVITY, Airframe
from fsw.autopilot.model.arm_coordinates import arm_coordinates, within_limits
from fsw.autopilot.model.multibody import place_of_tip, posture
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import Touch, Vec3, Zone
from fsw.record import JOINTS

_SLOWEST = 0.005  # m/s, below which no surface is found in a reasonable time
_LEAST = 0.5  # N, worth pressing with
_STEP = 0.005  # m, of a search for the arm's room
_ASTRAY = 0.002  # m, that the tool is off the line in that search
_FARTHEST = 0.3  # m


class Grip(NamedTuple):
    """What the arm can do along a normal, in one posture."""

    unsure: float  # N, e of fsw/autopilot/control/press.py
    mass: float  # kg, of the tool; inf: the arm does not move along it
    inwards: float  # m, by which the base can come nearer to the surface
    outwards: float  # m, the same away from it


def grip(airframe: Airframe, tuning: PressTuning, normal: Vec3, disturbance: float) -> Grip:
    """The grip of the home posture, level, along a ``normal`` [1, B] out of the surface.

    The base is pushed by a ``disturbance`` [m/s^2] on each axis.
    """
    n = airframe.bodies.joints
    home = airframe.home
    m, levers = posture(airframe.bodies, home), _levers(airframe, home)
    along = np.array(normal)
    inertia = m.qq.reshape(JOINTS, JOINTS)[:n, :n]
    gram = levers.T @ levers + 1e-4 * np.eye(3)
    share = levers @ np.linalg.solve(gram, along)
    lever = levers @ along
    eased = float(lever @ np.linalg.solve(inertia, lever))
    if not (eased * tuning.heaviest > 1.0 and float(share @ lever) > 0.9):
        return Grip(math.inf, math.inf, 0.0, 0.0)
    vq = m.vq.reshape(JOINTS, 3)[:n]
    torque = np.array(airframe.joint_friction[:n]) + disturbance * np.linalg.norm(vq, axis=1)
    torque += tuning.wrong * GRAVITY * np.abs(vq[:, 2])
    inwards, outwards = (_room(airframe, home, sign * along) for sign in (1.0, -1.0))
    return Grip(float(np.abs(share) @ torque), 1.0 / eased, inwards, outwards)


def _tip(airframe: Airframe, q: tuple[float, ...]) -> Array:
    """Place of the tool (3,) [m, B]."""
    return np.array(place_of_tip(posture(airframe.bodies, q), airframe.bodies))


def _levers(airframe: Airframe, q: tuple[float, ...]) -> Array:
    """How each joint moves the tool (j, 3) [m, B]."""
    m = posture(airframe.bodies, q)
    tip = _tip(airframe, q)
    n = len(q)
    axes, origins = m.axis.reshape(JOINTS, 3)[:n], m.origin.reshape(JOINTS, 3)[:n]
    found: Array = np.cross(axes, tip - origins)
    return found


def _room(airframe: Airframe, home: tuple[float, ...], way: Array) -> float:
    """How far [m] the tool can be moved one ``way`` (3,) [1, B] from home, and straight."""
    arm, q = arm_coordinates(airframe), np.array(home)
    begin = _tip(airframe, home)
    far = 0.0
    while far < _FARTHEST:
        goal = begin + (far + _STEP) * way
        for _ in range(3):
            at = tuple(q.tolist())
            tip = _tip(airframe, at)
            levers = _levers(airframe, at)
            gram = levers @ levers.T + 1e-5 * np.eye(len(at))
            q = q + np.linalg.solve(gram, levers @ (goal - tip))
        q = np.array(within_limits(arm, tuple(q.tolist()), 0.03))
        tip = _tip(airframe, tuple(q.tolist()))
        if np.linalg.norm(goal - tip) > _ASTRAY:
            return far
        far += _STEP
    return far


def against_touching(config: FlightConfig, zone: Zone, loop: Tube) -> str:
    """Why this vehicle can promise nothing at a surface that it may touch; empty: it can."""
    touch, airframe, tuning = zone.touch, config.airframe, config.tuning.press
    if touch is None:
        return ""
    disturbance = config.surroundings.disturbance
    found = grip(airframe, tuning, _normal_in_body(zone), disturbance)
    if not math.isfinite(found.mass):
        return "the arm does not move along its normal in the home posture"
    return (
        _against_force(found, touch, tuning)
        or _against_stiffness(found, touch, tuning)
        or _against_thrust(config, loop)
        or _against_room(found, disturbance * (loop.height if _is_level(zone) else loop.base))
    )


def _left(config: FlightConfig, loop: Tube) -> float:
    """Acceleration [m/s^2] that the tilt leaves beside the worst disturbance on one axis."""
    level = GRAVITY * math.tan(config.airframe.tilt_max)
    return level - loop.acceleration * config.surroundings.disturbance


def _against_force(found: Grip, touch: Touch, tuning: PressTuning) -> str:
    least = found.unsure + tuning.damping + _LEAST
    if touch.force_max >= least:
        return ""
    return (
        f"its force bound of {touch.force_max:.1f} N is too small: friction and pushes leave "
        f"{found.unsure:.1f} N unknown; {math.ceil(10.0 * least) / 10.0:.1f} N is enough"
    )


def _against_stiffness(found: Grip, touch: Touch, tuning: PressTuning) -> str:
    impact = tuning.share * (touch.force_max - found.unsure)
    most = (impact / _SLOWEST) ** 2 / found.mass
    if touch.stiffness_high <= most:
        return ""
    return (
        f"a stiffness of {touch.stiffness_high:.0f} N/m is too much for a tool of "
        f"{found.mass:.2f} kg and {touch.force_max:.1f} N; at most {most:.0f} N/m"
    )


def _against_thrust(config: FlightConfig, loop: Tube) -> str:
    force = config.airframe.mass * _left(config, loop)
    if force >= _LEAST:
        return ""
    return f"beside the worst disturbance the tilt leaves {max(force, 0.0):.1f} N to press with"


def _against_room(found: Grip, reach: float) -> str:
    room = min(found.inwards, found.outwards)
    if room >= reach:
        return ""
    return (
        f"the base can be pushed {1e3 * reach:.0f} mm off its plan, and the arm takes up "
        f"{1e3 * room:.0f} mm along its normal in the home posture"
    )


def _normal_in_body(zone: Zone) -> Vec3:
    """The normal as the arm meets it [1, B]: from ahead, from below or from above."""
    if _is_level(zone):
        return 0.0, 0.0, math.copysign(1.0, zone.shape.numbers[2])
    return -1.0, 0.0, 0.0


def _is_level(zone: Zone) -> bool:
    return zone.shape.kind == "half-space" and abs(zone.shape.numbers[2]) > 0.7
