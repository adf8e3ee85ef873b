"""What a plan promises, and what never becomes one."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import studies.flight.rival_planners  # noqa: F401 - whose names configurations have
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.model.prediction import Array, CondensedModel, condense, to_vector
from fsw.autopilot.mpc.ocp import Ocp
from fsw.autopilot.mpc.planner import Planner
from fsw.autopilot.mpc.planner_config import PlannerConfig
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.signals import (
    EndEffectorTarget,
    Plan,
    PlanFailure,
    PlanInput,
    PlanTimings,
    PredictionState,
    SafeSet,
    SolverStatus,
)
from tests.fsw.autopilot.model.geometry_by_rotation import tips_of_prediction
from tests.fsw.autopilot.mpc.requests import (
    PERIOD_US,
    STILL,
    below,
    hovering,
    planned,
    planner,
    request,
)
from tests.fsw.paper_arm import INPUTS, LENGTHS, LIMIT1, LIMIT12
from tests.fsw.random_states import as_state, prediction_vector, vec3

CONFIG = PlannerConfig(body="points")
MODEL = condense(AIRFRAME, CONFIG.period, CONFIG.horizon)
AHEAD = SafeSet((wall((-1.0, 0.0, 0.0), -1.0, 0.1),))
SPHERE = SafeSet((target_sphere((0.0, 0.0, -0.225), 0.075),))


def flat(plan: Plan) -> Array:
    return np.array([(*u.a, u.yaw_acc, *u.qdd_arm) for u in plan.inputs])


def nodes_of(plan: Plan) -> Array:
    """Predicted states (n + 1, 19)."""
    return MODEL.phi @ to_vector(plan.start) + MODEL.gamma @ flat(plan).ravel()


@pytest.mark.drawn(1)
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
        angles = nodes_of(answer)[:, 15::2]
        assert np.abs(angles[:, 0]).max() <= LIMIT1 + 1e-3
        assert np.abs(angles.sum(axis=1)).max() <= LIMIT12 + 1e-3
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
    end_effector = tips_of_prediction(last, np.array(LENGTHS))[1]
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


@pytest.mark.requirement("REQ-SAFE-9")
@pytest.mark.parametrize(
    ("weight", "value"),
    [
        ("inputs", 10.0),
        ("inputs", 100.0),
        ("tracking", 1000.0),
        ("tracking_terminal", 5000.0),
        ("velocity_terminal", 5000.0),
    ],
)
@pytest.mark.parametrize("speed", [0.4, 0.6])
def test_a_wall_outweighs_whatever_a_weight_is_set_to(
    speed: float, weight: str, value: float
) -> None:
    """Inputs that cost 500 times as much, set on the way to a wall, flew a rotor into it."""
    asked = hovering((0.5, 0.0, -1.2))._replace(v=(speed, 0.0, 0.0)), below((3.0, 0.0, -1.2)), AHEAD
    usual = planned(planner().plan(request(*asked)))
    weights = replace(CONFIG.weights, **{weight: value})
    answer = planned(planner(replace(CONFIG, weights=weights)).plan(request(*asked)))
    assert answer.slack_max < usual.slack_max + 0.01


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


def test_a_heading_that_is_no_number_is_refused() -> None:
    asked = request(hovering(), replace(below((0.0, 0.0, -1.2)), yaw=math.nan))
    answer = planner().plan(asked)
    assert isinstance(answer, PlanFailure)
    assert "target is not finite" in answer.reason


@pytest.mark.parametrize(
    ("joints", "reason"),
    [
        (((0.1, -0.1),) * 5, "5 joint targets given for 6 nodes"),
        (((0.1, -0.1),) * 5 + ((0.1, math.nan),), "a joint target is not finite"),
        (((math.inf, 0.0),) * 6, "a joint target is not finite"),
    ],
)
def test_joints_that_are_no_numbers_or_too_few_are_refused(joints: Any, reason: str) -> None:
    asked = request(hovering(), below((0.0, 0.0, -1.2)))
    answer = planner().plan(replace(asked, joint_targets=joints))
    assert isinstance(answer, PlanFailure)
    assert (answer.status, answer.reason) == (SolverStatus.INPUT_REFUSED, reason)
    assert answer.timings == PlanTimings(0.0, 0.0, 0.0)


def test_joints_that_are_asked_for_are_moved_towards() -> None:
    asked = request(hovering(), below((0.0, 0.0, -1.2)))
    folded = planned(planner().plan(replace(asked, joint_targets=((0.3, -0.5),) * 6)))
    first, second = nodes_of(folded)[-1, 15::2]
    assert 0.05 < first < 0.35
    assert -0.6 < second < -0.05


@pytest.mark.parametrize("count", [0, 1, 5, 7])
def test_a_wrong_number_of_targets_is_refused(count: int) -> None:
    start = hovering()
    asked = request(start, below(start.p))
    answer = planner().plan(replace(asked, targets=(asked.targets[0],) * count))
    assert isinstance(answer, PlanFailure)
    assert answer.status is SolverStatus.INPUT_REFUSED
    assert answer.reason == f"{count} targets given, 6 needed"


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


def test_a_tuning_plans_as_a_planner_configured_so_until_it_is_taken_back() -> None:
    asked, used = request(hovering(), below((2.0, 0.0, -1.2)), AHEAD), planner()
    before = used.plan(asked)
    tuning = (("limits.tilt", 0.1), ("weights.tracking", 3.0))
    tuned = replace(
        CONFIG,
        limits=replace(CONFIG.limits, tilt=0.1),
        weights=replace(CONFIG.weights, tracking=3.0),
    )
    for _ in range(2):
        assert used.plan(replace(asked, tuning=tuning)) == planner(tuned).plan(asked) != before
    assert used.plan(asked) == before


def test_what_is_known_of_a_safe_set_is_built_once(monkeypatch: pytest.MonkeyPatch) -> None:
    built: list[SafeSet] = []

    class Counted(Ocp):
        def __init__(self, config: PlannerConfig, model: CondensedModel, safe_set: SafeSet) -> None:
            built.append(safe_set)
            super().__init__(config, model, safe_set)

    monkeypatch.setattr("fsw.autopilot.mpc.planner.Ocp", Counted)
    used, tuning = planner(), (("limits.tilt", 0.1),)
    tuned = replace(request(hovering(), below((0.5, 0.0, -1.2)), AHEAD), tuning=tuning)
    for asked in (tuned, tuned, replace(tuned, safe_set=SPHERE), tuned):
        used.plan(asked)
    assert built == [AHEAD, SPHERE, AHEAD]


def test_the_reported_times_are_those_of_the_stages_and_of_the_whole() -> None:
    seconds = itertools.count(5000, step=1000)
    used = Planner(CONFIG, AIRFRAME, lambda: float(next(seconds)))
    asked = request(hovering(), below((0.5, 0.0, -1.2)))
    # Two programs, each between marks: begin, linearised, solved.
    assert planned(used.plan(asked)).timings == PlanTimings(2000.0, 2000.0, 7000.0)


def test_a_program_without_an_answer_is_the_last_and_its_time_is_reported() -> None:
    seconds = itertools.count(5000, step=1000)
    used = Planner(replace(CONFIG, controller="hc"), AIRFRAME, lambda: float(next(seconds)))
    behind = hovering((3.0, 0.0, -1.2))
    answer = used.plan(request(behind, below(behind.p), AHEAD))
    assert isinstance(answer, PlanFailure)
    assert (answer.plan_id, answer.status) == (7, SolverStatus.INFEASIBLE)
    assert answer.timings == PlanTimings(1000.0, 1000.0, 4000.0)


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
