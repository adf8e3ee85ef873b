"""Uploaded missions and fences, flown on the full plant."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import pytest

from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.signals import (
    EndEffectorTarget,
    MissionAction,
    MissionState,
    MissionStep,
    MissionUpdate,
    Mode,
    SafeSet,
    Vec3,
)
from fsw.link.wire.fence_items import CIRCLE_INCLUSION, POLYGON_INCLUSION, read_fence
from fsw.link.wire.mission_items import MissionItem
from sitl.scenario import Pilot, vehicle_of
from sitl.scenario_file import load_scenario
from tests.closed_loop.harness import (
    ARM,
    SET_MODE,
    Flight,
    command,
    hover,
    on_the_ground,
)
from tests.fsw.zones import walls_of

A = MissionAction
ACCEPTED, TEMPORARILY_REJECTED, DENIED = 0, 1, 2
MISSION_START, PAUSE_CONTINUE, SET_CURRENT = 300, 193, 224
# The three walls of Case I and a fourth far behind: MAVLink's polygons are closed.
NICHE = ((1.0, 1.0), (1.0, -1.0), (-9.0, -1.0), (-9.0, 1.0))


def go(x: float, y: float, z: float, hold: float = 0.0) -> MissionStep:
    return MissionStep(A.GO, (x, y, z), hold_s=hold)


def fence(*items: MissionItem) -> MissionUpdate:
    read = read_fence(items, lambda latitude, longitude, altitude: (0.0, 0.0, 0.0), 0.1)
    assert isinstance(read, SafeSet)
    return MissionUpdate(fence=read)


def niche() -> MissionUpdate:
    count = (float(len(NICHE)), 0.0, 0.0, 0.0)
    return fence(
        *(
            MissionItem(POLYGON_INCLUSION, 1, count, round(1e4 * x), round(1e4 * y), 0.0)
            for x, y in NICHE
        )
    )


def among_walls(seed: int) -> Flight:
    """Case I, disturbed; the fence is the vehicle's only source of the walls."""
    scenario = replace(load_scenario("walls"), pilot=Pilot("none"))
    flight = Flight(scenario, seed=seed, announces=False)
    flight.upload = niche()
    flight.step(command(ARM, 1.0))
    return flight


def reported(flight: Flight, steps: tuple[MissionStep, ...]) -> None:
    flight.upload = MissionUpdate(steps=steps, current=0)
    flight.step()


def where(flight: Flight) -> Vec3:
    return flight.sim.truth().p_WE


@pytest.mark.long
def test_a_mission_from_the_ground_to_the_ground() -> None:
    """As QGroundControl begins it: mission mode first, then arming."""
    flight = Flight(on_the_ground())
    steps = (
        MissionStep(A.TAKE_OFF, (0.0, 0.0, -0.8), above_home=True),
        MissionStep(A.SPEED, speed=0.2),
        MissionStep(A.GO, (0.3, 0.2, -0.8), yaw=0.3),
        MissionStep(A.LAND),
    )
    reported(flight, steps)
    flight.step(command(SET_MODE, 1.0, 4.0, 4.0))
    assert flight.snapshot.intended_mode is Mode.MISSION
    flight.step(command(ARM, 1.0))
    assert flight.mode is Mode.MISSION
    reached: dict[int, Vec3] = {}
    for _ in range(600):
        flight.run(0.1)
        reached.setdefault(flight.snapshot.mission.reached, where(flight))
        if flight.mode is Mode.DISARMED:
            break
    assert flight.modes == [Mode.MISSION, Mode.LAND, Mode.DISARMED]
    assert list(reached) == [-1, 1, 2, 3] or list(reached) == [-1, 0, 1, 2, 3]
    assert math.dist(reached[2], (0.3, 0.2, -0.8)) < 0.1
    assert flight.snapshot.mission.state is MissionState.COMPLETE
    assert flight.snapshot.mission.reached_count == 4
    assert flight.snapshot.intended_mode is Mode.HOLD


@pytest.mark.long
@pytest.mark.requirement("REQ-SAFE-6")
def test_waypoints_beyond_the_walls_of_an_uploaded_fence_are_flown_up_to_it() -> None:
    flight = among_walls(seed=3)
    reported(
        flight, (go(1.8, 0.3, -1.2, hold=1.0), go(1.4, 1.7, -1.2, hold=1.0), go(0.0, 0.0, -1.2))
    )
    flight.step(command(MISSION_START, 0.0, 0.0))
    flight.run(33.0)
    margins = flight.sim.result().margins_m
    assert len(margins) == 9
    assert min(margins.values()) > 0.0, margins
    assert margins["front/end_effector"] < 0.15, "the mission never came near the wall"
    texts = "; ".join(flight.texts)
    assert "mission step 0 not reached" in texts
    assert "mission step 1 not reached" in texts


@pytest.mark.long
@pytest.mark.requirement("REQ-SAFE-13")
def test_a_mission_presses_where_it_may_and_says_where_it_may_not() -> None:
    """Places are meant on the surface: the tip finds it, in front of them or behind."""
    scenario = replace(load_scenario("probe"), pilot=Pilot("none"))
    config = flight_config(body="full", vehicle=vehicle_of(scenario))
    flight = Flight(scenario, seed=2, config=config)
    flight.step(command(ARM, 1.0))
    steps = (
        MissionStep(A.PUSH, (1.1, 0.1, -1.25), force=4.0, press_s=1.0),
        MissionStep(A.PUSH, (0.2, 0.0, -1.2), force=4.0, press_s=1.0),  # far from the wall
        MissionStep(A.PUSH, (1.0, 0.0, -1.2), force=9.9, press_s=1.0),  # more than is promised
    )
    reported(flight, steps)
    flight.step(command(MISSION_START, 0.0, 0.0))
    forces = []
    while flight.mode is Mode.MISSION:
        flight.step()
        forces.append(-flight.sim.touch.force()[0])
    assert flight.mode is Mode.HOLD
    assert flight.snapshot.mission.state is MissionState.COMPLETE
    (use,) = flight.sim.touch.uses().values()
    assert use.force_max_n < use.force_bound_n
    pressed = [force for force in forces if force > 3.0]
    assert 0.8 < 0.002 * len(pressed) < 3.5
    assert abs(sum(pressed) / len(pressed) - 4.0) < 0.6
    texts = "; ".join(flight.texts)
    assert "mission step 1 not flown: the surface that may be touched is 0.78 m away" in texts
    assert "mission step 2 not flown: 9.9 N are asked for; at most" in texts


def test_a_fence_takes_the_place_of_the_walls_that_nobody_announced() -> None:
    flight = among_walls(seed=5)
    assert len(walls_of(flight.state.mission.safe_set)) == 4
    flight.upload = MissionUpdate(fence=SafeSet())
    flight.step()
    assert flight.state.mission.safe_set == SafeSet()


@pytest.mark.long
def test_the_sphere_of_case_2_can_be_a_fence() -> None:
    scenario = replace(load_scenario("workspace"), pilot=Pilot("none"))
    flight = Flight(scenario, seed=7, announces=False)
    flight.upload = fence(MissionItem(CIRCLE_INCLUSION, 7, (0.075, 0, 0, 0), 0, 0, -0.225))
    flight.step(command(ARM, 1.0))
    flight.run(0.5)
    reported(flight, (go(0.5, 0.3, -1.3), go(0.0, 0.0, -1.2)))
    flight.step(command(MISSION_START, 0.0, 0.0))
    farthest = 0.0
    for _ in range(100):
        flight.run(0.1)
        leg = flight.state.mission.flight.segment
        assert leg is not None
        target = leg.at(flight.sim.t_us)
        centre = (target.p_WE[0], target.p_WE[1], target.p_WE[2] - 0.225)
        farthest = max(farthest, math.dist(flight.sim.truth().p_WB, centre))
    assert farthest < 0.075
    assert flight.snapshot.mission.reached == 0


@pytest.mark.long
def test_pause_and_continue_come_back_to_the_current_step() -> None:
    flight = Flight(hover())
    flight.step(command(ARM, 1.0))
    reported(flight, (go(0.0, 0.0, -1.0), go(1.0, 0.0, -1.0)))
    flight.step(command(MISSION_START, 1.0, 0.0))
    flight.run(5.0)
    flight.step(command(PAUSE_CONTINUE, 0.0))
    assert flight.mode is Mode.HOLD
    assert flight.snapshot.mission.state is MissionState.PAUSED
    flight.run(2.0)
    flight.step(command(PAUSE_CONTINUE, 1.0))
    assert flight.mode is Mode.MISSION
    assert flight.snapshot.mission.current == 1
    flight.until(Mode.HOLD, 13.0)
    flight.run(1.0)
    assert flight.snapshot.mission.state is MissionState.COMPLETE
    assert flight.mode is Mode.HOLD
    assert math.dist(where(flight), (1.0, 0.0, -1.0)) < 0.05
    assert "mission complete" in flight.texts


@pytest.mark.long
def test_the_reference_does_not_jump_from_hold_into_a_mission_and_back() -> None:
    flight = Flight(hover())
    flight.step(command(ARM, 1.0))
    flight.run(0.5)
    reported(flight, (go(0.3, 0.0, -1.1),))
    flight.step(command(MISSION_START, 0.0, 0.0))
    seen: list[EndEffectorTarget] = []
    for _ in range(110):
        flight.run(0.1)
        if flight.snapshot.reference is not None:
            seen.append(flight.snapshot.reference)
    assert flight.mode is Mode.HOLD
    steps = [math.dist(a.p_WE, b.p_WE) for a, b in itertools.pairwise(seen)]
    assert max(steps) < 0.3 * 0.1 + 1e-6
    assert math.dist(seen[0].p_WE, seen[-1].p_WE) > 0.2


def test_another_mission_or_none_ends_the_one_that_is_flown() -> None:
    flight = Flight(hover())
    flight.step(command(ARM, 1.0))
    for steps in ((go(0.5, 0.0, -1.0),), ()):
        reported(flight, (go(1.0, 0.0, -1.0),))
        flight.step(command(SET_MODE, 1.0, 4.0, 4.0))
        assert flight.mode is Mode.MISSION
        flight.run(2.0)  # the same command sooner would be a repetition
        reported(flight, steps)
        assert flight.mode is Mode.HOLD


def test_what_cannot_be_begun_is_refused_with_the_reason() -> None:
    flight = Flight(on_the_ground())
    flight.step(command(ARM, 1.0))
    flight.step(command(MISSION_START, 0.0, 0.0))
    reported(flight, (go(1.0, 0.0, -1.0),))
    flight.step(command(SET_MODE, 1.0, 4.0, 4.0))
    flight.step(command(MISSION_START, 7.0, 0.0))
    flight.step(command(SET_CURRENT, 1.0, 0.0))
    assert [result for _, result in flight.results[1:]] == [
        TEMPORARILY_REJECTED,
        TEMPORARILY_REJECTED,
        TEMPORARILY_REJECTED,
        DENIED,
    ]
    assert flight.texts[1:] == [
        "no mission: none was uploaded",
        *["no mission: on the ground, and step 0 is not a takeoff; take off first"] * 2,
        "there is no mission step 1; 1 were uploaded",
    ]


@pytest.mark.long
def test_a_step_chosen_in_flight_is_flown_after_braking() -> None:
    flight = Flight(hover())
    flight.step(command(ARM, 1.0))
    reported(flight, (go(2.0, 0.0, -1.0), go(0.0, 0.5, -1.0)))
    flight.step(command(MISSION_START, 0.0, 0.0))
    flight.run(5.0)
    flight.step(command(SET_CURRENT, 1.0, 0.0))
    assert flight.results[-1] == (SET_CURRENT, ACCEPTED)
    flight.run(30.0)
    assert flight.snapshot.mission.reached == 1
    assert flight.snapshot.mission.reached_count == 1
    assert math.dist(where(flight), (0.0, 0.5, -1.0)) < 0.05


@pytest.mark.long
def test_a_return_leads_to_the_nearest_rally_point() -> None:
    flight = Flight(hover())
    flight.step(command(ARM, 1.0))
    flight.upload = MissionUpdate(rally=((0.0, 9.0), (0.8, 0.0)))
    flight.step()
    reported(flight, (go(0.6, 0.0, -1.2), MissionStep(A.RETURN)))
    flight.step(command(MISSION_START, 0.0, 0.0))
    for _ in range(300):
        flight.run(0.1)
        if flight.mode is Mode.LAND:
            break
    assert flight.modes[-2:] == [Mode.RETURN, Mode.LAND]
    x, y, _ = flight.sim.truth().p_WB
    assert math.dist((x, y), (0.8, 0.0)) < 0.1
    assert flight.snapshot.mission.state is MissionState.COMPLETE
