"""Which force, stiffness and disturbance a vehicle can promise at a surface that it may touch.

By statics, in the home posture, pressing straight ahead of the arm or along the vertical, whichever
the surface's normal is nearer to:

* the force must be more than what the joints' friction and a push that is not yet seen leave
  unknown of it, or the bound on it leaves nothing to press with;
* the hardest surface must be met no faster than the tool can stop, and that at a speed at all;
* the thrust that presses must be left by the tilt after the worst disturbance;
* what the force on the tool, friction included, turns the base by must be left by each rotor after
  the worst disturbance, and by what rotors may spend on yaw;
* what the disturbance and the force, as it comes and goes, push the base off its plan must be no
  more than the plan keeps from the boundary, for all other parts, and than the arm takes up, both
  ways.

Source: docs/equations.md T8.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from fsw.autopilot.barriers.safe_approach import stand_off
from fsw.autopilot.control.allocation import AXES, PITCH, ROLL, THRUST, YAW
from fsw.autopilot.control.press import PressTuning
from fsw.autopilot.control.tube import Tube, base_reach, limits_used, of_contact
from fsw.autopilot.model.airframe import GRAVITY, Airframe
from fsw.autopilot.model.arm_coordinates import arm_coordinates, within_limits
from fsw.autopilot.model.multibody import place_of_tip, posture
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import Vec3, Zone
from fsw.record import JOINTS

_SLOWEST = 0.005  # m/s, below which no surface is found in a reasonable time
_LEAST = 0.5  # N, worth pressing with
_STEP = 0.005  # m, of a search for the arm's room
_ASTRAY = 0.002  # m, that the tool is off the line in that search
_FARTHEST = 0.3  # m
_NONE = 1e-9
_LEVEL = 0.3  # of a normal, that is horizontal, below which the arm is not turned to it
_TURNED = 0.8  # share of what rotors may spend on yaw


class Grip(NamedTuple):
    """What the arm can do along a normal, in one posture."""

    unsure: float  # N, e of fsw/autopilot/control/press.py
    mass: float  # kg, of the tool; inf: the arm does not move along it
    inwards: float  # m, by which the base can come nearer to the surface
    outwards: float  # m, the same away from it


@lru_cache(maxsize=16)  # it takes 60 ms, and in flight is known from the analysis of the zone
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
    inwards, outwards = (_stroke(airframe, home, sign * along) for sign in (1.0, -1.0))
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


def _stroke(airframe: Airframe, home: tuple[float, ...], way: Array) -> float:
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
    assert touch is not None
    disturbance = config.surroundings.disturbance
    found = grip(airframe, tuning, _normal_in_body(zone), disturbance)
    if not math.isfinite(found.mass):
        return "the arm does not move along its normal in the home posture"
    least = found.unsure + tuning.damping + _LEAST
    hardest = (tuning.share * (touch.force_max - found.unsure) / _SLOWEST) ** 2 / found.mass
    leaning = airframe.mass * _left(config, loop)
    lost = of_contact(loop, _LEAST, found.unsure, airframe.mass)
    reach, arm = _pushed(config, zone, loop) + lost, min(found.inwards, found.outwards)
    kept = stand_off(config.planner.walls)
    reasons = (
        (
            touch.force_max >= least,
            f"its force bound of {touch.force_max:.1f} N is too small: friction and pushes leave "
            f"{found.unsure:.1f} N unknown; {math.ceil(10.0 * least) / 10.0:.1f} N is enough",
        ),
        (
            touch.stiffness_high <= hardest,
            f"a stiffness of {touch.stiffness_high:.0f} N/m is too much for a tool of "
            f"{found.mass:.2f} kg and {touch.force_max:.1f} N; at most {hardest:.0f} N/m",
        ),
        (
            leaning >= _LEAST,
            f"beside the worst disturbance the tilt leaves {max(leaning, 0.0):.1f} N to press with",
        ),
        (
            _covered(config, zone, loop, found) >= _LEAST,
            f"the base can be pushed {1e3 * reach:.0f} mm off its plan where {_LEAST:g} N are "
            f"lost; the arm takes up {1e3 * arm:.0f} mm along its normal in the home posture, and "
            f"the plan keeps {1e3 * kept:.0f} mm",
        ),
    )
    return next((why for holds, why in reasons if not holds), "")


class Pressed(NamedTuple):
    """What is asked for at a surface."""

    normal: Vec3  # [1, NED], out of it
    force: float  # N, along that
    slide: Vec3  # NED, along the surface, of any length; none: it presses in one place


def against_pressing(config: FlightConfig, zone: Zone, loop: Tube, asked: Pressed) -> str:
    """Why a vehicle cannot press as ``asked`` on a surface that it may touch; empty: it can."""
    most = max_force(config, zone, loop)
    if asked.force > most:
        return f"{asked.force:.1f} N are asked for; at most {most:.1f} N can be promised"
    room = balanced_force(config, zone, loop, asked)
    if asked.force > room:
        return (
            f"pressing with {asked.force:.1f} N and sliding turns the vehicle by more than its "
            f"rotors leave beside the worst disturbance; at most {room:.1f} N"
        )
    return ""


def balanced_force(config: FlightConfig, zone: Zone, loop: Tube, asked: Pressed) -> float:
    """The largest force [N] along the normal whose friction and itself the rotors can balance."""
    assert zone.touch is not None
    airframe, disturbance = config.airframe, config.surroundings.disturbance
    normal, slide = _in_body(asked)
    length = float(np.linalg.norm(slide))
    each = normal - (zone.touch.friction / length * slide if length > 0.0 else 0.0)  # of one newton
    m = posture(airframe.bodies, airframe.home)
    torque = np.cross(_tip(airframe, airframe.home) - np.array(m.centre), each)
    used = limits_used(airframe, config.tuning.tracking, loop, disturbance)["rotor torque"]
    hover = airframe.mass * GRAVITY / airframe.rotors
    share = np.array(airframe.share).reshape(-1, AXES)[: airframe.rotors]
    asks = np.zeros(AXES)
    asks[[ROLL, PITCH, YAW]], asks[THRUST] = torque, abs(each[2])
    top = np.array(airframe.rotor_thrust_max[: airframe.rotors])
    left = (1.0 - min(used, 1.0)) * np.minimum(hover, top - hover)
    of_yaw = np.abs(share[:, YAW]) * abs(torque[2])
    rooms = [
        *(left / np.maximum(np.abs(share @ asks), _NONE)),
        *(_TURNED * config.tuning.yaw_thrust_limit / np.maximum(of_yaw, _NONE)),
    ]
    return float(min(rooms))


def _in_body(asked: Pressed) -> tuple[Array, Array]:
    """Normal and slide (3,) [B] of a vehicle that is level and whose arm is turned to both."""
    normal, slide = np.array(asked.normal), np.array(asked.slide)
    ahead = -normal * (1.0, 1.0, 0.0)
    if not np.linalg.norm(ahead) > _LEVEL:  # nothing but the slide says where the arm is
        ahead = slide * (1.0, 1.0, 0.0)
        if not np.linalg.norm(ahead) > 0.0:
            return normal, slide
    x = ahead / np.linalg.norm(ahead)
    axes = np.array((x, (-x[1], x[0], 0.0), (0.0, 0.0, 1.0)))
    return axes @ normal, axes @ slide


def max_force(config: FlightConfig, zone: Zone, loop: Tube) -> float:
    """The largest force [N] that can be asked for at a surface that may be touched."""
    touch, tuning = zone.touch, config.tuning.press
    assert touch is not None
    found = grip(config.airframe, tuning, _normal_in_body(zone), config.surroundings.disturbance)
    bounded = touch.force_max - found.unsure - tuning.damping
    leaning = config.airframe.mass * _left(config, loop)
    return max(min(bounded, leaning, _covered(config, zone, loop, found)), 0.0)


def _pushed(config: FlightConfig, zone: Zone, loop: Tube) -> float:
    """How far the worst disturbance pushes the base off its plan along the normal [m]."""
    disturbance = config.surroundings.disturbance
    return disturbance * loop.height if _is_level(zone) else base_reach(loop, disturbance)


def _covered(config: FlightConfig, zone: Zone, loop: Tube, found: Grip) -> float:
    """The largest force [N] that may come and go beside the worst disturbance."""
    room = min(stand_off(config.planner.walls), found.inwards, found.outwards)
    left, mass = room - _pushed(config, zone, loop), config.airframe.mass
    unknown, each = of_contact(loop, 0.0, found.unsure, mass), of_contact(loop, 1.0, 0.0, mass)
    return (left - unknown) / each


def _left(config: FlightConfig, loop: Tube) -> float:
    """Acceleration [m/s^2] that the tilt leaves beside the worst disturbance on one axis."""
    level = GRAVITY * math.tan(config.airframe.tilt_max)
    return level - loop.acceleration * config.surroundings.disturbance


def _normal_in_body(zone: Zone) -> Vec3:
    """The normal as the arm meets it [1, B]: from ahead, from below or from above."""
    if _is_level(zone):
        return 0.0, 0.0, math.copysign(1.0, zone.shape.numbers[2])
    return -1.0, 0.0, 0.0


def _is_level(zone: Zone) -> bool:
    return zone.shape.kind == "half-space" and abs(zone.shape.numbers[2]) > 0.7
