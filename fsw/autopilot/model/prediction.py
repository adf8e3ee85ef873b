r"""The planner's prediction model: double integrators with the attitude's lag in between.

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
from fsw.compiled import compilable

Array = NDArray[np.float64]

# Layout of the prediction state as a vector. Yaw and each joint are an angle and its rate: those of
# joint i are at Q_ARM + 2 i and QD_ARM + 2 i.
P, V, A, J, S = 0, 3, 6, 9, 11
YAW, YAW_RATE, Q_ARM, QD_ARM = 13, 14, 15, 16
YAW_ACC, QDD_ARM = 3, 4  # of the inputs, after the accelerations of the base


@compilable
def states_of(joints: int) -> int:
    """How many numbers a prediction state has of a vehicle with ``joints`` [1]."""
    return Q_ARM + 2 * joints


@compilable
def inputs_of(joints: int) -> int:
    """How many inputs a node has of a vehicle with ``joints`` [1]."""
    return QDD_ARM + joints


@dataclass(frozen=True)
class CondensedModel:
    """Prediction over a horizon: ``x_i = phi[i] x_0 + gamma[i] U`` for i = 0..n."""

    airframe: Airframe
    horizon: int
    period: float  # s
    phi: Array  # (n + 1, states, states)
    gamma: Array  # (n + 1, states, inputs n)

    @property
    def states(self) -> int:
        """Numbers in a state."""
        return states_of(self.airframe.bodies.joints)

    @property
    def inputs(self) -> int:
        """Inputs of a node."""
        return inputs_of(self.airframe.bodies.joints)


def continuous_model(airframe: Airframe) -> tuple[Array, Array]:
    """Continuous-time A (states, states) and B (states, inputs) of the module docstring."""
    joints = airframe.bodies.joints
    a = np.zeros((states_of(joints), states_of(joints)))
    b = np.zeros((states_of(joints), inputs_of(joints)))
    for axis in range(3):
        a[P + axis, V + axis] = 1.0
        if airframe.attitude_lag.at_once:
            b[V + axis, axis] = 1.0
    if not airframe.attitude_lag.at_once:
        _add_lag(airframe, a, b)
    a[YAW, YAW_RATE] = 1.0
    b[YAW_RATE, YAW_ACC] = 1.0
    for joint in range(joints):
        a[Q_ARM + 2 * joint, QD_ARM + 2 * joint] = 1.0
        b[QD_ARM + 2 * joint, QDD_ARM + joint] = 1.0
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
    """Exact zero-order-hold A (states, states), B (states, inputs) over one ``period`` [s]."""
    a, b = _discrete(airframe, period)
    return a.copy(), b.copy()


@lru_cache(maxsize=64)
def _discrete(airframe: Airframe, period: float) -> tuple[Array, Array]:
    return zero_order_hold(*continuous_model(airframe), period)


def zero_order_hold(a: Array, b: Array, period: float) -> tuple[Array, Array]:
    """What ``a`` (n, n) [1/s] and ``b`` (n, m) [SI/s] do in a ``period`` [s], with inputs held."""
    n, m = b.shape
    block = np.zeros((n + m, n + m))
    block[:n, :n], block[:n, n:] = a * period, b * period
    exponential = expm(block)
    return exponential[:n, :n], exponential[:n, n:]


def condense(airframe: Airframe, period: float, horizon: int) -> CondensedModel:
    """Stack the model of one ``period`` [s] over the horizon, inputs as the only unknowns."""
    a, b = discretise(airframe, period)
    states, inputs = b.shape
    phi = np.zeros((horizon + 1, states, states))
    gamma = np.zeros((horizon + 1, states, inputs * horizon))
    phi[0] = np.eye(states)
    for i in range(horizon):
        phi[i + 1] = a @ phi[i]
        gamma[i + 1] = a @ gamma[i]
        gamma[i + 1, :, inputs * i : inputs * (i + 1)] = b
    return CondensedModel(airframe=airframe, horizon=horizon, period=period, phi=phi, gamma=gamma)


def to_vector(state: PredictionState) -> Array:
    """The prediction state in the layout of this module, (states,)."""
    arm = [number for joint in zip(state.q_arm, state.qd_arm, strict=True) for number in joint]
    base = *state.p, *state.v, *state.a, *state.j, *state.s, state.yaw, state.yaw_rate
    return np.array((*base, *arm))
