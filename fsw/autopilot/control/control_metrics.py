"""Control effort and smoothness of a flight, over the MPC inputs as applied."""

from __future__ import annotations

import math

from fsw.autopilot.signals import PlanInput


class ControlMetrics:
    """Sums over u_k, one a planning period: c_e = sum ||u_k||^2 and c_s = sum ||u_k - u_{k-1}||.

    u is [acceleration (3) m/s^2, yaw acceleration rad/s^2, joint accelerations (2) rad/s^2], in
    the paper's order; its norm mixes units as the paper's does. Sums and means are both reported
    because the printed values of Table IV cannot be plain sums (see docs/equations.md).

    Source: Table IV.
    """

    def __init__(self) -> None:
        self.count = 0
        self.effort = 0.0
        self.smoothness = 0.0
        self._last: tuple[float, ...] | None = None

    def add(self, applied: PlanInput) -> None:
        """Add the input applied during one planning period."""
        u = (*applied.a, applied.yaw_acc, *applied.qdd_arm)
        self.count += 1
        self.effort += sum(value * value for value in u)
        if self._last is not None:
            self.smoothness += math.dist(u, self._last)
        self._last = u

    def as_json(self) -> dict[str, dict[str, float]]:
        """Sum and mean of both, the mean of the smoothness per difference."""
        return {
            "control_effort": {"sum": self.effort, "mean": self.effort / max(self.count, 1)},
            "control_smoothness": {
                "sum": self.smoothness,
                "mean": self.smoothness / max(self.count - 1, 1),
            },
        }
