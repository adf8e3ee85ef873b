"""The discrete prediction against the continuous model it stands for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fsw.autopilot.model.airframe import AIRFRAME, AttitudeLag
from fsw.autopilot.model.nominal import NominalModel
from fsw.autopilot.model.prediction import Array, condense, discretise, to_vector
from fsw.autopilot.signals import PlanInput
from tests.fsw.paper_arm import INPUTS, STATES
from tests.fsw.random_states import as_state, prediction_vector

LAG = AttitudeLag(kp=50.0, kd=15.0)
VEHICLE = replace(AIRFRAME, attitude_lag=LAG, rotor_lag=0.04)


def equations_of_motion(x: Array, u: Array) -> Array:
    """The module's differential equations written out, axis by axis."""
    rate = np.zeros(STATES)
    rate[0:3], rate[3:6] = x[3:6], x[6:9]
    for axis in (0, 1):
        a, j, s = x[6 + axis], x[9 + axis], x[11 + axis]
        rate[6 + axis], rate[9 + axis] = j, s
        rate[11 + axis] = (LAG.kp * (u[axis] - a) - LAG.kd * j - s) / VEHICLE.rotor_lag
    rate[8] = (u[2] - x[8]) / VEHICLE.rotor_lag
    rate[13], rate[14] = x[14], u[3]
    rate[15::2], rate[16::2] = x[16::2], u[4:6]
    return rate


def integrated(x: Array, u: Array, seconds: float) -> Array:
    answer = solve_ivp(
        lambda _, state: equations_of_motion(state, u), (0.0, seconds), x, rtol=1e-11, atol=1e-11
    )
    return np.asarray(answer.y[:, -1])


@pytest.mark.parametrize("period", [0.002, 0.1])
def test_one_discrete_step_equals_the_integrated_motion(period: float) -> None:
    random = np.random.default_rng(1)
    a, b = discretise(VEHICLE, period)
    for _ in range(10):
        x, u = prediction_vector(random), random.uniform(-3.0, 3.0, INPUTS)
        np.testing.assert_allclose(a @ x + b @ u, integrated(x, u, period), atol=1e-8)


def test_condensed_horizon_equals_stepping_through_it() -> None:
    random = np.random.default_rng(2)
    model = condense(VEHICLE, 0.1, 5)
    a, b = discretise(VEHICLE, 0.1)
    start, inputs = prediction_vector(random), random.uniform(-3.0, 3.0, INPUTS * 5)
    x = start
    for node in range(6):
        np.testing.assert_allclose(
            model.phi[node] @ start + model.gamma[node] @ inputs, x, atol=1e-10
        )
        if node < 5:
            x = a @ x + b @ inputs[INPUTS * node : INPUTS * (node + 1)]


def test_an_input_moves_nothing_before_its_node() -> None:
    gamma = condense(VEHICLE, 0.1, 5).gamma
    for node in range(6):
        assert not gamma[node][:, INPUTS * node :].any()


def test_a_held_command_is_reached_at_rest_in_jerk_and_snap() -> None:
    x = np.zeros(STATES)
    u = np.array([1.0, -0.5, 0.3, 0.0, 0.0, 0.0])
    a, b = discretise(VEHICLE, 0.1)
    for _ in range(100):
        x = a @ x + b @ u
    np.testing.assert_allclose(x[6:13], [1.0, -0.5, 0.3, 0.0, 0.0, 0.0, 0.0], atol=1e-9)


def test_plain_float_model_equals_the_matrices_at_the_ticks_rate() -> None:
    random = np.random.default_rng(3)
    a, b = discretise(VEHICLE, 0.002)
    plain = NominalModel(VEHICLE, 0.002)
    for _ in range(50):
        x, u = prediction_vector(random), random.uniform(-3.0, 3.0, INPUTS)
        command = PlanInput((u[0], u[1], u[2]), u[3], (u[4], u[5]))
        np.testing.assert_allclose(
            to_vector(plain.advance(as_state(x), command)), a @ x + b @ u, atol=1e-11
        )


def test_fifty_plain_ticks_make_one_planning_period() -> None:
    random = np.random.default_rng(4)
    x, u = prediction_vector(random), random.uniform(-3.0, 3.0, INPUTS)
    a, b = discretise(VEHICLE, 0.1)
    command = PlanInput((u[0], u[1], u[2]), u[3], (u[4], u[5]))
    moved = NominalModel(VEHICLE, 0.002).advance(as_state(x), command, 50)
    np.testing.assert_allclose(to_vector(moved), a @ x + b @ u, atol=1e-9)


def test_vector_layout_keeps_every_entry() -> None:
    x = np.arange(STATES, dtype=float)
    np.testing.assert_array_equal(to_vector(as_state(x)), x)
