"""Environments of Gymnasium: its own checker, seeds, units, and the referee of every flight."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import pandion
from pandion.environments import EFFORT, PENALTY, PandionEnv
from sitl.scenario import vehicle_of
from sitl.scenario_file import load_scenario
from sitl.simulation import Controls, Simulation
from vehicles.vehicle_file import vehicle_names

IDS = ("pandion/Walls-v0", "pandion/Workspace-v0")
each = pytest.mark.parametrize("name", IDS)
each_vehicle = pytest.mark.parametrize("vehicle", vehicle_names())
NOTHING = np.zeros(6, dtype=np.float32)


def hover(env: PandionEnv) -> np.ndarray:
    """The action that holds the vehicle as it starts, by the vehicle's file."""
    flown, (thrust, torque) = vehicle_of(env._scenario), pandion.Simulator(env._scenario).hover
    most = np.array([rotor.thrust_max for rotor in flown.rotors])
    h, share = flown.mass * 9.81 / most.sum(), thrust / most
    lift = np.where(share > h, (share - h) / (1.0 - h), share / h - 1.0)
    drive = torque / [joint.torque_max for joint in flown.joints]
    return np.array([*lift, *drive], dtype=np.float32)


@pytest.mark.drawn(5)
@each
@each_vehicle
def test_gymnasiums_own_checker_finds_nothing(name: str, vehicle: str) -> None:
    if (name, vehicle) == ("pandion/Workspace-v0", "probe-2r"):
        pytest.skip("its tool is ahead of its base: no workspace below it")
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        check_env(gymnasium.make(name, vehicle=vehicle).unwrapped)


@each
@each_vehicle
def test_stable_baselines3s_checker_finds_nothing(name: str, vehicle: str) -> None:
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        checker.check_env(gymnasium.make(name, vehicle=vehicle).unwrapped)


def test_vectors_step_together() -> None:
    envs = gymnasium.make_vec("pandion/Walls-v0", num_envs=3)
    seen, _ = envs.reset(seed=5)
    alone = gymnasium.make("pandion/Walls-v0")
    one, _ = alone.reset(seed=6)
    np.testing.assert_array_equal(seen[1], one)
    batch, rewards, *_ = envs.step(np.zeros((3, 6), dtype=np.float32))
    assert batch.shape == (3, 28)
    np.testing.assert_array_equal(batch[1], alone.step(NOTHING)[0])
    assert (rewards < 0.0).all()


@each
def test_a_seed_repeats_an_episode_and_another_does_not(name: str) -> None:
    env = PandionEnv("walls" if "Walls" in name else "workspace")
    action, ends = hover(env), []
    for seed in (1, 1, 2):
        env.reset(seed=seed)
        ends.append([env.step(action)[0] for _ in range(20)][-1])
    np.testing.assert_array_equal(ends[0], ends[1])
    assert not np.array_equal(ends[0], ends[2])


@each_vehicle
def test_an_observation_is_the_truth_in_the_units_of_its_docs(vehicle: str) -> None:
    env = PandionEnv("walls", vehicle=vehicle)
    joints = len(vehicle_of(env._scenario).joints)
    env.reset(seed=3)
    action = hover(env) + np.float32(0.01)
    for _ in range(15):
        seen, reward, failed, over, info = env.step(action)
    truth = env._simulation.truth()
    assert seen.shape == env.observation_space.shape == (21 + 2 * joints + 3,)
    expected = [
        *np.subtract(truth.target.p, truth.p_WE),
        *truth.v_WB,
        *seen[6:15],
        *truth.w_WB_B,
        *truth.q_arm,
        *truth.qd_arm,
        *truth.target.v,
        *np.reshape(truth.margins_m, (3, 3)).min(axis=1),
    ]
    np.testing.assert_allclose(seen, expected, rtol=1e-5, atol=1e-6)
    seen_by_hand = pandion.Simulator(env._scenario).observe()
    assert seen_by_hand.R_WB.shape == (3, 3)
    R = seen[6:15].reshape(3, 3)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-6)
    w, x, y, z = truth.q_WB
    assert R[1, 0] == pytest.approx(2.0 * (x * y + w * z), abs=1e-6)
    assert (failed, over) == (False, False)
    assert reward == pytest.approx(-info["error_m"] - EFFORT * float((action**2).sum()), abs=1e-6)
    assert info["error_m"] == pytest.approx(float(np.linalg.norm(seen[:3])), rel=1e-5)
    assert info["margin_m"] == pytest.approx(min(truth.margins_m), abs=1e-9)


def test_an_episode_ends_by_the_referee_or_its_time() -> None:
    env = PandionEnv("walls", duration_s=0.5)
    env.reset(seed=0)
    steps = [env.step(hover(env)) for _ in range(25)]
    assert [one[3] for one in steps] == [False] * 24 + [True]
    assert not any(one[2] for one in steps)
    falling = PandionEnv("walls")
    falling.reset(seed=0)
    off = -np.ones(6, dtype=np.float32)
    while True:
        _, reward, failed, over, info = falling.step(off)
        if failed or over:
            break
    assert failed
    assert reward < -PENALTY
    assert "hit the ground" in info["reason"] or "margin" in info["reason"]


def test_what_is_no_such_environment_is_refused() -> None:
    windy = pandion.load_scenario("walls")
    windy = replace(windy, air=replace(windy.air, wind_m_s=(1.0, 0.0, 0.0), body_drag_m2=0.1))
    with pytest.raises(pandion.ScenarioError, match="in still air"):
        PandionEnv(windy)
    with pytest.raises(pandion.ScenarioError, match="did you mean"):
        PandionEnv("wals")


@pytest.mark.parametrize("name", ["walls", "branches", "workspace"])
def test_a_leap_is_its_steps(name: str) -> None:
    """Disturbances come in the same steps, and the referee sees the same."""
    one, leaping, coarse = (Simulation(load_scenario(name), 3) for _ in range(3))
    trim = one.trim
    controls = Controls(
        tuple(f / 17.1675 for f in trim.thrust), tuple(t / 2.0 for t in trim.torque), armed=True
    )
    for steps in (10, 1, 60, 7, 33):
        for _ in range(steps):
            one.advance(controls)
        leaping.leap(controls, steps)
        coarse.leap(controls, steps, 0.002)
    assert leaping.step == one.step
    np.testing.assert_array_equal(one.state, leaping.state)
    np.testing.assert_allclose(one.state, coarse.state, atol=1e-6)
    assert one.result().min_margin_m == leaping.result().min_margin_m
    assert one.result().tracking_error_rms_m == leaping.result().tracking_error_rms_m
    assert math.isfinite(one.state.sum())
    measured = Simulation(pandion.load_scenario(name, sensors="mocap"), 3)
    with pytest.raises(ValueError, match="exact sensors"):
        measured.leap(controls, 10)
