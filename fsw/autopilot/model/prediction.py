r"""The planner's prediction model: six double integrators with the attitude's lag in between.

The paper's model (eq 16) takes the commanded acceleration as reached at once. The real
vehicle must tilt first: a horizontal acceleration follows its command through the attitude
loop and the rotors, a vertical one through the rotors alone. With the attitude loop
:math:`\ddot\vartheta = k_p(\vartheta_d - \vartheta) - k_d\dot\vartheta` and rotor lag
:math:`\tau`, and acceleration proportional to tilt, each horizontal axis is

.. math:: \dot p = v,\; \dot v = a,\; \dot a = j,\; \dot j = s,\;
          \dot s = (k_p (u - a) - k_d j - s)/\tau

and the vertical axis :math:`\dot a = (u - a)/\tau`. Yaw and joints stay double integrators.
The paper's own model is there as well, for a plant that is one: ``AttitudeLag(at_once=True)``.
The chain is linear, time-invariant and the same in x and y, so it is discretised exactly
once (zero-order hold) and condensed once.

Source: docs/equations.md E15b, E16, E17; docs/decisions/0002-prediction-knows-the-attitude-lag.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.signals import PredictionState
from fsw.autopilot.tick_record import PlanState
from fsw.compiled import compilable

Array = NDArray[np.float64]

# Layout of the prediction state as a vector.
P, V, A, J, S = 0, 3, 6, 9, 11
YAW, YAW_RATE, Q_ARM, QD_ARM = 13, 14, 15, 17
STATES = 19
INPUTS = 6


@dataclass(frozen=True)
class CondensedModel:
    """Prediction over a horizon: ``x_i = phi[i] x_0 + gamma[i] U`` for i = 0..n."""

    airframe: Airframe
    horizon: int
    period: float  # s
    phi: Array  # (n + 1, 19, 19)
    gamma: Array  # (n + 1, 19, 6 n)


def continuous_model(airframe: Airframe) -> tuple[Array, Array]:
    """Continuous-time A (19, 19) and B (19, 6) of the module docstring."""
    a = np.zeros((STATES, STATES))
    b = np.zeros((STATES, INPUTS))
    for axis in range(3):
        a[P + axis, V + axis] = 1.0
        if airframe.attitude_lag.at_once:
            b[V + axis, axis] = 1.0
    if not airframe.attitude_lag.at_once:
        _add_lag(airframe, a, b)
    a[YAW, YAW_RATE] = 1.0
    b[YAW_RATE, 3] = 1.0
    for joint in range(2):
        a[Q_ARM + joint, QD_ARM + joint] = 1.0
        b[QD_ARM + joint, 4 + joint] = 1.0
    return a, b


def _add_lag(airframe: Airframe, a: Array, b: Array) -> None:
    """From commanded acceleration to velocity, through attitude and rotors."""
    lag, rotor_lag = airframe.attitude_lag, airframe.rotor_lag
    for axis in range(3):
        a[V + axis, A + axis] = 1.0
    for axis in range(2):
        a[A + axis, J + axis] = 1.0
        a[J + axis, S + axis] = 1.0
        a[S + axis, [A + axis, J + axis, S + axis]] = np.array([-lag.kp, -lag.kd, -1.0]) / rotor_lag
        b[S + axis, axis] = lag.kp / rotor_lag
    a[A + 2, A + 2] = -1.0 / rotor_lag
    b[A + 2, 2] = 1.0 / rotor_lag


def discretise(airframe: Airframe, period: float) -> tuple[Array, Array]:
    """Exact zero-order-hold A (19, 19) and B (19, 6) over one ``period`` [s]."""
    exponential = _exponential(airframe, period)
    return exponential[:STATES, :STATES].copy(), exponential[:STATES, STATES:].copy()


@lru_cache(maxsize=64)
def _exponential(airframe: Airframe, period: float) -> Array:
    a, b = continuous_model(airframe)
    block = np.zeros((STATES + INPUTS, STATES + INPUTS))
    block[:STATES, :STATES] = a * period
    block[:STATES, STATES:] = b * period
    exponential: Array = expm(block)
    return exponential


def condense(airframe: Airframe, period: float, horizon: int) -> CondensedModel:
    """Stack the model of one ``period`` [s] over the horizon, inputs as the only unknowns."""
    a, b = discretise(airframe, period)
    phi = np.zeros((horizon + 1, STATES, STATES))
    gamma = np.zeros((horizon + 1, STATES, INPUTS * horizon))
    phi[0] = np.eye(STATES)
    for i in range(horizon):
        phi[i + 1] = a @ phi[i]
        gamma[i + 1] = a @ gamma[i]
        gamma[i + 1, :, INPUTS * i : INPUTS * (i + 1)] = b
    return CondensedModel(airframe=airframe, horizon=horizon, period=period, phi=phi, gamma=gamma)


@compilable
def to_vector(state: PredictionState | PlanState) -> Array:
    """The prediction state in the layout of this module, (19,)."""
    return np.array(
        (
            *(state.p[0], state.p[1], state.p[2]),
            *(state.v[0], state.v[1], state.v[2]),
            *(state.a[0], state.a[1], state.a[2]),
            *(state.j[0], state.j[1]),
            *(state.s[0], state.s[1]),
            *(state.yaw, state.yaw_rate),
            *(state.q_arm[0], state.q_arm[1]),
            *(state.qd_arm[0], state.qd_arm[1]),
        )
    )
