r"""Forward invariance with disturbance rejection (eq 25), in sampled data.

:math:`\dot h + \gamma(h - \lambda) \ge 0` says that h may decay towards :math:`\lambda` no
faster than exponentially. Sampled and accumulated from the start of the horizon,

.. math:: h_i \ge \beta^i h_0 + (1 - \beta^i)\lambda, \qquad \beta = 1 - \gamma T .

The rows are anchored at :math:`h_0`. Chained row by row they would let the first, which the
lagging vehicle cannot move, excuse the others.

Source: docs/equations.md E10, E25.
"""

from __future__ import annotations

from fsw.barriers.root import BarrierNumbers
from fsw.compiled import compiled


@compiled
def required_h(h_start: float, node: int, tuning: BarrierNumbers) -> float:
    """Least h allowed at a node of the horizon [m/s]."""
    decay = (1.0 - tuning.gamma * tuning.period) ** node
    return decay * h_start + (1.0 - decay) * tuning.robustness
