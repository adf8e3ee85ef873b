"""Gradients of the horizon against finite differences in the inputs."""

from __future__ import annotations

import numpy as np
import pytest

from fsw.autopilot.model.airframe import AIRFRAME, airframe_of
from fsw.autopilot.model.kinematics import position, velocity
from fsw.autopilot.model.linearisation import (
    TURNED,
    Linearisation,
    chain,
    fill_slopes,
    fill_turned,
)
from fsw.autopilot.model.prediction import Array, condense, discretise
from tests.fsw.autopilot.model.geometry_by_rotation import tips_of_prediction
from tests.fsw.autopilot.model.three_points import (
    BASE,
    END_EFFECTOR,
    JOINT2,
    points_of,
    positions_of,
)
from tests.fsw.paper_arm import INPUTS, LENGTHS
from tests.fsw.random_states import prediction_vector, vec3
from tests.vehicles.random_vehicles import random_vehicle

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
        position, velocity = positions_of(horizon)
        x = start
        for node in range(HORIZON + 1):
            swung = tips_of_prediction(x, np.array(LENGTHS))
            np.testing.assert_allclose(position[node, BASE], x[0:3], atol=1e-10)
            np.testing.assert_allclose(velocity[node, BASE], x[3:6], atol=1e-10)
            np.testing.assert_allclose(position[node, JOINT2:], swung, atol=1e-10)
            np.testing.assert_allclose(horizon.tracked.position[node], swung[1], atol=1e-10)
            if node < HORIZON:
                x = a @ x + b @ inputs[INPUTS * node : INPUTS * (node + 1)]


def test_gradients_equal_finite_differences_over_random_states() -> None:
    random = np.random.default_rng(2)
    for _ in range(6):
        start, inputs = random_horizon(random)
        points, tracked = points_of(around(start, inputs)), around(start, inputs).tracked
        for column in range(INPUTS * HORIZON):
            step = np.zeros_like(inputs)
            step[column] = STEP
            above, below = around(start, inputs + step), around(start, inputs - step)
            high, low = positions_of(above), positions_of(below)
            for gradient, more, less in (
                (points.d_position, high[0], low[0]),
                (points.d_velocity, high[1], low[1]),
                (tracked.d_position, high[0][:, END_EFFECTOR], low[0][:, END_EFFECTOR]),
                (tracked.d_velocity, high[1][:, END_EFFECTOR], low[1][:, END_EFFECTOR]),
                (tracked.d_yaw, above.tracked.yaw, below.tracked.yaw),
                (tracked.d_arm_com, above.tracked.arm_com, below.tracked.arm_com),
            ):
                np.testing.assert_allclose(
                    gradient[..., column], (more - less) / (2.0 * STEP), atol=3e-8, rtol=1e-6
                )


@pytest.mark.parametrize("joints", range(1, 7))
def test_gradients_of_any_arm_equal_finite_differences(joints: int) -> None:
    """Of a place on every link, and of what the cost tracks, in every input."""
    random, node = np.random.default_rng(joints), HORIZON
    model = condense(airframe_of(random_vehicle(random, joints)), 0.1, HORIZON)
    unknowns = model.inputs * HORIZON
    places = [(on, vec3(random.uniform(-0.3, 0.3, 3))) for on in range(joints + 1)]
    start, inputs = prediction_vector(random, joints), random.uniform(-2.0, 2.0, unknowns)

    def at(inputs: Array) -> Linearisation:
        horizon = Linearisation(model)
        horizon.refill(start, inputs)
        return horizon

    def seen(horizon: Linearisation) -> Array:
        frame, tracked = horizon.horizon.frames[node], horizon.tracked
        found = [look(frame, *place) for place in places for look in (position, velocity)]
        found += [tracked.position[node], tracked.velocity[node], (*tracked.arm_com[node], 0.0)]
        return np.array(found)

    here = at(inputs)
    frame, tracked = here.horizon.frames[node], here.tracked
    turned, slopes = np.zeros((TURNED, 3)), np.zeros((2, model.states))
    gradient = np.zeros((2 * len(places) + 3, 3, unknowns))
    for axis, n in enumerate(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))):
        fill_turned(frame, n, turned)
        for k, place in enumerate(places):
            fill_slopes(frame, *place, n, turned, slopes)
            for row in range(2):
                chain(here.horizon.impulse, node, slopes[row], gradient[2 * k + row, axis])
    gradient[-3], gradient[-2] = tracked.d_position[node], tracked.d_velocity[node]
    gradient[-1, :2] = tracked.d_arm_com[node]
    for column, step in enumerate(STEP * np.eye(unknowns)):
        slope = (seen(at(inputs + step)) - seen(at(inputs - step))) / (2.0 * STEP)
        np.testing.assert_allclose(gradient[..., column], slope, atol=1e-7, rtol=1e-6)


def test_refilling_forgets_the_previous_guess() -> None:
    random = np.random.default_rng(3)
    used = Linearisation(MODEL)
    used.refill(*random_horizon(random))
    start, inputs = random_horizon(random)
    used.refill(start, inputs)
    fresh = around(start, inputs)
    for refilled, new in (
        (used.horizon, fresh.horizon),
        (used.tracked, fresh.tracked),
    ):
        for have, expected in zip(refilled, new, strict=True):
            np.testing.assert_array_equal(have, expected)


def test_a_forward_command_swings_the_end_effector_back_before_it_goes_forward() -> None:
    start, inputs = np.zeros(19), np.zeros(INPUTS * HORIZON)
    d_position = points_of(around(start, inputs)).d_position
    # The base only moves forward; the tip of the hanging arm first swings back with the tilt.
    assert (d_position[1:, BASE, 0, 0] > 0.0).all()
    assert d_position[1, END_EFFECTOR, 0, 0] < 0.0
    assert d_position[5, END_EFFECTOR, 0, 0] > 0.0
