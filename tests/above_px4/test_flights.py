"""The planner above the stand-in for PX4: handing over, walls, and what can be lost on the way.

The stand-in is checked against recorded conversations in what it says; its control is a model of
PX4's. What a real PX4 flies is on the page docs/tutorials/fly-px4-with-the-planner.md.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fsw.autopilot.flight.commands.bounds import GRIPPER_OF_PX4
from fsw.autopilot.signals import (
    Command,
    CommandRequest,
    GoTo,
    MissionAction,
    MissionStep,
    MissionUpdate,
    Mode,
    Place,
)
from sitl.scenario import Scenario
from sitl.scenario_file import load_scenario
from tests.above_px4.flight import TRAJECTORY, AbovePx4
from tests.above_px4.worst_push import BOUND, KEPT, worst_push
from tests.closed_loop.harness import command, hover
from tests.px4_companion_stand_in import HOLD, OFFBOARD, POSITION, SET_MODE, Gains

MISSION_START = 300


def still(yaw_deg: float = 0.0) -> Scenario:
    """Hovering in calm air, measured by motion capture."""
    suite = load_scenario("ground", "mocap").sensors
    return replace(hover(yaw_deg=yaw_deg), sensors=suite)


def handed_over(flight: AbovePx4) -> AbovePx4:
    """A flight that PX4's pilot has given to the planner."""
    flight.run(0.5)
    assert flight.mode is Mode.DISARMED
    assert flight.px4.targets > 20, "setpoints stream before PX4 follows them"
    assert flight.px4.switch(OFFBOARD)
    flight.run(0.3)
    assert flight.mode is Mode.HOLD
    return flight


def test_px4_is_taken_over_without_a_jump_and_taken_back_at_once() -> None:
    flight = AbovePx4(still())
    before = np.array(flight.sim.truth().p_WB)
    handed_over(flight)
    flight.run(2.0)
    assert np.linalg.norm(np.array(flight.sim.truth().p_WB) - before) < 0.06
    assert "PX4 gives the vehicle: it follows the plan" in flight.texts
    flight.px4.switch(POSITION)
    flight.run(0.05)
    assert flight.mode is Mode.DISARMED
    assert "PX4 flies Position: the plan is not followed any more" in flight.texts
    # Whatever follows, nobody asks PX4 for Offboard but its pilot.
    flight.run(1.0)
    assert not [one for one in flight.px4.commands if one[0] == SET_MODE]
    assert flight.mode is Mode.DISARMED
    flight.px4.switch(OFFBOARD)
    flight.run(0.3)
    assert flight.mode is Mode.HOLD


def test_our_operator_asks_px4_for_offboard_and_gives_it_back() -> None:
    flight = AbovePx4(still())
    flight.run(0.5)
    flight.commands.append(command(400, 1.0))
    flight.run(1.0)
    assert flight.px4.mode == OFFBOARD
    assert flight.mode is Mode.HOLD
    flight.commands.append(command(400, 0.0))
    flight.run(0.5)
    assert flight.px4.mode == HOLD
    assert "given back to PX4, which is asked to hold" in flight.texts
    assert flight.mode is Mode.DISARMED


def test_a_mission_that_moves_the_gripper_is_told_that_it_is_px4s() -> None:
    flight = handed_over(AbovePx4(still()))
    flight.upload = MissionUpdate(steps=(MissionStep(MissionAction.GRIP),), current=0)
    flight.run(0.1)
    flight.commands.append(command(MISSION_START, 0.0, 0.0))
    flight.run(0.5)
    assert GRIPPER_OF_PX4 in flight.texts
    assert flight.state.vehicle.gripper == 0.0


@pytest.mark.long
def test_a_px4_that_refuses_offboard_is_not_pressed() -> None:
    flight = AbovePx4(still())
    flight.px4.accepts_offboard = False
    flight.run(0.5)
    flight.commands.append(command(400, 1.0))
    flight.run(3.0)
    assert flight.mode is Mode.DISARMED
    assert "PX4 stays in Hold and does not enter Offboard" in flight.texts
    assert 1 <= sum(one[0] == SET_MODE for one in flight.px4.commands) <= 5


@pytest.mark.long
@pytest.mark.parametrize("seconds", [11.0, 31.0])
def test_walls_are_kept_in_calm_air(seconds: float) -> None:
    """Past the first wall, and all the way."""
    flight = handed_over(AbovePx4(load_scenario("walls-calm", "mocap")))
    flight.commands.append(TRAJECTORY)
    flight.run(seconds)
    result = flight.sim.result()
    assert flight.mode is Mode.TRAJECTORY, flight.texts
    assert result.min_margin_m is not None
    assert result.min_margin_m > 0.02
    assert result.tracking_error_rms_m is not None
    assert result.tracking_error_rms_m < 0.11
    assert flight.state.plan.counters.missed_deadlines == 0


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_walls_are_kept_while_it_is_pushed(seed: int) -> None:
    flight = handed_over(AbovePx4(load_scenario("walls", "mocap"), seed))
    flight.commands.append(TRAJECTORY)
    flight.run(60.0)
    result = flight.sim.result()
    assert result.min_margin_m is not None
    assert result.tracking_error_rms_m is not None
    print(
        f"seed {seed}: minimum margin {1e3 * result.min_margin_m:.1f} mm, tracking error "
        f"{1e3 * result.tracking_error_rms_m:.1f} mm"
    )
    assert result.min_margin_m > 0.0
    assert not [text for text in flight.texts if "tube" in text]


def test_a_stream_that_is_lost_ends_offboard_and_ours() -> None:
    """What we send gets lost: PX4 leaves Offboard by itself, and that is respected."""
    flight = handed_over(AbovePx4(still()))
    flight.px4.deaf = True
    flight.run(1.5)
    assert flight.px4.texts == ["Failsafe activated"]
    assert flight.px4.mode == HOLD
    assert flight.mode is Mode.DISARMED
    assert "PX4: Failsafe activated" in flight.texts
    assert "PX4 flies Hold: the plan is not followed any more" in flight.texts
    # PX4 gives it again by itself once it hears setpoints: then it is held where it is.
    flight.px4.deaf = False
    flight.run(2.0)
    assert flight.px4.mode == OFFBOARD
    assert flight.mode is Mode.HOLD
    assert not [one for one in flight.px4.commands if one[0] == SET_MODE]


@pytest.mark.long
def test_a_px4_that_falls_silent_is_told_and_gets_no_more_set_points() -> None:
    flight = handed_over(AbovePx4(still()))
    flight.px4.mute = True
    flight.run(0.9)
    assert [text for text in flight.texts if text.startswith("PX4 is silent for ")]
    assert flight.mode is Mode.DISARMED
    sent = flight.px4.targets
    flight.run(1.2)
    assert flight.px4.targets == sent, "it may not be heard: PX4 is left to its failsafe"
    assert flight.px4.mode == HOLD
    flight.px4.mute = False
    flight.run(1.0)
    assert "PX4 is heard" in flight.texts
    assert flight.px4.mode == OFFBOARD, "it gives the vehicle again by itself"
    assert flight.mode is Mode.HOLD


@pytest.mark.long
@pytest.mark.parametrize("axis", [0, 1])
def test_the_worst_push_stays_inside_the_bound_that_is_printed(axis: int) -> None:
    scenario = replace(still(), disturbances=(worst_push(3.0, axis),))
    flight = handed_over(AbovePx4(scenario))
    furthest = 0.0
    for _ in range(100):
        flight.run(0.1)
        p, planned = flight.sim.truth().p_WB, flight.setpoints[-1][1].p
        furthest = max(furthest, abs(p[axis] - planned[axis]))
    print(f"axis {axis}: {1e3 * furthest:.1f} mm")
    assert 0.5 * BOUND < furthest < BOUND < KEPT
    assert not [text for text in flight.texts if "off the plan" in text]


@pytest.mark.long
@pytest.mark.parametrize("stop_s", [0.7, 1.1, 3.0])
def test_a_planner_that_stopped_holds_and_does_not_go_on_with_its_plan(stop_s: float) -> None:
    flight = handed_over(AbovePx4(still()))
    begun = len(flight.modes)
    flight.stopped = True
    flight.run(stop_s)
    assert (flight.px4.mode == HOLD) == (stop_s > 1.0)
    place = flight.sim.truth().p_WB
    flight.stopped = False
    flight.run(2.5)
    assert flight.px4.mode == OFFBOARD
    assert flight.modes[begun:] == [Mode.DISARMED, Mode.HOLD]
    assert f"this planner stopped for {stop_s:.1f} s: its plan ends" in flight.texts
    assert flight.sim.truth().p_WB == pytest.approx(place, abs=0.1)


@pytest.mark.long
def test_a_yaw_that_is_not_followed_is_told_and_planned_anew() -> None:
    """With PX4's own gains the paper's vehicle swings about its yaw for long."""
    slow = Gains(yaw_p=2.8, yaw_rate=0.2, yaw_rate_i=0.1)
    flight = handed_over(AbovePx4(still(), gains=slow))
    north, east, _ = flight.sim.truth().p_WB
    turned = GoTo(Place((north, east)), yaw=1.5)
    flight.commands.append(Command(turned, CommandRequest(192, (0.0,) * 7, 255, 190)))
    told: list[str] = []
    while not told:
        flight.run(0.1)
        told = [text for text in flight.texts if text.startswith("off the plan by ")]
        assert flight.sim.time_s < 9.0, flight.texts
    assert " deg: replanning" in told[0]


@pytest.mark.long
@pytest.mark.parametrize("child_frame", [1, 12])
def test_both_conventions_of_velocities_fly_with_the_yaw_turned(child_frame: int) -> None:
    flight = AbovePx4(still(yaw_deg=90.0), child_frame=child_frame)
    handed_over(flight)
    flight.run(1.0)
    # A metre to the north, with the nose to the east.
    north, east, _ = flight.sim.truth().p_WB
    there = GoTo(Place((north + 0.8, east)))
    flight.commands.append(Command(there, CommandRequest(192, (0.0,) * 7, 255, 190)))
    worst = 0.0
    for _ in range(round(2.8 / 0.004)):
        flight.exchange()
        estimate, truth = flight.state.estimate, flight.sim.truth()
        assert estimate is not None
        worst = max(worst, math.dist(estimate.v_WB, truth.v_WB))
    assert worst < 0.2, "taken for the other one it is wrong by half a metre a second"
    assert flight.sim.truth().p_WB[0] > north + 0.5
