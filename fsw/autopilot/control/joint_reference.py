r"""What the joints are asked for, brought within their limits: angle, rate and acceleration.

The limits hold for what is sent to the joint loop, the sum of plan and compensation. The reference
is a state of its own that follows what is wanted as far as the limits allow. Its angles are bounded
in the arm's coordinates (``model/arm_coordinates.py``), of the paper's arm :math:`\theta_1` and
:math:`\theta_1 + \theta_2`, its rates joint by joint:

- A coordinate is never faster towards its bound than it can brake before it. A rate that keeps this
  is therefore in reach in the next tick as well, for each coordinate whatever the others do.
- The acceleration is cut coordinate by coordinate. The rate of the paper's second joint is the
  difference of those of its coordinates, and cutting both changes to the same size leaves it
  between the last rate and the wanted one, both of which are allowed. Where other coordinates would
  not leave it there, all changes are cut by one factor.
- Rates of joints that are too much, and rates towards a limit beside the coordinates, are cut for
  all joints by one factor.

Source: docs/equations.md T3a; docs/decisions/0027-limits-that-hold.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fsw.autopilot.geometry.vectors import clamp, clamp_magnitude
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.model.arm_coordinates import (
    ArmCoordinates,
    along_other,
    bounds_of,
    to_coordinates,
    to_joints,
)
from fsw.autopilot.tick_record import ArmTask, Joints
from fsw.compiled import compilable


@dataclass(frozen=True, slots=True)
class JointReferenceLimits:
    """What the joint loop needs of the joints' own limits to follow within them."""

    margin: float = 0.03  # rad, to the limits of the angles
    rate: float = 3.5  # rad/s; three tenths of ``joint_rate_max`` is for the loop that follows
    # rad/s^2, of each coordinate. Whatever a reference does within it and a plan besides, in the
    # worst pose and with the rotors at their limit, the first joint of the paper's arm needs no
    # more than its 2 N m.
    acceleration: float = 50.0


# s, damping over stiffness of the joint loop. A joint that is asked for no more than its distance
# from its bound in this time is pulled to no place beyond it, and comes to rest there.
APPROACH = 0.08
# s. What is wanted may jump, with every correction of an estimate. The reference makes up for it in
# this time, a quarter of that of the joint loop; what moves on steadily it follows without lag.
CATCH_UP = 0.01
_OTHERS = 0.25  # of the acceleration is counted on to brake before a limit beside the coordinates
_SHARE_OF_RATE = 0.7  # of ``joint_rate_max``, that a reference may have


@compilable
def refer(
    k: Joints,
    a: ArmTask,
    airframe: Airframe,
    arm: ArmCoordinates,
    limits: JointReferenceLimits,
    dt: float,
) -> None:
    """Angles and rates for the joint loop, ``dt`` [s] after the last ones. Writes k's reference.

    Of the wanted ``a.q`` and ``a.qd`` what the limits allow. The rates are those at which the
    angles went there from the last ones.
    """
    n, most = int(arm.joints), limits.acceleration
    _towards(k, a, arm, limits, dt)
    for i in range(n):
        low, high = bounds_of(arm, i, limits.margin)
        slowest = braking_rate(low - a.c[i], most, APPROACH, dt)
        a.rate[i] = clamp(a.rate[i], slowest, braking_rate(high - a.c[i], most, APPROACH, dt))
    to_joints(arm, a.rate, a.qd)
    # All by the same factor: none then approaches its limit faster than before.
    share = _share_of_rates(k, a, airframe, arm, limits, dt)
    to_coordinates(arm, k.reference_rate, a.step)
    longest = 0.0
    for i in range(n):
        a.goal[i] = share * a.rate[i] - a.step[i]
        a.rate[i] = a.step[i] + clamp_magnitude(a.goal[i], most * dt)
        longest = max(longest, abs(a.goal[i]))
    to_joints(arm, a.rate, a.qd)
    if _share_of_rates(k, a, airframe, arm, limits, dt) < 1.0 and longest > most * dt:
        # All changes by one factor: what lies between two sets of rates is allowed if both are.
        for i in range(n):
            a.rate[i] = a.step[i] + most * dt / longest * a.goal[i]
        to_joints(arm, a.rate, a.qd)
    for i in range(n):
        k.reference_rate[i] = a.qd[i]
        k.reference[i] += a.qd[i] * dt


@compilable
def _towards(
    k: Joints, a: ArmTask, arm: ArmCoordinates, limits: JointReferenceLimits, dt: float
) -> None:
    """Rates that follow what is wanted and bring all coordinates there at once. Writes c, rate."""
    n, longest = int(arm.joints), 0.0
    to_coordinates(arm, a.q, a.goal)
    to_coordinates(arm, a.qd, a.rate)
    to_coordinates(arm, k.reference, a.c)
    for i in range(n):
        low, high = bounds_of(arm, i, limits.margin)
        a.goal[i] = clamp(a.goal[i], low, high) - a.c[i] - a.rate[i] * dt
        longest = max(longest, abs(a.goal[i]))
    if longest > 0.0:
        share = braking_rate(longest, limits.acceleration, CATCH_UP, dt) / longest
        for i in range(n):
            a.rate[i] += share * a.goal[i]


@compilable
def _share_of_rates(
    k: Joints,
    a: ArmTask,
    airframe: Airframe,
    arm: ArmCoordinates,
    limits: JointReferenceLimits,
    dt: float,
) -> float:
    """The largest share [1] of the joints' rates that every joint and every other limit allows."""
    share = 1.0
    for i in range(int(arm.joints)):
        most = min(limits.rate, _SHARE_OF_RATE * airframe.joint_rate_max[i])
        if abs(a.qd[i]) > most:
            share = min(share, most / abs(a.qd[i]))
    for i in range(int(arm.others)):
        angle, rate = along_other(arm, i, k.reference), along_other(arm, i, a.qd)
        room = arm.other_high[i] - angle if rate > 0.0 else angle - arm.other_low[i]
        slow = _OTHERS * limits.acceleration
        most = max(braking_rate(room - limits.margin, slow, APPROACH, dt), 0.0)
        if abs(rate) > most:
            share = min(share, most / abs(rate))
    return share


@compilable
def braking_rate(distance: float, most: float, time: float, dt: float) -> float:
    """Largest rate [rad/s] for a tick of ``dt`` [s] from which a joint stops in ``distance`` [rad].

    It brakes with ``most`` [rad/s^2] at most, and near the end in proportion to what is left, with
    a time constant ``time`` [s].
    """
    far = abs(distance)
    rate = far / (time + dt)
    if rate > most * time:
        beyond = far - 0.5 * most * time * time
        rate = math.sqrt(most * dt * most * dt + 2.0 * most * beyond) - most * dt
    return math.copysign(rate, distance)
