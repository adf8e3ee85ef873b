"""Gradients of the horizon against finite differences in the inputs."""

from __future__ import annotations

import numpy as np

from fsw.model.airframe import AIRFRAME
from fsw.model.linearisation import BASE, END_EFFECTOR, JOINT2, Linearisation
from fsw.model.prediction import INPUTS, Array, condense, discretise
from tests.fsw.model.geometry_by_rotation import tips_of_prediction
from tests.fsw.random_states import prediction_vector

HORIZON = 5
MODEL = condense(AIRFRAME, 0.1, HORIZON)
STEP = 1e-6


def around(start: Array, inputs: Array) -> Linearisation:
    horizon = Linearisation(MODEL)
    horizon.refill(start, inputs)
    return horizon


def random_horizon(random: np.random.Generator) -> tuple[Array, Array]:
    return prediction_vector(random), random.uniform(-2.0, 2.0, INPUTS * HORIZON)


def test_points_of_every_node_are_those_of_the_stepped_state() -> None:
    random = np.random.default_rng(1)
    a, b = discretise(AIRFRAME, 0.1)
    for _ in range(10):
        start, inputs = random_horizon(random)
        horizon = around(start, inputs)
        x = start
        for node in range(HORIZON + 1):
            swung = tips_of_prediction(x, np.array(AIRFRAME.link_length))
            np.testing.assert_allclose(horizon.position[node, BASE], x[0:3], atol=1e-10)
            np.testing.assert_allclose(horizon.velocity[node, BASE], x[3:6], atol=1e-10)
            np.testing.assert_allclose(horizon.position[node, JOINT2:], swung, atol=1e-10)
            if node < HORIZON:
                x = a @ x + b @ inputs[INPUTS * node : INPUTS * (node + 1)]


def test_gradients_equal_finite_differences_over_random_states() -> None:
    random = np.random.default_rng(2)
    for _ in range(6):
        start, inputs = random_horizon(random)
        horizon = around(start, inputs)
        for column in range(INPUTS * HORIZON):
            step = np.zeros_like(inputs)
            step[column] = STEP
            above, below = around(start, inputs + step), around(start, inputs - step)
            for gradient, high, low in (
                (horizon.d_position, above.position, below.position),
                (horizon.d_velocity, above.velocity, below.velocity),
                (horizon.d_arm_com, above.arm_com, below.arm_com),
            ):
                np.testing.assert_allclose(
                    gradient[..., column], (high - low) / (2.0 * STEP), atol=3e-8, rtol=1e-6
                )


def test_refilling_forgets_the_previous_guess() -> None:
    random = np.random.default_rng(3)
    used = Linearisation(MODEL)
    used.refill(*random_horizon(random))
    start, inputs = random_horizon(random)
    used.refill(start, inputs)
    fresh = around(start, inputs)
    for name in ("states", "position", "velocity", "d_position", "d_velocity", "d_arm_com"):
        np.testing.assert_array_equal(getattr(used, name), getattr(fresh, name))


def test_a_forward_command_swings_the_end_effector_back_before_it_goes_forward() -> None:
    start, inputs = np.zeros(19), np.zeros(INPUTS * HORIZON)
    horizon = around(start, inputs)
    # The base only moves forward; the tip of the hanging arm first swings back with the tilt.
    assert (horizon.d_position[1:, BASE, 0, 0] > 0.0).all()
    assert horizon.d_position[1, END_EFFECTOR, 0, 0] < 0.0
    assert horizon.d_position[5, END_EFFECTOR, 0, 0] > 0.0
