"""The rows of the joints' limits against angles and rates of the prediction."""

from __future__ import annotations

import numpy as np

from fsw.autopilot.model.linearisation import Linearisation
from fsw.autopilot.model.prediction import Q_ARM, QD_ARM, Array, condense
from fsw.autopilot.mpc.joint_limits import JointLimits
from fsw.autopilot.mpc.qp_data import InputLimits
from tests.fsw.paper_arm import INPUTS, with_angle_limits
from tests.fsw.random_states import prediction_vector

NODES = 4
UNLIKE = with_angle_limits(0.9, 1.3)
INPUTS_WITHIN = InputLimits(joint_rate=2.5, joint_margin=0.1)
MODEL = condense(UNLIKE, 0.1, NODES)


def angles(start: Array, inputs: Array) -> tuple[Linearisation, Array]:
    horizon = Linearisation(MODEL)
    horizon.refill(start, inputs)
    return horizon, horizon.states[1:, Q_ARM::2]


def test_each_node_is_as_far_from_its_limits_as_its_angles_and_rates_either_way() -> None:
    random = np.random.default_rng(1)
    for _ in range(20):
        start, inputs = prediction_vector(random), random.uniform(-5.0, 5.0, INPUTS * NODES)
        limits = JointLimits(MODEL, INPUTS_WITHIN)
        horizon, q = angles(start, inputs)
        limits.refill(horizon)
        left = (limits.rows.value - limits.rows.lower_bound).reshape(NODES, 8)
        rates = horizon.states[1:, QD_ARM::2]
        expected = [
            [0.8 - a, 0.8 + a, 1.2 - a - b, 1.2 + a + b, 2.5 - c, 2.5 + c, 2.5 - d, 2.5 + d]
            for (a, b), (c, d) in zip(q, rates, strict=True)
        ]
        np.testing.assert_allclose(np.sort(left), np.sort(expected), atol=1e-12)


def test_the_rows_are_linear_in_the_inputs() -> None:
    random = np.random.default_rng(2)
    start, inputs = prediction_vector(random), np.zeros(INPUTS * NODES)
    change = random.uniform(-3.0, 3.0, INPUTS * NODES)
    limits = JointLimits(MODEL, INPUTS_WITHIN)
    limits.refill(angles(start, inputs)[0])
    before = limits.rows.value.copy()
    limits.refill(angles(start, inputs + change)[0])
    np.testing.assert_allclose(
        limits.rows.value, before + limits.rows.gradient @ change, atol=1e-12
    )


def test_one_slack_a_node() -> None:
    rows = JointLimits(MODEL, INPUTS_WITHIN).rows
    assert rows.node.tolist() == [node for node in range(1, NODES + 1) for _ in range(8)]
    assert rows.slack.tolist() == [node - 1 for node in rows.node]
    assert rows.slacks == NODES
