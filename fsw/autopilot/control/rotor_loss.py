r"""Whether the rotors that are left can fly the vehicle, from their effectiveness matrix.

Rotors that give thrusts within :math:`0 \le f_i \le f_{max,i}` and carry the weight between them
turn the vehicle by any angular acceleration of a polygon about roll and pitch. How far it reaches
in a direction u is a linear program with one equation, whose dual has one unknown:

.. math:: h(u) = \min_\lambda \lambda m g + \sum_i f_{max,i} \max(0, u \cdot g_i - \lambda z_i)

with g the angular acceleration and z the lift of a rotor per thrust; it is least at a kink. What is
left to control with is the distance of what holds the arm's weight level from the polygon's edge.

Yaw is given up where rotors cannot hold it beside the rest. Of a hexarotor without a rotor the
opposite one must rest, and what it can turn the vehicle by to one side is nothing: unless the arm's
weight is on the far side of the lost rotor. So where some postures leave no room for yaw to
either side, that one is looked for that leaves most.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.model.airframe import GRAVITY, Airframe
from fsw.autopilot.model.arm_coordinates import arm_coordinates, within_limits
from fsw.autopilot.model.multibody import Several, posture

Array = NDArray[np.float64]
_DIRECTIONS: Final = 32
# Of what all rotors have. Between walls a hexarotor and an octorotor stay off them with half of it;
# of a quadrotor's rotors, those that are left have next to nothing.
_MIN_SHARE: Final = 0.25
_POSTURES: Final = 100  # that are looked at
_INSIDE: Final = 0.1  # rad, of the joints' limits
_NONE: Final = 1e-9
_ROLL, _PITCH, _THRUST, _YAW = 0, 1, 2, 3


def flies_without(airframe: Airframe, rotor: int) -> bool:
    """Whether roll, pitch and thrust are controlled without a ``rotor`` (from 0)."""
    left = tilting_authority(airframe, without=(rotor,))
    return left >= _MIN_SHARE * tilting_authority(airframe)


def tilting_authority(airframe: Airframe, without: tuple[int, ...] = ()) -> float:
    """Angular acceleration [rad/s^2] that hovering rotors have about every horizontal axis.

    In the home posture. Negative: they cannot hold the vehicle level, or not carry it.
    """
    effect, most = _left(airframe, without)
    lift, weight = effect[_THRUST], airframe.mass * GRAVITY
    if not most @ lift.clip(min=0.0) > weight:
        return -math.inf
    m = posture(airframe.bodies, airframe.home_posture)
    inertia = np.array([m.inertia[0], m.inertia[4]])
    turning = effect[:_THRUST].T / inertia
    level = _level(airframe, airframe.home_posture)[0][:_THRUST] / inertia
    least = math.inf
    for angle in np.linspace(0.0, 2.0 * math.pi, _DIRECTIONS, endpoint=False):
        u = np.array([math.cos(angle), math.sin(angle)])
        towards = turning @ u
        kinks = towards[lift > 0.0] / lift[lift > 0.0]
        spare = np.maximum(towards - kinks[:, None] * lift, 0.0)
        reach = kinks * weight + spare @ most
        least = min(least, float(reach.min() - level @ u))
    return least


def balancing_posture(airframe: Airframe, rotor: int) -> Several | None:
    """Joint angles (j,) [rad] with which the others hold the heading without a ``rotor``.

    None: they do so in any.
    """
    left = {q: yaw_authority(airframe, q, (rotor,)) for q in _within_reach(airframe)}
    return None if min(left.values()) > 0.0 else max(left, key=left.__getitem__)


@lru_cache(maxsize=4)
def _within_reach(airframe: Airframe) -> tuple[Several, ...]:
    """Postures (j,) [rad] to choose from, the home posture first."""
    joints, arm = airframe.bodies.joints, arm_coordinates(airframe)
    drawn = np.random.default_rng(0).uniform(-math.pi, math.pi, (_POSTURES, joints))
    inside = [within_limits(arm, tuple(angles), _INSIDE) for angles in drawn.tolist()]
    return airframe.home, *inside


def yaw_authority(airframe: Airframe, q: Several, without: tuple[int, ...] = ()) -> float:
    """Angular acceleration [rad/s^2] about yaw, to the weaker side, of a vehicle that hovers level.

    With its joints at ``q`` (j,) [rad]. Negative: it turns, whatever rotors do.
    """
    effect, most = _left(airframe, without)
    obeys = most > 0.0
    share, (level, inertia) = np.linalg.pinv(effect[:, obeys]), _level(airframe, q)
    rest, yaw = share @ level, share[:, _YAW]
    turns = np.abs(yaw) > _NONE
    ends = np.stack((-rest[turns], most[obeys][turns] - rest[turns])) / yaw[turns]
    return min(-float(ends.min(axis=0).max()), float(ends.max(axis=0).min())) / inertia


def _left(airframe: Airframe, without: tuple[int, ...]) -> tuple[Array, Array]:
    """Roll, pitch, thrust and yaw (4, r) of a newton of each rotor, and the most of each (r,)."""
    n = airframe.rotors
    wrench = np.array(airframe.wrench[: 6 * n]).reshape(n, 6)
    most = np.array(airframe.rotor_thrust_max[:n])
    most[list(without)] = 0.0
    return np.array([wrench[:, 3], wrench[:, 4], -wrench[:, 2], wrench[:, 5]]), most


@lru_cache(maxsize=_POSTURES + 1)
def _level(airframe: Airframe, q: Several) -> tuple[Array, float]:
    """Roll, pitch, thrust and yaw (4,) [N m; N] that hover level takes, and yaw's inertia [kg m^2].

    With joints at ``q`` (j,) [rad].
    """
    m, weight = posture(airframe.bodies, q), airframe.mass * GRAVITY
    return np.array([-m.centre[1] * weight, m.centre[0] * weight, weight, 0.0]), float(m.inertia[8])
