r"""What is flown where no plan is young enough: the plan's state is brought to rest.

Each horizontal axis is a velocity with the attitude's lag behind it, and braking is its linear
quadratic regulator, :math:`u = -K (v, a, j, s)`: it takes back a tilt that points the wrong way
while it brakes, which feedback of the velocity alone does not. The wish is cut to the tilt that
the planner may use as well, along its own direction; the lag bounds the jerk.

It knows no walls or points. It keeps them because the barrier counts on a deceleration that this
law exceeds in every direction: from a state with :math:`h \ge \lambda` the plan stops before the
wall (``tests/fsw/autopilot/control/test_braking.py`` says from which states), or before the tangent
plane that a point's ball lies behind. A sphere that moves on with its target leaves a vehicle at
rest behind.

Source: docs/concepts/tick-and-time.md, docs/decisions/0015-tick-grid-and-planner-process.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import solve_continuous_are

from fsw.autopilot.geometry.vectors import clamp_magnitude
from fsw.autopilot.model.airframe import GRAVITY, Airframe
from fsw.autopilot.model.prediction import A, J, S, V, continuous_model
from fsw.autopilot.signals import PlanInput, PredictionState


@dataclass(frozen=True, slots=True)
class BrakeTuning:
    """How hard to brake."""

    input_weight: float = 0.02  # LQR weight of (m/s^2)^2 against (m/s)^2
    vertical_rate: float = 4.0  # 1/s
    vertical: float = 2.0  # m/s^2
    joint_rate: float = 6.0  # 1/s
    joint: float = 5.0  # rad/s^2
    yaw: float = 0.1  # rad/s^2; the rotors' drag gives hardly more


class Brake:
    """The braking law of one prediction model."""

    def __init__(self, airframe: Airframe, tilt: float, tuning: BrakeTuning | None = None) -> None:
        """Solve for the gains; ``tilt`` [rad] is the planner's own limit, ``PLN_TILT_MAX``."""
        self._tuning = tuning or BrakeTuning()
        self._tilt_slope = math.tan(tilt)
        self._gains = _gains(airframe, self._tuning.input_weight)

    def __call__(self, x: PredictionState) -> PlanInput:
        """The input that brings a state of the plan towards rest."""
        tuning = self._tuning
        vertical = clamp_magnitude(-tuning.vertical_rate * x.v[2], tuning.vertical)
        kv, ka, kj, ks = self._gains
        wish_x = -(kv * x.v[0] + ka * x.a[0] + kj * x.j[0] + ks * x.s[0])
        wish_y = -(kv * x.v[1] + ka * x.a[1] + kj * x.j[1] + ks * x.s[1])
        # The thrust points along a - g: the same tilt is less acceleration while descending.
        most = self._tilt_slope * (GRAVITY - max(vertical, 0.0))
        scale = min(1.0, most / max(math.hypot(wish_x, wish_y), 1e-9))
        joints = tuple(
            [clamp_magnitude(-tuning.joint_rate * rate, tuning.joint) for rate in x.qd_arm]
        )
        return PlanInput(
            (scale * wish_x, scale * wish_y, vertical),
            clamp_magnitude(-x.yaw_rate, tuning.yaw),
            joints,
        )


@lru_cache(maxsize=64)
def _gains(airframe: Airframe, input_weight: float) -> tuple[float, float, float, float]:
    """On velocity, acceleration, jerk and snap of one horizontal axis."""
    if airframe.attitude_lag.at_once:
        return 1.0 / math.sqrt(input_weight), 0.0, 0.0, 0.0
    a, b = continuous_model(airframe)
    axis = [V, A, J, S]
    a_axis, b_axis = a[np.ix_(axis, axis)], b[axis, :1]
    riccati = solve_continuous_are(a_axis, b_axis, np.diag([1.0, 0.0, 0.0, 0.0]), [[input_weight]])
    kv, ka, kj, ks = (b_axis.T @ riccati / input_weight)[0].tolist()
    return kv, ka, kj, ks
