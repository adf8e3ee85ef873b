r"""What the joints are asked for, brought within their limits: angle, rate, and no jumps.

The limits hold for what is sent to the joint loop, the sum of plan and compensation. In the angles
of the links, :math:`\theta_1` and :math:`\theta_1 + \theta_2`, the region they leave is a
box. The reference of the last tick lies in it, the wanted one is clamped into it, and both rates
shorten the step between the two by the same factor: it stays on the straight line from one point of
the box to another and cannot leave it, and no joint moves faster than its rate.

Source: docs/equations.md T3; docs/decisions/0027-limits-that-hold.md.
"""

from __future__ import annotations

from dataclasses import dataclass

from fsw.compiled import compilable
from fsw.geometry.vectors import clamp_magnitude
from fsw.model.airframe import Airframe
from fsw.signals import Vec2


@dataclass(frozen=True, slots=True)
class JointReferenceLimits:
    """What the joint loop needs of the joints' own limits to follow within them."""

    margin: float = 0.03  # rad, to the limits of the angles
    rate: float = 3.5  # rad/s; three tenths of ``joint_rate_max`` is for the loop that follows


# 1/s. A link that is asked for no more than the rate of this many times its distance from its bound
# comes to rest there as the joint loop's own error does.
APPROACH = 20.0


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
    last: Vec2,
    wanted: tuple[Vec2, Vec2],
    dt: float,
) -> tuple[Vec2, Vec2]:
    """Angles [rad] and rates [rad/s] for the joint loop, ``dt`` [s] after ``last`` [rad].

    Of ``wanted`` angles [rad] and rates [rad/s] only what the limits allow.
    """
    q, qd = wanted
    start, goal = within_limits(airframe, limits, last), within_limits(airframe, limits, q)
    step1, step2 = goal[0] - start[0], goal[1] - start[1]
    most = limits.rate * dt
    longest = max(abs(step1), abs(step2))
    if longest > most:
        share = most / longest
        reached = (start[0] + share * step1, start[1] + share * step2)
        qd = (share * step1 / dt, share * step2 / dt)
    else:
        reached = goal
    return reached, _limited_rates(airframe, limits, reached, qd)


@compilable
def _limited_rates(airframe: Airframe, limits: JointReferenceLimits, q: Vec2, qd: Vec2) -> Vec2:
    first, both = bounds(airframe, limits)
    w1 = _approaching(q[0], qd[0], first)
    w2 = _approaching(q[0] + q[1], qd[0] + qd[1], both) - w1
    fastest = max(abs(w1), abs(w2))
    if fastest > limits.rate:
        # Both by the same factor: neither link then approaches its limit faster than before.
        w1, w2 = w1 * limits.rate / fastest, w2 * limits.rate / fastest
    return w1, w2


@compilable
def _approaching(angle: float, rate: float, bound: float) -> float:
    """``rate`` [rad/s], no faster towards either bound than its distance allows."""
    return min(max(rate, -APPROACH * (bound + angle)), APPROACH * (bound - angle))
