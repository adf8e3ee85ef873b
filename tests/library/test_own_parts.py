"""Own planners, controllers and disturbances: flown where they can be, refused in one sentence."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

import pandion
from fsw.autopilot.mpc.planner import Planner
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.signals import Mode, PlanFailure, PlanRequest, SolverStatus
from studies.flight.closed_loop import RefusedError
from studies.flight.own_parts import OwnParts, named_part
from studies.flight.result import processor_time_us
from tests.library.conftest import BRIEF_S

HOVER = np.full(4, 3.5 * 9.81 / 4.0)
STILL = np.zeros(2)


class Lqr:
    """As of docs/tutorials/own-controller.ipynb."""

    def __init__(self, scenario: Any = "workspace-calm") -> None:
        sim = pandion.Simulator(scenario)
        A, B = sim.linear_model()
        Q = np.diag([50.0] * 3 + [20.0] * 3 + [100.0] * 3 + [10.0] * 3 + [200.0] * 2 + [5.0] * 2)
        R = np.diag([0.3] * 4 + [5.0] * 2)
        P = solve_discrete_are(A, B, Q, R)
        self.K = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
        self.x0, self.u0 = sim.observe().state, np.hstack(sim.hover)
        self.above = self.x0[:3] - sim.observe().p_WE

    def __call__(self, seen: pandion.Observation) -> Any:
        goal = self.x0.copy()
        goal[:3], goal[3:6] = seen.p_target + self.above, seen.v_target
        return self.u0 - self.K @ (seen.state - goal)


class Ours:
    """Our planner as a user's."""

    def __init__(self) -> None:
        config = flight_config(body="points")
        self._planner = Planner(config.planner, config.airframe, processor_time_us)

    def plan(self, request: PlanRequest) -> Any:
        return self._planner.plan(request)


class AsArray(Ours):
    """The same, in the least that a planner has to give."""

    def plan(self, request: PlanRequest) -> Any:
        answer = super().plan(request)
        if isinstance(answer, PlanFailure):
            return None
        return np.array([(*one.a, one.yaw_acc, *one.qdd_arm) for one in answer.inputs])


class Lazy(Ours):
    """Answers every other request."""

    def plan(self, request: PlanRequest) -> Any:
        return super().plan(request) if request.plan_id % 2 else None


@pytest.mark.parametrize("planner", [Ours(), AsArray, f"{__name__}:Ours"])
def test_our_planner_given_as_an_own_one_flies_our_flight(
    planner: Any, flown: Callable[[str], pandion.Result]
) -> None:
    same = pandion.fly("walls", 3, duration_s=BRIEF_S, planner=planner, log=False)
    assert same.truth == flown("perfect").truth


def test_a_planner_that_fails_is_braked_for_as_ours_is() -> None:
    result = pandion.fly("walls", 3, duration_s=BRIEF_S, planner=Lazy())
    assert result.row is not None
    assert result.row.failures == 4
    assert result.metrics["mpc"]["fallbacks"] == 4


@pytest.mark.long
def test_after_a_failsafe_our_planner_flies_not_the_own_one() -> None:
    asked: list[Mode] = []

    class Astray:
        """Sideways, whatever is there."""

        def plan(self, request: PlanRequest) -> Any:
            asked.append(request.mode)
            return np.tile([0.0, 1.0, 0.0, 0.0, 0.0, 0.0], (10, 1))

    result = pandion.fly("walls-calm", duration_s=6.0, planner=Astray(), log=False)
    assert not result.completed
    assert "left the trajectory" in result.reason
    begun = asked.index(Mode.TRAJECTORY)
    assert set(asked[begun:]) == {Mode.TRAJECTORY}
    assert len(asked) < 40, "ours planned the rest of 60"
    assert "hit" not in result.reason


@pytest.mark.long
def test_an_lqr_flies_the_workspace_and_is_judged_by_our_referee() -> None:
    result = pandion.fly("workspace-calm", duration_s=2.0, controller=Lqr())
    assert result.completed, result.reason
    assert result.overridden_s == 0.0
    assert result.min_margin is not None
    assert result.min_margin > 0.03
    # What is logged is what was sent.
    sent = result.topics["actuator_command"]
    assert not np.allclose(sent["rotor_thrust"][5:], HOVER[0])


@pytest.mark.parametrize("sensors", ["mocap"])
def test_an_own_controller_flies_on_our_estimate(sensors: str) -> None:
    result = pandion.fly(
        "workspace-calm", duration_s=1.0, sensors=sensors, controller=Lqr, log=False
    )
    assert result.completed, result.reason


def into_the_wall(t: float) -> tuple[float, float, float]:
    """Past the wall in front, at up to 0.5 m/s."""
    return (0.5 * max(t - 1.0, 0.0) ** 2 / (1.0 + max(t - 1.0, 0.0)), 0.0, -0.8)


@pytest.mark.long
def test_the_safety_filter_holds_a_base_off_a_wall_unless_switched_off() -> None:
    scenario = pandion.load_scenario("walls-calm", duration_s=9.0)
    (front,) = [wall for wall in scenario.walls if wall.name == "front"]
    scenario = replace(scenario, walls=(front,))
    law = Lqr(scenario)
    held, free = (
        pandion.fly(scenario, controller=law, reference=into_the_wall, safety_filter=on, log=False)
        for on in (True, False)
    )
    assert held.overridden_s > 0.1
    assert any("own controller overridden" in text for _, text in held.texts)
    assert free.overridden_s == 0.0
    assert held.margins["front/base"] > free.margins["front/base"] + 0.01
    assert not held.row.contact  # type: ignore[union-attr]


WRONG: dict[str, tuple[Any, str]] = {
    "shape": (lambda _: np.zeros(5), r"shape \(6,\), has \(5,\)"),
    "parts": (lambda _: (HOVER[:3], STILL), r"shape \(4,\), has \(3,\)"),
    "nan": (lambda _: (HOVER * math.nan, STILL), "every number must be finite"),
    "infinite": (lambda _: (HOVER, STILL + math.inf), "every number must be finite"),
    "share": (lambda _: (np.full(4, 0.5), STILL), "thrusts are newtons"),
    "rpm": (lambda _: (np.full(4, 5000.0), STILL), "a vehicle has 17.1675 N"),
    "torque": (lambda _: (HOVER, np.full(2, 90.0)), "a vehicle has 2 N m"),
    "text": (lambda _: "hover", r"must be \(6,\) numbers, not str"),
    "nothing": (lambda _: None, "command at 0.002 s"),
    "raises": (lambda _: 1 / 0, "controller at 0.002 s: ZeroDivisionError"),
    "not callable": (HOVER, "must be callable"),
    "no module": ("nosuchmodule:Law", "nosuchmodule cannot be imported"),
    "no name": (f"{__name__}:Law", "has no Law"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_an_own_controller_cannot_say_is_one_sentence(wrong: str) -> None:
    law, sentence = WRONG[wrong]
    with pytest.raises(pandion.OwnPartError, match=sentence) as found:
        pandion.fly("walls", duration_s=0.1, controller=law, log=False)
    assert "\n" not in str(found.value)


def test_a_number_that_is_none_late_in_a_flight_names_its_time() -> None:
    def law(seen: pandion.Observation) -> Any:
        return (HOVER, STILL) if seen.t < 0.051 else (HOVER * math.nan, STILL)

    with pytest.raises(pandion.OwnPartError, match=r"command at 0\.052 s"):
        pandion.fly("walls", duration_s=0.2, controller=law, log=False)


class Answers:
    """A planner that always says the same."""

    def __init__(self, answer: Any) -> None:
        self.answer = answer

    def plan(self, request: PlanRequest) -> Any:
        return self.answer


PLANS: dict[str, tuple[Any, str]] = {
    "shape": (np.zeros((10, 5)), r"shape \(n, 6\), has \(10, 5\)"),
    "empty": (np.zeros((0, 6)), "at least one input"),
    "nan": (np.full((10, 6), math.nan), "every number must be finite"),
    "units": (np.full((10, 6), 981.0), "must be within ±50"),
    "text": ("left", "not str"),
}


@pytest.mark.parametrize("wrong", PLANS)
def test_what_an_own_planner_cannot_say_is_one_sentence(wrong: str) -> None:
    answer, sentence = PLANS[wrong]
    with pytest.raises(pandion.OwnPartError, match=sentence):
        pandion.fly("walls", duration_s=0.3, planner=Answers(answer), log=False)
    with pytest.raises(pandion.OwnPartError, match=r"must (have plan\(request\)|be module:Name)"):
        pandion.fly("walls", planner=answer, log=False)


def test_a_failure_of_an_own_planner_is_flown_on_from() -> None:
    failure = PlanFailure(0, SolverStatus.INFEASIBLE, "no way", None)  # type: ignore[arg-type]
    result = pandion.fly("walls", duration_s=0.4, planner=Answers(failure), log=False)
    assert result.row is not None
    assert result.row.failures > 1


def test_parts_that_are_too_slow_are_refused_unless_allowed() -> None:
    def slow(_: pandion.Observation) -> Any:
        until = processor_time_us() + 2_500
        while processor_time_us() < until:
            pass
        return HOVER, STILL

    with pytest.raises(pandion.OwnPartError, match="too slow: the median of 50 calls"):
        pandion.fly("walls", duration_s=0.2, controller=slow, log=False)
    pandion.fly("walls", duration_s=0.12, controller=slow, allow_slow=True, log=False)


def test_a_disturbance_pushes_and_is_checked() -> None:
    calm, pushed = (
        pandion.fly("workspace-calm", duration_s=1.0, disturbance=push, log=False)
        for push in (None, lambda t: (0.3 * math.sin(9.0 * t), 0.0, 0.0))
    )
    assert pushed.truth.tracking_error_max_m > calm.truth.tracking_error_max_m  # type: ignore[operator]
    for wrong, sentence in (
        (lambda t: (1.0, 2.0), r"disturbance at 0\.000 s: must have shape \(3,\)"),
        (lambda t: (math.nan,) * 3, "must be finite"),
        (lambda t: (99.0, 0.0, 0.0), "must be within ±50"),
        (lambda t: {}[t], "KeyError"),
    ):
        with pytest.raises(pandion.OwnPartError, match=sentence):
            pandion.fly("walls", duration_s=0.1, disturbance=wrong, log=False)


def test_a_named_part_of_another_text_is_refused() -> None:
    path = named_part(f"{__name__}:Ours")
    config = replace(flight_config(body="points"), own_planner=path)
    assert OwnParts().planning(config) is not None
    other = replace(config, own_planner=path[:-1] + "x")
    with pytest.raises(pandion.OwnPartError, match="another one here"):
        OwnParts().planning(other)


def test_refusals_of_the_vehicle_come_through() -> None:
    with pytest.raises(RefusedError, match=r"^not armed: .*the tilt gives") as found:
        pandion.fly("walls", duration_s=0.1, params={"PLN_TILT_MAX": 12.0}, log=False)
    assert str(found.value).count("the tilt gives") == 1, "why not, once, and no other news"
    assert "safe set of" not in str(found.value)
