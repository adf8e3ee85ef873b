"""The mission mode: where it begins, what it hands on, and how it is left and changed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from fsw.autopilot.flight.mission import sequencer as sequencer
from fsw.autopilot.flight.mission.sequencer import Stage
from fsw.autopilot.flight.modes.base import Handover
from fsw.autopilot.flight.modes.mission import Mission, left, motion_limits, with_update
from fsw.autopilot.flight.safety.uncertain_clearance import InflatedSafeSet
from fsw.autopilot.flight.state import FlightState
from fsw.autopilot.mpc.reference import still_at
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.signals import (
    EndEffectorTarget,
    MissionAction,
    MissionState,
    MissionStep,
    MissionUpdate,
    Mode,
    SafeSet,
    Severity,
    Vec3,
)
from tests.fsw.autopilot.flight.in_flight import CONFIG, GROUND_Z, flying, limits, vehicle_at
from tests.fsw.paper_arm import LENGTHS

MISSION = Mission(CONFIG)
REST: Vec3 = (0.0, 0.0, 0.0)
LEAD = CONFIG.steering.max_lead_distance
PACE = CONFIG.limits.mission_speed
DOWN = sum(LENGTHS)  # m, a hanging end-effector below the body
HERE: Vec3 = (0.0, 0.0, -2.0)  # of the end-effector
ABOVE: Vec3 = (0.0, 0.0, -2.0 - DOWN)  # of the body, then
GO = MissionStep(MissionAction.GO, (1.0, 0.0, -2.0))
AWAY = MissionStep(MissionAction.GO, (1.0, 3.0, -2.0))


def loaded(*steps: MissionStep, **changes: Any) -> FlightState:
    """In the air with a mission that has not begun."""
    state = flying(**changes)
    return replace(state, mission=replace(state.mission, flight=sequencer.loaded(steps)))


def under_way(*steps: MissionStep, t_us: int = 0) -> FlightState:
    """A mission that has begun at a standstill at HERE, and its mode."""
    handover = Handover(still_at(HERE, t_us), completed=True)
    state = MISSION.activate(loaded(*steps), vehicle_at(ABOVE, t_us=t_us), handover)
    return replace(state, vehicle=replace(state.vehicle, mode=Mode.MISSION))


def first_point(last: EndEffectorTarget, **vehicle: Any) -> EndEffectorTarget:
    """Where a mission begins if the mode before it ended at ``last``."""
    state = loaded(GO)
    state = replace(state, vehicle=replace(state.vehicle, **vehicle))
    begun = MISSION.activate(state, vehicle_at(ABOVE), Handover(last, completed=False))
    return MISSION.target(begun, 0)


@pytest.mark.parametrize(("share", "taken_over"), [(0.99, True), (1.01, False)])
def test_a_reference_near_the_vehicle_is_continued_and_one_far_off_is_not(
    share: float, taken_over: bool
) -> None:
    last = still_at((share * LEAD, 0.0, -2.0), 0, 0.7)
    begin = first_point(last)
    assert begin.p_WE == pytest.approx(last.p_WE if taken_over else HERE)
    assert begin.yaw == pytest.approx(0.7 if taken_over else 0.0)


@pytest.mark.parametrize(("share", "taken_over"), [(1.0, True), (1.01, False)])
def test_a_reference_faster_than_a_mission_is_not_continued(share: float, taken_over: bool) -> None:
    last = replace(still_at((0.05, 0.0, -2.0)), v_WE=(0.0, share * PACE, 0.0))
    begin = first_point(last)
    assert begin.p_WE == pytest.approx(last.p_WE if taken_over else HERE)
    assert begin.v_WE == pytest.approx(last.v_WE if taken_over else REST)


def test_on_the_ground_a_mission_begins_where_the_vehicle_stands() -> None:
    near = still_at((0.05, 0.0, -2.0))
    assert first_point(near).p_WE == near.p_WE, "or it was no test"
    assert first_point(near, landed=True).p_WE == pytest.approx(HERE)


def test_a_beginning_drops_the_setpoint_of_the_mode_before() -> None:
    state = loaded(GO)
    steered = replace(state, setpoint=replace(state.setpoint, waypoints=((1.0, 1.0, 1.0),)))
    handover = Handover(still_at(HERE), completed=True)
    after = MISSION.activate(steered, vehicle_at(ABOVE), handover)
    assert after.setpoint.waypoints == ()
    assert after.mission.flight.progress.state is MissionState.ACTIVE


def test_a_mission_that_was_replaced_in_flight_is_not_flown_but_held() -> None:
    replaced = with_update(under_way(GO), MissionUpdate(steps=(AWAY,)), CONFIG, 0)
    after, result = MISSION.update(replaced, vehicle_at(ABOVE))
    assert after is replaced
    assert (result.next_mode, result.completed) == (Mode.HOLD, False)


def test_without_a_segment_the_reference_is_where_the_mode_began() -> None:
    state = loaded(GO, mode_origin=(5.0, 6.0, -7.0), mode_yaw=0.3)
    assert MISSION.reference(state, 9) == still_at((5.0, 6.0, -7.0), 9, 0.3)


def test_the_reference_keeps_the_safe_set() -> None:
    state = ticks(under_way(GO), 3)
    late = 10**9
    assert MISSION.reference(state, late).p_WE == pytest.approx((1.0, 0.0, -2.0))
    fenced = SafeSet((wall((-1.0, 0.0, 0.0), -0.6, 0.1),))
    state = replace(state, kept=InflatedSafeSet().of(fenced))
    assert MISSION.reference(state, late).p_WE == pytest.approx((0.5, 0.0, -2.0))


def ticks(state: FlightState, number: int, body: Vec3 = ABOVE, t_us: int = 0) -> FlightState:
    for tick in range(number):
        state, _ = MISSION.update(state, vehicle_at(body, t_us=t_us + 2000 * tick))
    return state


def test_a_tick_in_which_nothing_happens_leaves_the_state_itself() -> None:
    state = ticks(under_way(GO), 3)
    after, result = MISSION.update(state, vehicle_at(ABOVE, t_us=6000))
    assert after is state
    assert (result.next_mode, result.texts) == (None, ())


def test_a_step_is_announced_and_one_that_is_not_reached_is_a_warning() -> None:
    state = under_way(GO, AWAY)
    said: list[tuple[Severity, str]] = []
    for t_us in range(0, 60_000_000, 100_000):
        state, result = MISSION.update(state, vehicle_at(ABOVE, t_us=t_us))  # it does not move
        said += [(text.severity, text.text) for text in result.texts]
        if result.next_mode is not None:
            break
    assert said[0] == (Severity.INFO, "mission step 0: go")
    assert said[1] == (Severity.WARNING, "mission step 0 not reached: 1.00 m away")


def test_a_step_turns_the_nose_to_a_place_until_another_frees_it() -> None:
    place = (4.0, 5.0, -1.0)
    free = MissionStep(MissionAction.LOOK_AT)
    state = under_way(MissionStep(MissionAction.LOOK_AT, place), free, GO)
    state = ticks(state, 2)
    assert state.vehicle.look_at == place
    assert ticks(state, 2).vehicle.look_at is None


@pytest.mark.parametrize("home", [True, False])
def test_a_height_above_home_counts_from_home_or_else_from_the_ground(home: bool) -> None:
    state = under_way(MissionStep(MissionAction.GO, (0.0, 0.0, -1.0), above_home=True))
    ground = replace(CONFIG.airframe, leg_length=0.5)
    mission = Mission(replace(CONFIG, airframe=ground))
    if not home:
        state = replace(state, vehicle=replace(state.vehicle, home=None))
    for _ in range(3):
        state, _ = mission.update(state, vehicle_at(ABOVE))
    low = GROUND_Z if home else -0.5
    assert MISSION.reference(state, 10**9).p_WE[2] == pytest.approx(low - 1.0)


def test_a_takeoff_counts_the_height_of_the_body() -> None:
    state = ticks(under_way(MissionStep(MissionAction.TAKE_OFF, (0.0, 0.0, -5.0))), 3)
    risen = HERE[2] - MISSION.reference(state, 10**9).p_WE[2]
    assert risen == pytest.approx(5.0 + ABOVE[2])


def test_the_pace_is_the_one_of_the_limits_and_never_stands_still() -> None:
    quick = limits(mission_speed=0.4, mission_turn_rate=0.2, mission_turn_acceleration=0.03)
    still = replace(CONFIG.surroundings, target_acceleration=0.0)
    brisk = replace(CONFIG.surroundings, target_acceleration=0.7)
    pace = motion_limits(replace(quick, surroundings=brisk))
    assert (pace.speed, pace.acceleration) == (0.4, 0.7)
    assert (pace.turn_rate, pace.turn_acceleration) == (0.2, 0.03)
    assert 0.0 < motion_limits(replace(quick, surroundings=still)).acceleration <= 0.05


LAST_IS_LANDING = (MissionStep(MissionAction.LAND),)


def handed_over(mode: Mode, *, landed: bool) -> FlightState:
    """A mission that has handed over to the landing of its last step, in a mode."""
    state = loaded(*LAST_IS_LANDING, mode=mode)
    flight = state.mission.flight
    progress = replace(flight.progress, state=MissionState.ACTIVE)
    flight = replace(flight, stage=Stage.GONE, progress=progress)
    vehicle = replace(state.vehicle, landed=landed)
    return replace(state, vehicle=vehicle, mission=replace(state.mission, flight=flight))


def test_a_landing_that_ends_on_the_ground_completes_the_mission() -> None:
    after = left(handed_over(Mode.LAND, landed=True), Mode.DISARMED).mission.flight
    assert (after.progress.state, after.progress.reached) == (MissionState.COMPLETE, 0)


@pytest.mark.parametrize(
    ("landed", "follows"), [(False, Mode.DISARMED), (True, Mode.HOLD), (False, Mode.HOLD)]
)
def test_a_landing_that_ends_otherwise_pauses_the_mission(landed: bool, follows: Mode) -> None:
    after = left(handed_over(Mode.LAND, landed=landed), follows).mission.flight
    assert (after.progress.state, after.progress.reached) == (MissionState.PAUSED, -1)
    assert after.stage is Stage.IDLE


def test_a_mission_goes_on_while_its_last_step_is_flown_by_the_mode_it_asked_for() -> None:
    state = handed_over(Mode.MISSION, landed=False)
    assert left(state, Mode.LAND) is state


@pytest.mark.parametrize("follows", [Mode.HOLD, Mode.LAND, Mode.RETURN, Mode.DISARMED])
def test_a_mission_that_is_left_is_paused_whatever_follows(follows: Mode) -> None:
    flight = left(ticks(under_way(GO), 3), follows).mission.flight
    assert (flight.progress.state, flight.segment) == (MissionState.PAUSED, None)


@pytest.mark.parametrize("current", [0, 1])
def test_another_step_becomes_the_current_one(current: int) -> None:
    state = with_update(loaded(GO, AWAY), MissionUpdate(current=current), CONFIG, 0)
    assert state.mission.flight.progress.current == current


def test_a_step_that_does_not_exist_changes_nothing() -> None:
    state = loaded(GO, AWAY)
    assert with_update(state, MissionUpdate(current=2), CONFIG, 0) == state


def test_in_flight_another_step_begins_with_braking_within_the_pace() -> None:
    state, now_us = ticks(under_way(GO, AWAY), 3), 4_000_000
    moving = MISSION.reference(state, now_us)
    assert moving.v_WE[0] > 0.1, "or it was no test"
    after = with_update(state, MissionUpdate(current=1), CONFIG, now_us)
    begin = MISSION.reference(after, now_us)
    assert begin.p_WE == pytest.approx(moving.p_WE)
    assert begin.v_WE == pytest.approx(moving.v_WE)
    flight = after.mission.flight
    assert (flight.stage, flight.progress.current) == (Stage.BRAKE, 1)


def test_a_new_mission_starts_at_its_first_step_and_the_count_of_steps_goes_on() -> None:
    state = loaded(GO, AWAY)
    flight = state.mission.flight
    flown = replace(flight.progress, current=1, reached=0, reached_count=7)
    state = replace(state, mission=replace(state.mission, flight=replace(flight, progress=flown)))
    progress = with_update(state, MissionUpdate(steps=(GO,)), CONFIG, 0).mission.flight.progress
    assert (progress.state, progress.current, progress.total) == (MissionState.NOT_STARTED, 0, 1)
    assert progress.reached_count == 7
    both = with_update(state, MissionUpdate(steps=(GO, AWAY, GO), current=2), CONFIG, 0)
    assert both.mission.flight.progress.current == 2
