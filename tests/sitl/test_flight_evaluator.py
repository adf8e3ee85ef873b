"""Steps without an incident are judged by one compiled call, which agrees with the evaluator."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sitl.flight_evaluator import FlightEvaluator, Flown
from sitl.mission_clock import MissionClock
from sitl.plant.integrator import held
from sitl.plant.integrator import places as places_into
from sitl.plant.parameters import plant
from sitl.plant.state import P_WB, Q_WB, at_rest
from sitl.plant.vector import Array
from sitl.result import EndKind
from sitl.scenario_file import load_scenario
from sitl.world import record_if_clear
from tests.sitl.vehicles import PAPER

STEP_S = 0.001


def evaluator(name: str, begin: Array | None = None) -> FlightEvaluator:
    """Of a scenario, from these places on; without them, of one with the paper's three points."""
    scenario = load_scenario(name)
    clock = MissionClock(scenario)
    target = clock.target_at(0.0).p
    above = (target[0], target[1], target[2] - 0.225)
    if begin is None:
        scenario, begin = replace(scenario, body="points"), np.array([above, above, above, target])
    return FlightEvaluator(scenario, clock, begin)


def places(random: np.random.Generator, name: str) -> Array:
    """Two plant steps of base, joint 1, joint 2 and end-effector about the first target."""
    x, y, z = MissionClock(load_scenario(name)).target_at(0.0).p
    spread = 0.02 * random.uniform(-1.0, 1.0, (2, 4, 3))
    return spread + np.array([x, y, z]) - np.array([0.0, 0.0, 0.225])


def looked(evaluator: FlightEvaluator, passed: Array, before_s: float) -> bool:
    """Whether the quick look judged these steps, without an incident."""
    aim = evaluator.aim(before_s + len(passed) * STEP_S)
    assert aim is not None
    by = evaluator.quick
    instants = (before_s, STEP_S)
    room = (by.lowest, by.when_s, by.room)
    return record_if_clear(by.table, by.parts, aim, passed, instants, *room) >= 0.0


@pytest.mark.drawn(1)
@pytest.mark.parametrize("name", ["walls", "workspace", "branches"])
def test_the_quick_look_records_what_the_slow_one_does(name: str) -> None:
    random = np.random.default_rng(3)
    quick, slow = evaluator(name), evaluator(name)
    for step in range(200):
        passed, before_s = places(random, name), 0.002 * step
        assert looked(quick, passed, before_s)
        slow.judge_each(passed, before_s, STEP_S)
    assert quick.record.minimum == pytest.approx(slow.record.minimum, abs=1e-14)
    assert quick.record.time_s == slow.record.time_s
    assert max(quick.record.time_s) > 0.0


@pytest.mark.parametrize("point", [0, 2, 3])
@pytest.mark.parametrize("step", [0, 1])
def test_an_incident_in_any_step_at_any_point_is_seen(step: int, point: int) -> None:
    for where, kind in (((0.0, 0.0, 0.1), EndKind.COLLISION), ((math.nan,) * 3, EndKind.DIVERGED)):
        judge, passed = evaluator("walls"), places(np.random.default_rng(4), "walls")
        passed[step, point] = where
        assert not looked(judge, passed, 0.0)
        judge.judge_each(passed, 0.0, STEP_S)
        assert judge.ended is not None
        assert judge.ended.kind is kind
        assert judge.ended.time_s == pytest.approx(STEP_S * (step + 1))


def test_joint_1_is_no_critical_point() -> None:
    judge, passed = evaluator("walls"), places(np.random.default_rng(4), "walls")
    passed[:, 1] = (99.0, 99.0, 99.0)
    assert looked(judge, passed, 0.0)


def swinging(name: str) -> Array:
    """Places of 400 plant steps of a vehicle that sways, pitches and swings its arm."""
    target = MissionClock(load_scenario(name)).target_at(0.0).p
    body, state = plant(PAPER), at_rest(4, 2)
    passed, blocks = np.empty((400, 7, 3)), held()
    for k in range(len(passed)):
        turn = 2.0 * math.pi * k / len(passed)
        sway = (0.1 * math.sin(turn), 0.15 * math.sin(2.0 * turn), 0.05 * math.sin(turn))
        state[P_WB : P_WB + 3] = np.add(target, sway) - np.array([0.0, 0.0, 0.225])
        pitch = 0.2 * math.sin(3.0 * turn)
        state[Q_WB : Q_WB + 4] = (math.cos(0.5 * pitch), 0.0, math.sin(0.5 * pitch), 0.0)
        state[17:19] = (-0.7 + 0.3 * math.sin(turn), 1.4)
        places_into(body, state, blocks, passed[k : k + 1])
    return passed


@pytest.mark.parametrize("name", ["walls", "shelf", "crossing"])
def test_what_is_not_worked_out_again_could_not_be_a_record(name: str) -> None:
    passed = swinging(name)
    quick, slow = (evaluator(name, passed[0]) for _ in range(2))
    skipped = 0
    for k in range(0, len(passed), 2):
        before = quick.quick.room.left.copy()
        assert looked(quick, passed[k : k + 2], STEP_S * k)
        slow.judge_each(passed[k : k + 2], STEP_S * k, STEP_S)
        skipped += int((quick.quick.room.left < before).sum())
    assert quick.record.minimum == slow.record.minimum
    assert quick.record.time_s == slow.record.time_s
    assert skipped > 0.5 * len(quick.record.minimum) * len(passed) / 2


@pytest.mark.parametrize("name", ["walls", "shelf"])
def test_there_is_no_incident_within_what_is_free(name: str) -> None:
    passed = swinging(name)
    judge = evaluator(name, passed[0])
    for k in range(0, len(passed), 2):
        judge.judge_flown(flown(passed, k), clear=False)
        height = -passed[k + 1, [0, 2, 3], 2].max()
        assert 0.0 < judge.free[3] <= min(*judge.margins(passed[k + 1], 0.0), height)


def flown(passed: Array, k: int) -> Flown:
    """Two steps of a vehicle at rest, placed."""
    commanded = ((0.0, 0.0, 0.0, 0.0), (0.0, 0.0))
    return Flown(
        passed[k : k + 2], np.array([at_rest(4, 2)] * 2), *commanded, True, STEP_S * k, STEP_S
    )


def test_where_a_zone_moves_nothing_is_free() -> None:
    judge, passed = evaluator("workspace"), places(np.random.default_rng(4), "workspace")
    judge.judge_flown(flown(passed, 0), clear=False)
    assert judge.free[3] == -math.inf


def test_a_judgement_that_waited_is_the_same() -> None:
    passed = swinging("walls")
    waiting, prompt = (evaluator("walls", passed[0]) for _ in range(2))
    for k in range(0, len(passed), 2):
        waiting.judge_flown(flown(passed, k), clear=True)
        prompt.judge_flown(flown(passed, k), clear=False)
        assert max(waiting.record.time_s) < STEP_S * (k + 1) - 1e-9  # of the steps before
        waiting.catch_up()
        assert waiting.record.minimum == prompt.record.minimum
    assert waiting.result(1.0) == prompt.result(1.0)
