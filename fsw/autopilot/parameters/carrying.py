"""What a gripper may hold: a payload that joints and rotors carry, and that may get lost.

* Joints: each carries its own arm and the payload, the arm stretched out level from it, with a
  share of its torque. What the loops take to follow adds to weight. In flight that is felt along
  the body's z axis, and a joint holds the part of it that is across the joint's own axis.
* Rotors: they carry all of it at the largest tilt, and balance the payload at the arm's full
  reach, with shares of their thrust.
* A payload that is lost without a command leaves loops that believe in it for a moment: the
  tracking loop's gain is thrust over mass, and bears a fifth too much of it.

Source: docs/equations.md T9.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fsw.autopilot.control.payload import HEAVIEST
from fsw.autopilot.control.tube import Tube
from fsw.autopilot.model.airframe import GRAVITY, Airframe
from fsw.autopilot.model.multibody import Bodies
from fsw.autopilot.parameters.flight_config import FlightConfig

_TORQUE, _THRUST = 0.8, 0.9  # shares of the most
_TURNED = 0.5  # of what rotors can give more or less than hover takes


class PayloadRange(NamedTuple):
    """The heaviest payload that is safe, and what bounds it."""

    most: float  # kg
    by: str


def payload_range(config: FlightConfig, loop: Tube) -> PayloadRange:
    """The range of a vehicle with the loop ``loop_tube(config)``."""
    airframe = config.airframe
    followed = loop.acceleration * config.surroundings.disturbance
    lifted = _THRUST * airframe.full_thrust * math.cos(airframe.tilt_max)
    bounds = (
        *_by_joints(airframe, followed),
        PayloadRange(lifted / (GRAVITY + followed) - airframe.mass, "the rotors' thrust"),
        PayloadRange(_by_balance(airframe), "the rotors' torque at the arm's full reach"),
        PayloadRange(HEAVIEST * airframe.mass, "its loss in flight"),
    )
    most, by = min(bounds)
    return PayloadRange(max(most, 0.0), by)


def _lengths(b: Bodies) -> list[float]:
    """From each joint to the end-effector, stretched out [m]."""
    found, along = [0.0] * b.joints, math.hypot(*b.tip)
    for k in range(b.joints - 1, -1, -1):
        found[k] = along
        along += math.hypot(*b.offset[3 * k : 3 * k + 3])
    return found


def _across(b: Bodies) -> list[float]:
    """Most of each joint's axis that is across the body's z axis, with the joints before free [1].

    Two angles bound where an axis may point: a joint turns it about its own, which is as far off z.
    """
    found, least, most = [], 0.0, 0.0  # rad, from z to the axis before
    before = np.array([0.0, 0.0, 1.0])
    for k in range(b.joints):
        axis = np.array(b.axis[3 * k : 3 * k + 3])
        here = np.reshape(b.turned[9 * k : 9 * k + 9], (3, 3)) @ axis
        off = math.atan2(float(np.linalg.norm(np.cross(before, here))), float(before @ here))
        least, most = (
            max(0.0, least - off, off - most),
            min(math.pi, most + off, 2.0 * math.pi - least - off),
        )
        found.append(math.sin(min(max(0.5 * math.pi, least), most)))
        before = axis
    return found


def _by_joints(airframe: Airframe, followed: float) -> list[PayloadRange]:
    b, lengths = airframe.bodies, _lengths(airframe.bodies)
    found = []
    for k, (length, across) in enumerate(zip(lengths, _across(b), strict=True)):
        own = 0.0  # kg m
        for i in range(k, b.joints):
            centre = math.hypot(*b.com[3 * i : 3 * i + 3])
            own += b.mass[i] * (length - lengths[i] + centre)
        most = _TORQUE * airframe.joint_torque_max[k]
        held = _per(most, GRAVITY * across + followed) - own
        found.append(PayloadRange(_per(held, length), f"joint {k + 1}'s torque"))
    return found


def _by_balance(airframe: Airframe) -> float:
    b = airframe.bodies
    reach = math.hypot(*b.offset[:2]) + _lengths(b)[0]
    top = np.array(airframe.rotor_thrust_max[: airframe.rotors])
    hover = airframe.mass * GRAVITY / airframe.rotors
    left = float(np.minimum(hover, top - hover).min())
    return _per(_TURNED * left * airframe.rotors * airframe.rotor_lever / GRAVITY, reach)


def _per(load: float, lever: float) -> float:
    """A ``load`` by a lever [m] or a field [m/s^2]; where there is none, nothing is bounded."""
    return load / lever if lever > 0.0 else math.copysign(math.inf, load)
