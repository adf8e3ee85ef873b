r"""What the joints are asked for, brought within their limits: angle, rate and acceleration.

The limits hold for what is sent to the joint loop, the sum of plan and compensation. The reference
is a state of its own that follows what is wanted as far as the limits allow. Its angles are bounded
link by link, in :math:`\theta_1` and :math:`\theta_1 + \theta_2`, its rates joint by joint:

- A link is never faster towards its bound than it can brake before it. A rate that keeps this is
  therefore in reach in the next tick as well, for either link whatever the other does.
- The acceleration is cut link by link. The rate of the second joint is the difference of those of
  the links, and cutting both changes to the same size leaves it between the last rate and the
  wanted one, both of which are allowed.

Source: docs/equations.md T3a; docs/decisions/0027-limits-that-hold.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fsw.autopilot.geometry.vectors import clamp, clamp_magnitude
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.signals import Vec2
from fsw.compiled import compilable


@dataclass(frozen=True, slots=True)
class JointReferenceLimits:
    """What the joint loop needs of the joints' own limits to follow within them."""

    margin: float = 0.03  # rad, to the limits of the angles
    rate: float = 3.5  # rad/s; three tenths of ``joint_rate_max`` is for the loop that follows
    # rad/s^2, of either link. Whatever a reference does within it and a plan besides, in the worst
    # pose and with the rotors at their limit, the first joint needs no more than its 2 N m.
    acceleration: float = 50.0


# s, damping over stiffness of the joint loop. A link that is asked for no more than its distance
# from its bound in this time is pulled to no place beyond it, and comes to rest there.
APPROACH = 0.08
# s. What is wanted may jump, with every correction of an estimate. The reference makes up for it in
# this time, a quarter of that of the joint loop; what moves on steadily it follows without lag.
CATCH_UP = 0.01


@compilable
def bounds(airframe: Airframe, limits: JointReferenceLimits) -> Vec2:
    """The largest angle of either link [rad] that a reference may have."""
    return airframe.joint1_limit - limits.margin, airframe.joint12_limit - limits.margin


@compilable
def within_limits(airframe: Airframe, limits: JointReferenceLimits, q: Vec2) -> Vec2:
    """The joint angles nearest to ``q`` [rad], link by link, that a reference may have."""
    first, both = bounds(airframe, limits)
    th1, th12 = clamp_magnitude(q[0], first), clamp_magnitude(q[0] + q[1], both)
    return th1, th12 - th1


@compilable
def joint_reference(
    airframe: Airframe,
    limits: JointReferenceLimits,
    last: tuple[Vec2, Vec2],
    wanted: tuple[Vec2, Vec2],
    dt: float,
) -> tuple[Vec2, Vec2]:
    """Angles [rad] and rates [rad/s] for the joint loop, ``dt`` [s] after the ``last`` ones.

    Of ``wanted`` angles [rad] and rates [rad/s] what the limits allow. The rates are those at which
    the angles went there from the last ones.
    """
    (q1, q2), (before1, before2) = last
    before12 = before1 + before2
    most = limits.acceleration
    w1, w12 = _towards(limits, (q1, q1 + q2), _links(airframe, limits, wanted), dt)
    first, both = bounds(airframe, limits)
    w1 = _within(w1, q1, first, most, dt)
    w12 = _within(w12, q1 + q2, both, most, dt)
    fastest = max(abs(w1), abs(w12 - w1))
    if fastest > limits.rate:
        # Both by the same factor: neither link then approaches its limit faster than before.
        w1, w12 = w1 * limits.rate / fastest, w12 * limits.rate / fastest
    w1 = before1 + clamp_magnitude(w1 - before1, most * dt)
    w12 = before12 + clamp_magnitude(w12 - before12, most * dt)
    return (q1 + w1 * dt, q2 + (w12 - w1) * dt), (w1, w12 - w1)


@compilable
def _links(
    airframe: Airframe, limits: JointReferenceLimits, wanted: tuple[Vec2, Vec2]
) -> tuple[Vec2, Vec2]:
    """Angles and rates of the links for those ``wanted`` of the joints, the angles allowed ones."""
    th1, th2 = within_limits(airframe, limits, wanted[0])
    return (th1, th1 + th2), (wanted[1][0], wanted[1][0] + wanted[1][1])


@compilable
def _towards(
    limits: JointReferenceLimits, links: Vec2, wanted: tuple[Vec2, Vec2], dt: float
) -> Vec2:
    """Rates of the links that follow ``wanted`` and bring both there at once."""
    (goal1, goal12), (w1, w12) = wanted
    off1, off12 = goal1 - links[0] - w1 * dt, goal12 - links[1] - w12 * dt
    longest = max(abs(off1), abs(off12))
    if longest == 0.0:
        return w1, w12
    share = braking_rate(longest, limits.acceleration, CATCH_UP, dt) / longest
    return w1 + share * off1, w12 + share * off12


@compilable
def _within(rate: float, angle: float, bound: float, most: float, dt: float) -> float:
    """``rate`` [rad/s], no faster towards either bound than the link can brake before it."""
    low = -braking_rate(bound + angle, most, APPROACH, dt)
    return clamp(rate, low, braking_rate(bound - angle, most, APPROACH, dt))


@compilable
def braking_rate(distance: float, most: float, time: float, dt: float) -> float:
    """Largest rate [rad/s] for a tick of ``dt`` [s] from which a link stops in ``distance`` [rad].

    It brakes with ``most`` [rad/s^2] at most, and near the end in proportion to what is left, with
    a time constant ``time`` [s].
    """
    far = abs(distance)
    rate = far / (time + dt)
    if rate > most * time:
        beyond = far - 0.5 * most * time * time
        rate = math.sqrt(most * dt * most * dt + 2.0 * most * beyond) - most * dt
    return math.copysign(rate, distance)
