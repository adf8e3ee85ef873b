r"""Forward invariance with disturbance rejection (eq 25), in sampled data.

:math:`\dot h + \gamma(h - \lambda) \ge 0` says that h may decay towards :math:`\lambda` no
faster than exponentially. Sampled and accumulated from the start of the horizon,

.. math:: h_i \ge \beta^i h_0 + (1 - \beta^i)\lambda, \qquad \beta = 1 - \gamma T .

The rows are anchored at :math:`h_0`. Chained row by row they would let the first, which the
lagging vehicle cannot move, excuse the others.

Source: docs/equations.md E10, E25.
"""

from __future__ import annotations

from fsw.autopilot.barriers.safe_approach import BarrierNumbers, safe_approach_speed
from fsw.compiled import kernel


@kernel
def barrier_value(distance: float, rate: float, tuning: BarrierNumbers) -> float:
    """h [m/s] at a ``distance`` [m] that changes at a ``rate`` [m/s], eqs 11, 22 and 23 alike."""
    return safe_approach_speed(distance, tuning.alpha, tuning.slope) + rate


@kernel
def cbf_lower_bound(h_start: float, node: int, tuning: BarrierNumbers) -> float:
    """Least h [m/s] allowed at a node, 1..n, where it is ``h_start`` [m/s] at node 0."""
    decay = (1.0 - tuning.gamma * tuning.period) ** node
    return decay * h_start + (1.0 - decay) * tuning.lambda_
