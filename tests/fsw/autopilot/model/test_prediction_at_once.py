"""The paper's model without lag (eq 16): six double integrators, in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fsw.autopilot.model.airframe import AIRFRAME, AttitudeLag
from fsw.autopilot.model.linearisation import Linearisation
from fsw.autopilot.model.nominal import NominalModel
from fsw.autopilot.model.prediction import (
    Q_ARM,
    QD_ARM,
    YAW,
    YAW_RATE,
    A,
    P,
    V,
    condense,
    discretise,
)
from fsw.autopilot.signals import PlanInput
from tests.fsw.paper_arm import INPUTS, STATES
from tests.fsw.random_states import as_state

AT_ONCE = replace(AIRFRAME, attitude_lag=AttitudeLag(at_once=True))
MOVED = [(P, V), (P + 1, V + 1), (P + 2, V + 2), (YAW, YAW_RATE)] + [
    (Q_ARM + 2 * joint, QD_ARM + 2 * joint) for joint in range(2)
]


def test_every_input_moves_its_own_double_integrator_and_nothing_else() -> None:
    period = 0.1
    a, b = discretise(AT_ONCE, period)
    expected = np.zeros((STATES, INPUTS))
    for column, (position, rate) in enumerate(MOVED):
        expected[position, column] = 0.5 * period**2
        expected[rate, column] = period
        assert a[position, rate] == period
    np.testing.assert_allclose(b, expected, atol=1e-15)
    np.testing.assert_array_equal(a[V : V + 3, A:], 0.0)


def test_braking_takes_the_distance_of_the_textbook() -> None:
    # v^2 / (2 u): 1 m/s at -2 m/s^2 stops after 0.25 m in five periods of 0.1 s.
    model = condense(AT_ONCE, 0.1, 5)
    start = np.zeros(STATES)
    start[V] = 1.0
    inputs = np.tile([-2.0, 0.0, 0.0, 0.0, 0.0, 0.0], 5)
    end = model.phi[5] @ start + model.gamma[5] @ inputs
    np.testing.assert_allclose(end[[P, V]], [0.25, 0.0], atol=1e-12)


def test_the_arm_hangs_in_a_level_body_whatever_is_commanded() -> None:
    model = condense(AT_ONCE, 0.1, 3)
    horizon = Linearisation(model)
    inputs = np.tile([3.0, -2.0, 1.0, 0.0, 0.0, 0.0], 3)
    horizon.refill(np.zeros(STATES), inputs)
    below = horizon.tracked.position - horizon.states[:, P : P + 3]
    np.testing.assert_allclose(below, np.tile([0.0, 0.0, 0.3], (4, 1)), atol=1e-15)


def test_ticks_add_up_to_the_period() -> None:
    x = np.zeros(STATES)
    x[V], x[QD_ARM] = 0.3, -0.2
    u = PlanInput((1.0, -2.0, 0.5), 0.1, (3.0, -4.0))
    ticks = NominalModel(AT_ONCE, 0.002).advance(as_state(x), u, 50)
    a, b = discretise(AT_ONCE, 0.1)
    whole = as_state(a @ x + b @ np.array([*u.a, u.yaw_acc, *u.qdd_arm]))
    for name in ("p", "v", "a", "q_arm", "qd_arm"):
        np.testing.assert_allclose(getattr(ticks, name), getattr(whole, name), atol=1e-12)
