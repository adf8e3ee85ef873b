r"""The square root of eqs 11, 22 and 23, made safe to differentiate.

:math:`\sqrt{2\alpha d}` is the speed from which a deceleration :math:`\alpha` just stops
within :math:`d`. Its slope is infinite at the boundary and it does not exist outside, where
a disturbed vehicle may well be. It is continued by its tangent of slope :math:`k_S`:

.. math:: S(d) = k_S d \;(d < \alpha/k_S^2), \qquad
          \sqrt{2\alpha\,(d - \alpha/(2k_S^2))} \;\text{otherwise}

which has a continuous slope, never promises more braking than the root, and needs
:math:`k_S T \le 1` to be safe between samples.

Source: docs/equations.md E22, E23.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

from fsw.compiled import compilable

LOUD: Final = 0.4  # m/s^2, observed disturbance from which on lambda is whole


class BarrierNumbers(NamedTuple):
    """What compiled rows need of a tuning; compiled code takes no dataclass."""

    alpha: float  # m/s^2
    slope: float  # 1/s
    gamma: float  # 1/s
    lambda_: float  # m/s
    period: float  # s
    first_node: int  # the first one with rows


@dataclass(frozen=True, slots=True)
class BarrierTuning:
    """Constants of eqs 22, 23 and 25 and of the rows that enforce them.

    Raises:
        ValueError: where a constant is not positive.
    """

    alpha: float = 2.0  # m/s^2, deceleration the barrier counts on
    slope: float = 4.0  # 1/s, k_S
    gamma: float = 3.0  # 1/s
    # lambda of eq 25 [m/s]. At rest the plan keeps lambda / slope = 73.5 mm from the boundary, more
    # than the fast loop can be pushed off the plan by 0.8 m/s^2 on one axis (``control/tube.py``).
    lambda_: float = 0.294
    skipped_nodes: int = 1  # first nodes, which the inputs can hardly move

    def __post_init__(self) -> None:
        for name in ("alpha", "slope", "gamma", "lambda_"):
            value = getattr(self, name)
            if not (0.0 < value < math.inf):
                raise ValueError(
                    f"barrier {name.strip('_')} is {value}; it must be positive and finite"
                )

    def approach_speed(self, distance: float) -> float:
        """S of these constants [m/s] at a ``distance`` [m] to the boundary."""
        return safe_approach_speed(distance, self.alpha, self.slope)

    def following(self, recent: float, least: float) -> float:
        """Lambda [m/s] where no more than ``recent`` [m/s^2] of disturbance was observed of late.

        It goes down to ``least`` [m/s]; from ``LOUD`` on, and where ``least`` is 0, it has its full
        value.
        """
        if not 0.0 < least < self.lambda_:
            return self.lambda_
        return least + (self.lambda_ - least) * min(1.0, recent / LOUD)

    def check_sampling(self, period: float) -> None:
        """Check ``k_S T <= 1`` and ``gamma T <= 1`` for the planner's ``period`` [s].

        Raises:
            ValueError: One of them fails.
        """
        for name, rate in (("slope", self.slope), ("gamma", self.gamma)):
            if not (rate * period <= 1.0):
                raise ValueError(
                    f"barrier {name} is {rate} 1/s; at a period of {period} s it must not "
                    f"exceed {1.0 / period} 1/s"
                )

    def numbers(self, period: float) -> BarrierNumbers:
        """The same for compiled rows, with the ``period`` [s] of the planner."""
        return BarrierNumbers(
            alpha=self.alpha,
            slope=self.slope,
            gamma=self.gamma,
            lambda_=self.lambda_,
            period=period,
            first_node=1 + self.skipped_nodes,
        )


def stand_off(tuning: BarrierTuning) -> float:
    """Distance to the boundary at which a plan at rest meets h = lambda [m]."""
    knee = tuning.alpha / tuning.slope**2
    if tuning.lambda_ <= tuning.slope * knee:
        return tuning.lambda_ / tuning.slope
    return tuning.lambda_**2 / (2.0 * tuning.alpha) + 0.5 * knee


@compilable
def safe_approach_speed(distance: float, alpha: float, slope: float) -> float:
    """Largest safe approach speed S [m/s] at a ``distance`` [m] to the boundary, negative outside.

    ``alpha`` [m/s^2] is the assumed braking deceleration, ``slope`` [1/s] the k_S of the tangent.
    """
    knee = alpha / (slope * slope)
    if distance < knee:
        return slope * distance
    return math.sqrt(2.0 * alpha * (distance - 0.5 * knee))


@compilable
def safe_approach_slope(distance: float, alpha: float, slope: float) -> float:
    """Derivative of S in the ``distance`` [m]; ``alpha`` [m/s^2] and ``slope`` [1/s] as there."""
    knee = alpha / (slope * slope)
    if distance < knee:
        return slope
    return alpha / math.sqrt(2.0 * alpha * (distance - 0.5 * knee))
