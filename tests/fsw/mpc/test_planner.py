"""What a plan promises, and what never becomes one."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fsw.model.airframe import AIRFRAME
from fsw.model.prediction import INPUTS, Array, condense, to_vector
from fsw.mpc.ocp import Ocp
from fsw.mpc.planner_config import PlannerConfig
from fsw.shapes.half_space import wall
from fsw.shapes.target_sphere import target_sphere
from fsw.signals import (
    EndEffectorTarget,
    Plan,
    PlanFailure,
    PlanInput,
    PredictionState,
    SafeSet,
    SolverStatus,
)
from tests.fsw.model.geometry_by_rotation import tips_of_prediction
from tests.fsw.mpc.requests import PERIOD_US, STILL, below, hovering, planned, planner, request
from tests.fsw.random_states import as_state, prediction_vector, vec3

CONFIG = PlannerConfig()
MODEL = condense(AIRFRAME, CONFIG.period, CONFIG.horizon)
AHEAD = SafeSet((wall((-1.0, 0.0, 0.0), -1.0, 0.1),))
SPHERE = SafeSet((target_sphere((0.0, 0.0, -0.225), 0.075),))


def flat(plan: Plan) -> Array:
    return np.array([(*u.a, u.yaw_acc, *u.qdd_arm) for u in plan.inputs])


def nodes_of(plan: Plan) -> Array:
    """Predicted states (n + 1, 19)."""
    return MODEL.phi @ to_vector(plan.start) + MODEL.gamma @ flat(plan).ravel()


@pytest.mark.parametrize("safe_set", [SafeSet(), AHEAD, SPHERE], ids=["open", "walls", "sphere"])
def test_inputs_keep_their_limits_however_hard_the_target_pulls(safe_set: SafeSet) -> None:
    random, limits, plans = np.random.default_rng(1), CONFIG.limits, 0
    for _ in range(15):
        start = prediction_vector(random)
        start[3:] *= 0.3
        target = EndEffectorTarget(0, vec3(random.uniform(-5.0, 5.0, 3)), STILL, STILL)
        answer = planner().plan(request(as_state(start), target, safe_set))
        if isinstance(answer, PlanFailure):
            continue
        plans += 1
        for ax, ay, az, yaw, *joints in flat(answer):
            assert math.hypot(ax, ay) <= math.tan(limits.tilt) * (9.81 - az) + 1e-4
            assert abs(az) <= limits.vertical + 1e-4
            assert abs(yaw) <= limits.yaw_acc + 1e-4
            assert np.abs(joints).max() <= limits.joint_acc + 1e-4
    assert plans >= 14


def test_joints_stay_within_their_limits_when_the_target_is_out_of_reach() -> None:
    """Far behind and above: the arm folds up to its stops, not through them."""
    for side in (-1.0, 1.0):
        target = EndEffectorTarget(0, (side * 3.0, 0.0, -2.0), STILL, STILL)
        answer = planned(planner().plan(request(hovering(), target)))
        angles = nodes_of(answer)[:, 15:17]
        assert np.abs(angles[:, 0]).max() <= AIRFRAME.joint1_limit + 1e-3
        assert np.abs(angles.sum(axis=1)).max() <= AIRFRAME.joint12_limit + 1e-3
        assert np.abs(angles).max() > 0.1


@pytest.mark.parametrize("safe_set", [SafeSet(), AHEAD], ids=["open", "walls"])
def test_at_rest_on_its_target_the_vehicle_stays(safe_set: SafeSet) -> None:
    start = hovering()
    answer = planned(planner().plan(request(start, below(start.p), safe_set)))
    assert np.abs(flat(answer)).max() < 0.02
    assert answer.cost == pytest.approx(0.0, abs=1e-3)
    assert answer.slack_max == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_plan_goes_towards_its_target(axis: int, sign: float) -> None:
    start, offset = hovering(), [0.0, 0.0, 0.0]
    offset[axis] = sign * 0.4
    target = below((start.p[0] + offset[0], start.p[1] + offset[1], start.p[2]))
    last = nodes_of(planned(planner().plan(request(start, target))))[-1]
    end_effector = tips_of_prediction(last, np.array(AIRFRAME.link_length))[1]
    assert sign * end_effector[axis] > 0.05
    assert abs(end_effector[1 - axis]) < 0.005


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_plan_climbs_and_sinks_towards_its_target(sign: float) -> None:
    start = hovering()
    target = below((start.p[0], start.p[1], start.p[2] + sign * 0.4))
    ends = nodes_of(planned(planner().plan(request(start, target))))[-1]
    assert sign * (ends[2] - start.p[2]) > 0.05


def test_a_wall_between_vehicle_and_target_is_kept_without_slack() -> None:
    start = hovering((0.3, 0.0, -1.2))
    target = below((2.0, 0.0, -1.2))
    free = planned(planner().plan(request(start, target)))
    held = planned(planner().plan(request(start, target, AHEAD)))
    assert held.slack_max == pytest.approx(0.0, abs=1e-4)
    assert nodes_of(held)[-1, 0] < nodes_of(free)[-1, 0]
    speed_left = 4.0 * (0.9 - nodes_of(held)[:, 0]) - nodes_of(held)[:, 3]
    assert (speed_left > 0.0).all()


def test_outside_the_safe_set_it_is_softened_and_the_plan_returns() -> None:
    start = hovering((1.2, 0.0, -1.2))  # beyond the wall
    answer = planned(planner().plan(request(start, below(start.p), AHEAD)))
    assert answer.barrier[0] < 0.0
    assert nodes_of(answer)[-1, 3] < -0.05  # on its way back


NOT_NUMBERS = [math.nan, math.inf, -math.inf]


@pytest.mark.parametrize("value", NOT_NUMBERS)
@pytest.mark.parametrize("name", ["p", "v", "a", "j", "s", "yaw", "yaw_rate", "q_arm", "qd_arm"])
def test_a_start_that_is_no_number_is_refused(name: str, value: float) -> None:
    start = hovering()
    whole = getattr(start, name)
    broken: Any = (value, *whole[1:]) if isinstance(whole, tuple) else value
    answer = planner().plan(request(start._replace(**{name: broken}), below(start.p)))
    assert isinstance(answer, PlanFailure)
    assert answer.status is SolverStatus.INPUT_REFUSED
    assert answer.plan_id == 7


@pytest.mark.parametrize("value", NOT_NUMBERS)
@pytest.mark.parametrize("name", ["p_WE", "v_WE"])
def test_a_target_that_is_no_number_is_refused(name: str, value: float) -> None:
    start = hovering()
    good = below(start.p)
    broken: Any = {name: (0.0, value, 0.0)}
    asked = request(start, good)
    asked = replace(asked, targets=(*asked.targets[:-1], replace(good, **broken)))
    answer = planner().plan(asked)
    assert isinstance(answer, PlanFailure)
    assert answer.status is SolverStatus.INPUT_REFUSED


@pytest.mark.parametrize("count", [0, 1, 5, 7])
def test_a_wrong_number_of_targets_is_refused(count: int) -> None:
    start = hovering()
    asked = request(start, below(start.p))
    answer = planner().plan(replace(asked, targets=(asked.targets[0],) * count))
    assert isinstance(answer, PlanFailure)
    assert answer.status is SolverStatus.INPUT_REFUSED


@pytest.mark.parametrize(
    "safe_set",
    [
        SafeSet((wall((math.nan, 0.0, 0.0), -1.0, 0.1),)),
        SafeSet((wall((-1.0, 0.0, 0.0), math.inf, 0.1),)),
        SafeSet((target_sphere((0.0, 0.0, math.nan), 0.075),)),
        SafeSet((target_sphere((0.0, 0.0, -0.2), math.nan),)),
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
def test_a_safe_set_that_is_no_number_never_becomes_a_plan(safe_set: SafeSet) -> None:
    start = hovering()
    assert isinstance(planner().plan(request(start, below(start.p), safe_set)), PlanFailure)


def test_a_refusal_does_not_spoil_the_next_plan() -> None:
    start, used = hovering(), planner()
    used.plan(request(start, below((0.5, 0.0, -1.2))))
    nowhere = start._replace(p=(math.nan, 0.0, 0.0))
    used.plan(request(nowhere, below(start.p), t_us=1_100_000))
    again = planned(used.plan(request(start, below((0.5, 0.0, -1.2)), t_us=1_200_000)))
    fresh = planned(planner().plan(request(start, below((0.5, 0.0, -1.2)), t_us=1_200_000)))
    np.testing.assert_allclose(flat(again), flat(fresh), atol=1e-9)


def test_the_same_question_has_the_same_answer() -> None:
    asked = request(hovering(), below((0.5, 0.2, -1.0)), AHEAD)
    assert planner().plan(asked) == planner().plan(asked)


def test_a_change_of_the_safe_set_changes_the_plan_at_once() -> None:
    start, target, used = hovering((0.75, 0.0, -1.2)), below((2.0, 0.0, -1.2)), planner()
    free = planned(used.plan(request(start, target, t_us=1_000_000)))
    held = planned(used.plan(request(start, target, AHEAD, t_us=1_100_000)))
    assert free.barrier == ()
    assert len(held.barrier) == 3
    assert nodes_of(held)[-1, 0] < nodes_of(free)[-1, 0] - 0.02


def test_the_last_plan_moved_on_by_a_period_is_the_next_guess(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    guesses: list[Array] = []
    linearise = Ocp.linearise

    def recorded(self: Ocp, start: Array, guess: Array, targets: Any) -> None:
        guesses.append(guess.copy())
        linearise(self, start, guess, targets)

    used, target = planner(), below((0.5, 0.0, -1.2))
    first = flat(planned(used.plan(request(hovering(), target))))
    monkeypatch.setattr(Ocp, "linearise", recorded)
    used.plan(request(hovering(), target, t_us=1_000_000 + PERIOD_US))
    expected = np.vstack((first[1:], first[-1:]))
    np.testing.assert_array_equal(guesses[0].reshape(-1, INPUTS), expected)
    guesses.clear()
    used.plan(request(hovering(), target, t_us=9_000_000))
    assert not guesses[0].any(), "after a break the plan starts from rest"


def test_warm_up_leaves_no_trace() -> None:
    asked = request(hovering(), below((0.5, 0.2, -1.0)), SPHERE)
    warm = planner()
    warm.warm_up()
    assert warm.plan(asked) == planner().plan(asked)


def test_plan_carries_its_question() -> None:
    start: PredictionState = hovering()
    answer = planned(planner().plan(request(start, below(start.p), t_us=5_000_000)))
    assert (answer.plan_id, answer.t_us, answer.period_us) == (7, 5_000_000, PERIOD_US)
    assert answer.start == start
    assert len(answer.inputs) == CONFIG.horizon
    assert isinstance(answer.inputs[0], PlanInput)
