"""What a gripper may hold: a payload that joints and rotors carry, and that may get lost.

* Joints: each carries its own arm and the payload, the arm stretched out level from it, with a
  share of its torque; what the loops take to follow is in the field.
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
    field = GRAVITY + loop.acceleration * config.surroundings.disturbance
    bounds = (
        *_by_joints(airframe, field),
        PayloadRange(_by_thrust(airframe, field), "the rotors' thrust"),
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


def _by_joints(airframe: Airframe, field: float) -> list[PayloadRange]:
    b, lengths = airframe.bodies, _lengths(airframe.bodies)
    found = []
    for k, length in enumerate(lengths):
        own = 0.0  # kg m
        for i in range(k, b.joints):
            centre = math.hypot(*b.com[3 * i : 3 * i + 3])
            own += b.mass[i] * (length - lengths[i] + centre)
        held = _TORQUE * airframe.joint_torque_max[k] / field - own
        found.append(PayloadRange(_per_lever(held, length), f"joint {k + 1}'s torque"))
    return found


def _by_thrust(airframe: Airframe, field: float) -> float:
    most = _THRUST * airframe.full_thrust
    return most * math.cos(airframe.tilt_max) / field - airframe.mass


def _by_balance(airframe: Airframe) -> float:
    b = airframe.bodies
    reach = math.hypot(*b.offset[:2]) + _lengths(b)[0]
    top = np.array(airframe.rotor_thrust_max[: airframe.rotors])
    hover = airframe.mass * GRAVITY / airframe.rotors
    left = float(np.minimum(hover, top - hover).min())
    return _per_lever(_TURNED * left * airframe.rotors * airframe.rotor_lever / GRAVITY, reach)


def _per_lever(moment: float, lever: float) -> float:
    """The mass of a moment [kg m] on a lever [m]; without a lever nothing is bounded."""
    return moment / lever if lever > 0.0 else math.copysign(math.inf, moment)
