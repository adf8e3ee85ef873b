"""A mission in flight: order, smoothness, what is reached and what is not."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from fsw.autopilot.flight.commands.bounds import mission_problem
from fsw.autopilot.flight.mission.sequencer import (
    APPROACH_DISTANCE,
    MissionContext,
    MissionFlight,
    Stage,
    advance,
    begun,
    jumped,
    loaded,
    nearest,
    paused,
    refusal,
    touched_down,
)
from fsw.autopilot.flight.mission.trajectory_segment import MotionLimits
from fsw.autopilot.flight.setpoints.reference_governor import project, project_to_safe_set
from fsw.autopilot.flight.setpoints.target_check import Meeting
from fsw.autopilot.shapes.ball import point
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.signals import (
    EndEffectorTarget,
    Home,
    MissionAction,
    MissionState,
    MissionStep,
    Mode,
    SafeSet,
    Vec3,
)

A = MissionAction
PACE = MotionLimits(speed=0.3, acceleration=0.05, turn_rate=0.3, turn_acceleration=0.05)
REST = (0.0, 0.0, 0.0)
START = EndEffectorTarget(0, (0.0, 0.0, -1.0), REST, REST, 0.2)
STEP_US = 50_000


def go(*p: float, hold: float = 0.0, **more: object) -> MissionStep:
    return MissionStep(A.GO, (p[0], p[1], p[2]), hold_s=hold, **more)  # type: ignore[arg-type]


def nothing_there(place: Vec3, _force: float) -> Meeting:
    return Meeting(place, REST, "there is no surface that may be touched")


@dataclass
class Flown:
    """A mission flown by a vehicle that is always where the reference is, unless set otherwise."""

    flight: MissionFlight
    t_us: int = 0
    height: float = 1.3
    home_z: float = 0.0
    safe_set: SafeSet = field(default_factory=SafeSet)
    blocked: Callable[[Vec3], Vec3] = lambda p: p
    points: list[EndEffectorTarget] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)
    reached: list[int] = field(default_factory=list)
    next_mode: Mode | None = None
    look_at: Vec3 | None = None
    meet: Callable[[Vec3, float], Meeting] = lambda p, _: Meeting(p, (0.6, 0.0, -0.8))

    def fly(self, seconds: float = math.inf) -> Flown:
        end_us = self.t_us + min(seconds, 2e4) * 1e6
        while self.next_mode is None and self.t_us < end_us:
            self.t_us += STEP_US
            assert self.flight.segment is not None
            here = project(self.flight.segment.at(self.t_us), self.safe_set)
            self.points.append(here)
            where = MissionContext(
                self.t_us,
                self.blocked(here.p_WE),
                self.height,
                self.home_z,
                self.meet,
                PACE,
                self.safe_set,
                self.look_at,
            )
            count = self.flight.progress.reached_count
            self.flight, event = advance(self.flight, where)
            if self.flight.progress.reached_count > count:
                self.reached.append(self.flight.progress.reached)
            self.next_mode = event.next_mode
            if event.looks:
                self.look_at = event.look_at
            if event.text:
                self.texts.append(event.text)
        return self


def start(*steps: MissionStep) -> Flown:
    return Flown(begun(loaded(steps), START, PACE))


coordinate = st.floats(-4.0, 4.0)
random_step = st.one_of(
    st.builds(
        MissionStep,
        st.just(A.GO),
        st.tuples(coordinate, coordinate, st.floats(-3.0, -0.5)),
        st.booleans(),
        st.none() | st.floats(-4.0, 4.0),
        st.floats(0.0, 3.0),
    ),
    st.builds(
        MissionStep,
        st.just(A.PUSH),
        st.tuples(coordinate, coordinate, st.floats(-3.0, -0.5)),
        force=st.floats(0.1, 20.0),
        press_s=st.floats(0.0, 3.0),
    ),
    st.builds(MissionStep, st.just(A.DELAY), hold_s=st.floats(0.0, 3.0)),
    st.builds(MissionStep, st.just(A.SPEED), speed=st.none() | st.floats(0.05, 0.3)),
)


@settings(max_examples=25, deadline=None)
@given(st.lists(random_step, min_size=1, max_size=5), st.floats(0.1, 60.0), st.integers(0, 4))
def test_any_mission_is_smooth_and_within_its_pace(
    steps: list[MissionStep], jump_s: float, jump_to: int
) -> None:
    flown = start(*steps).fly(jump_s)
    if flown.next_mode is None:
        step = min(jump_to, len(steps) - 1)
        flown.flight = jumped(flown.flight, step, flown.t_us, PACE)
        flown.fly()
    assert flown.next_mode is Mode.HOLD
    assert flown.flight.progress.state is MissionState.COMPLETE
    dt = STEP_US * 1e-6
    last = START
    for at in flown.points:
        assert math.hypot(*at.v_WE) <= PACE.speed * 1.0001
        assert math.hypot(*at.a_WE) <= PACE.acceleration * 1.0001
        assert math.dist(at.p_WE, last.p_WE) <= PACE.speed * dt * 1.0001 + 1e-9
        assert math.dist(at.v_WE, last.v_WE) <= PACE.acceleration * dt * 1.001 + 1e-9
        last = at


@settings(max_examples=15, deadline=None)
@given(st.lists(random_step, min_size=1, max_size=5))
def test_without_a_jump_the_acceleration_is_continuous_too(steps: list[MissionStep]) -> None:
    flown = start(*steps).fly()
    assert flown.reached == list(range(len(steps)))
    bend = 6.0 * PACE.acceleration / 0.5  # a ramp that short is a segment of a few millimetres
    last = START
    for at in flown.points:
        assert abs(at.force - last.force) <= 7.5 * STEP_US * 1e-6 + 1e-9
        assert at.force == 0.0 or at.v_WE == (0.0, 0.0, 0.0)
        assert math.dist(at.a_WE, last.a_WE) <= bend * STEP_US * 1e-6 + 1e-9
        last = at


def test_steps_come_in_order_and_each_is_stayed_at() -> None:
    flown = start(go(1.0, 0.0, -1.0, hold=2.0), go(1.0, 1.0, -1.5)).fly()
    assert flown.reached == [0, 1]
    there = [at for at in flown.points if math.dist(at.p_WE, (1.0, 0.0, -1.0)) < 1e-9]
    assert 2.0 <= len(there) * STEP_US * 1e-6 <= 2.3
    assert flown.points[-1].p_WE == (1.0, 1.0, -1.5)
    assert flown.texts[-1] == "mission complete"


def test_a_push_stands_off_faces_the_surface_presses_as_long_as_asked_and_comes_back() -> None:
    push = MissionStep(A.PUSH, (1.0, 0.5, -1.2), force=6.0, press_s=2.0)
    flown = start(push, go(0.5, 0.0, -1.0))
    flown.meet = lambda p, _: Meeting((0.97, *p[1:]), (-1.0, 0.0, 0.0))
    flown.fly()
    assert flown.reached == [0, 1]
    pressing = [at for at in flown.points if at.force == 6.0]
    assert len(pressing) * STEP_US * 1e-6 == pytest.approx(2.0, abs=0.11)
    assert {at.p_WE for at in pressing} == {(0.97, 0.5, -1.2)}
    assert pressing[0].yaw == pytest.approx(0.0)
    first, last = (next(k for k, at in enumerate(way) if at.force > 0.0)
                   for way in (flown.points, flown.points[::-1]))  # fmt: skip
    stand_off = (0.97 - APPROACH_DISTANCE, 0.5, -1.2)
    for way in (flown.points[:first], flown.points[-last:]):
        assert any(math.dist(at.p_WE, stand_off) < 1e-9 for at in way)


def test_a_push_where_nothing_can_be_pressed_is_told_and_passed_over() -> None:
    push = MissionStep(A.PUSH, (1.0, 0.5, -1.2), force=6.0, press_s=2.0)
    flown = start(push, go(0.5, 0.0, -1.0))
    flown.meet = nothing_there
    flown.fly()
    assert flown.reached == [1]
    assert flown.texts[0] == (
        "mission step 0 not flown: there is no surface that may be touched"
    )  # fmt: skip
    assert all(at.force == 0.0 for at in flown.points)


def circle(radius: float, turns: float, **more: object) -> MissionStep:
    return MissionStep(
        A.CIRCLE,
        (2.0, 1.0, -1.5),
        radius=radius,
        turns=turns,
        **more,  # type: ignore[arg-type]
    )


@pytest.mark.parametrize("radius", [1.5, -0.75])
@pytest.mark.parametrize("look_at", [None, (2.0, 1.0, 0.0)])
def test_a_circle_is_flown_as_often_and_the_way_round_that_it_says(
    radius: float, look_at: Vec3 | None
) -> None:
    looking = [MissionStep(A.LOOK_AT, look_at)] if look_at is not None else []
    flown = start(*looking, circle(radius, 2.0), go(0.0, 0.0, -1.0)).fly()
    assert flown.next_mode is Mode.HOLD
    assert flown.reached == list(range(len(looking) + 2))
    on_it = [
        one
        for one in flown.points
        if abs(math.dist(one.p_WE[:2], (2.0, 1.0)) - abs(radius)) < 1e-6
        and abs(one.p_WE[2] + 1.5) < 1e-9
    ]
    bearings = [math.atan2(one.p_WE[1] - 1.0, one.p_WE[0] - 2.0) for one in on_it]
    turned = sum(math.remainder(b - a, 2.0 * math.pi) for a, b in itertools.pairwise(bearings))
    assert turned == pytest.approx(math.copysign(4.0 * math.pi, radius), abs=1e-3)
    for before, after in itertools.pairwise(flown.points):
        assert math.hypot(*after.v_WE) <= PACE.speed + 1e-9
        assert math.hypot(*after.a_WE) <= PACE.acceleration + 1e-9
        moved = math.dist(before.p_WE, after.p_WE)
        assert moved <= (PACE.speed + 1e-9) * 1e-6 * STEP_US
    if look_at is not None:
        looks = [one.yaw for one in on_it[1:]]
        away = [math.remainder(b - y - math.pi, 2.0 * math.pi)
                for b, y in zip(bearings[1:], looks, strict=True)]  # fmt: skip
        assert max(map(abs, away)) < 0.01


def test_a_circle_where_the_vehicle_is_begins_there() -> None:
    flown = start(circle(1.0, 0.5, here=True)).fly()
    assert flown.reached == [0]
    assert flown.points[-1].p_WE == pytest.approx((-1.0, 0.0, -1.5), abs=1e-6)


def jump(target: int, repeats: int) -> MissionStep:
    return MissionStep(A.JUMP, target=target, repeats=repeats)


def test_a_jump_is_taken_as_often_as_it_says_and_again_in_the_next_flight() -> None:
    flown = start(go(0.1, 0.0, -1.0), go(0.2, 0.0, -1.0), jump(0, 2), go(0.3, 0.0, -1.0)).fly()
    assert flown.reached == [0, 1, 2, 0, 1, 2, 0, 1, 2, 3]
    assert flown.texts.count("mission step 2: jump to step 0, 1 of 2") == 1
    assert flown.flight.progress.state is MissionState.COMPLETE
    again = Flown(begun(flown.flight, START, PACE)).fly()
    assert again.reached == flown.reached


def test_a_mission_that_ends_with_a_jump_ends_after_its_last_repetition() -> None:
    flown = start(go(0.1, 0.0, -1.0), jump(0, 1)).fly()
    assert flown.reached == [0, 1, 0, 1]
    assert flown.next_mode is Mode.HOLD
    assert flown.flight.progress.state is MissionState.COMPLETE
    endless = start(go(0.1, 0.0, -1.0), jump(0, -1)).fly(300.0)
    assert endless.next_mode is None
    assert endless.reached.count(0) > 10
    assert endless.flight.progress.state is MissionState.ACTIVE


def test_what_is_for_a_camera_is_passed_over_without_a_stop() -> None:
    skip = MissionStep(A.SKIP)
    flown = start(skip, go(0.1, 0.0, -1.0), skip, skip, go(0.2, 0.0, -1.0), skip).fly()
    assert flown.reached == [0, 1, 2, 3, 4, 5]
    assert flown.flight.progress.state is MissionState.COMPLETE


@pytest.mark.parametrize(
    ("steps", "number"),
    [
        ((jump(0, -1),), 0),
        ((jump(3, 1), go(0.0, 0.0, -1.0)), 0),
        ((go(0.0, 0.0, -1.0), jump(-1, 1)), 1),
        ((go(0.0, 0.0, -1.0), jump(2, -1), MissionStep(A.SKIP), jump(1, -1)), 1),
        ((go(0.0, 0.0, -1.0), jump(0, 5000)), 1),
        ((circle(0.1, 1.0),), 0),
    ],
)
def test_a_jump_or_circle_that_leads_nowhere_is_named(
    steps: tuple[MissionStep, ...], number: int
) -> None:
    wrong = mission_problem(steps)
    assert wrong is not None
    assert wrong[0] == number
    assert mission_problem((go(0.0, 0.0, -1.0), jump(0, -1))) is None


def test_a_speed_holds_for_the_legs_that_follow_and_for_a_jump_behind_it() -> None:
    slow = MissionStep(A.SPEED, speed=0.1)
    flown = start(slow, go(5.0, 0.0, -1.0)).fly()
    assert 0.0999 < max(math.hypot(*at.v_WE) for at in flown.points) < 0.1001
    flight = jumped(loaded((slow, go(1.0, 0.0, -1.0), go(5.0, 0.0, -1.0))), 2, 0, PACE)
    flown = Flown(begun(flight, START, PACE)).fly()
    assert 0.0999 < max(math.hypot(*at.v_WE) for at in flown.points) < 0.1001


def test_a_speed_beyond_the_greatest_is_flown_as_the_greatest_and_said() -> None:
    fast = MissionStep(A.SPEED, speed=5.0)
    flown = start(fast, go(50.0, 0.0, -1.0)).fly()
    assert 0.999 < max(math.hypot(*at.v_WE) for at in flown.points) < 1.001
    assert "mission step 0: 5 m/s is flown as 1 m/s" in flown.texts


def test_a_speed_that_is_given_up_is_the_usual_one_again() -> None:
    slow, usual = MissionStep(A.SPEED, speed=0.1), MissionStep(A.SPEED)
    flown = start(slow, usual, go(5.0, 0.0, -1.0)).fly()
    assert max(math.hypot(*point.v_WE) for point in flown.points) > 0.2999
    assert not any("is flown as" in text for text in flown.texts)


def test_a_text_about_a_speed_does_not_hide_that_the_mission_is_complete() -> None:
    flown = start(MissionStep(A.SPEED, speed=5.0)).fly()
    assert flown.texts == ["mission step 0: 5 m/s is flown as 1 m/s; mission complete"]


def arrival(look_at: Vec3 | None, end: Vec3, yaw: float | None = None) -> EndEffectorTarget:
    """The end of a way to a place while the nose points at another."""
    around = MissionContext(0, START.p_WE, 1.3, 0.0, nothing_there, PACE, look_at=look_at)
    flight = begun(loaded((go(*end, yaw=yaw),)), START, PACE)
    for _ in range(2):
        flight, _ = advance(flight, around)
    assert flight.segment is not None
    return flight.segment.at(flight.segment.end_us)


coordinates = st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.floats(-9.0, -0.5))


@given(coordinates, coordinates)
def test_at_the_end_of_a_way_the_nose_points_at_what_is_looked_at_however_the_step_turns(
    look_at: Vec3, end: Vec3
) -> None:
    assume(math.dist(look_at[:2], end[:2]) > 0.301)
    yaw = arrival(look_at, end, yaw=1.0).yaw
    distance = math.dist(look_at[:2], end[:2])
    ahead = end[0] + distance * math.cos(yaw), end[1] + distance * math.sin(yaw)
    assert ahead == pytest.approx(look_at[:2], abs=1e-6)


@pytest.mark.parametrize("look_at", [None, (4.2, 5.1, -1.0), (4.0, 5.0, -9.0)])
def test_above_what_is_looked_at_or_without_it_the_step_says_the_heading(
    look_at: Vec3 | None,
) -> None:
    assert arrival(look_at, (4.0, 5.0, -1.0), yaw=1.0).yaw == pytest.approx(1.0)
    assert arrival(look_at, (4.0, 5.0, -1.0)).yaw == pytest.approx(START.yaw)


def test_what_is_looked_at_is_left_alone_by_other_steps() -> None:
    around = MissionContext(0, START.p_WE, 1.3, 0.0, nothing_there, PACE)
    flight = begun(loaded((go(1.0, 0.0, -1.0), MissionStep(A.LOOK_AT))), START, PACE)
    for _ in range(2):
        flight, event = advance(flight, around)
        assert not event.looks
    flight = begun(jumped(flight, 1, 0, PACE), START, PACE)
    for _ in range(2):
        flight, event = advance(flight, around)
    assert (event.looks, event.look_at) == (True, None)


@pytest.mark.parametrize(
    ("late_us", "gives_up"), [(0, False), (4_999_999, False), (5_000_000, True)]
)
def test_a_place_is_waited_for_as_long_as_it_says(late_us: int, gives_up: bool) -> None:
    flown = start(go(0.5, 0.0, -1.0), go(1.0, 0.0, -1.0))
    flown.blocked = lambda _: START.p_WE
    while flown.flight.stage is not Stage.ARRIVE:
        flown.fly(STEP_US * 1e-6)
    around = MissionContext(
        flown.flight.since_us + late_us, START.p_WE, 1.3, 0.0, nothing_there, PACE
    )
    following, event = advance(flown.flight, around)
    assert (following.progress.current == 1) is gives_up
    assert event.unmet is gives_up


@pytest.mark.parametrize(("off", "reached"), [(0.25, True), (0.2501, False)])
def test_a_step_is_reached_within_its_acceptance(off: float, reached: bool) -> None:
    flown = start(go(0.5, 0.0, -1.0, acceptance=0.25), go(1.0, 0.0, -1.0))
    flown.blocked = lambda p: (p[0] + off, p[1], p[2])
    flown.fly(30.0)
    assert (0 in flown.reached) is reached


def test_a_stay_lasts_as_long_as_the_step_says() -> None:
    flown = start(MissionStep(A.DELAY, hold_s=2.0), go(1.0, 0.0, -1.0))
    while flown.flight.stage is not Stage.STAY:
        flown.fly(STEP_US * 1e-6)
    begin = flown.flight.since_us
    for later_us, done in ((1_999_999, False), (2_000_000, True)):
        context = MissionContext(begin + later_us, START.p_WE, 1.3, 0.0, nothing_there, PACE)
        assert (advance(flown.flight, context)[0].progress.current == 1) is done


def test_a_mission_that_is_not_flown_does_nothing() -> None:
    still = loaded((go(1.0, 0.0, -1.0),))
    flight, event = advance(still, MissionContext(0, REST, 1.0, 0.0, nothing_there, PACE))
    assert flight is still
    assert (event.next_mode, event.text, event.unmet, event.looks) == (None, "", False, False)


def test_progress_counts_from_a_mission_that_was_not_begun() -> None:
    assert loaded(()).progress.state is MissionState.NO_MISSION
    progress = loaded((go(1.0, 0.0, -1.0),) * 3, 4).progress
    assert (progress.state, progress.current, progress.total) == (MissionState.NOT_STARTED, 0, 3)
    assert (progress.reached, progress.reached_count) == (-1, 4)
    again = begun(paused(start(go(0.1, 0.0, -1.0)).fly().flight), START, PACE).progress
    assert (again.state, again.current, again.reached) == (MissionState.ACTIVE, 0, -1)


def test_a_jump_in_a_mission_that_is_complete_lets_it_start_there() -> None:
    done = paused(start(go(0.1, 0.0, -1.0), go(0.2, 0.0, -1.0)).fly().flight)
    assert done.progress.state is MissionState.COMPLETE
    jump = jumped(done, 1, 0, PACE).progress
    assert (jump.state, jump.current) == (MissionState.NOT_STARTED, 1)
    assert jumped(paused(start(go(9.0, 0.0, -1.0)).flight), 0, 0, PACE).progress.state is (
        MissionState.PAUSED
    )


def test_altitude_above_home_counts_from_home() -> None:
    flown = Flown(begun(loaded((go(0.0, 0.0, -2.0, above_home=True),)), START, PACE), home_z=-0.35)
    assert flown.fly().points[-1].p_WE == (0.0, 0.0, -2.35)
    deep = Flown(begun(loaded((go(0.0, 0.0, -2.0, above_home=True),)), START, PACE), home_z=5.0)
    assert deep.fly().points[-1].p_WE == (0.0, 0.0, 0.0), "no lower than an item may be"


def test_a_takeoff_is_straight_up_to_a_height_of_the_base() -> None:
    takeoff = MissionStep(A.TAKE_OFF, (9.0, 9.0, -2.0))
    flown = start(takeoff).fly()
    assert flown.points[-1].p_WE == (0.0, 0.0, -1.7)  # 0.7 m more than 1.3 m
    assert Flown(begun(loaded((takeoff,)), START, PACE), height=5.0).fly().points[-1].p_WE == (
        START.p_WE
    )


def test_a_step_is_reached_by_the_vehicle_not_by_the_clock() -> None:
    def stuck(p: Vec3) -> Vec3:
        return (min(p[0], 0.5), p[1], p[2])

    flown = start(go(1.0, 0.0, -1.0), go(0.0, 0.0, -1.0))
    flown.blocked = stuck
    flown.fly()
    assert flown.reached == [1]
    assert "mission step 0 not reached: 0.50 m away" in flown.texts


def test_a_leg_beyond_a_wall_ends_at_its_clearance() -> None:
    ahead = wall((-1.0, 0.0, 0.0), -1.0, 0.1)
    flown = start(go(2.0, 0.5, -1.0))
    flown.safe_set = SafeSet((ahead,))
    flown.fly()
    assert max(at.p_WE[0] for at in flown.points) <= 0.9 + 1e-4
    assert flown.reached == []
    assert "not reached" in flown.texts[-1]


def test_a_reference_in_a_corner_keeps_every_wall() -> None:
    half = math.sqrt(0.5)
    walls = (wall((-1.0, 0.0, 0.0), -1.0, 0.1), wall((half, -half, 0.0), -1.0, 0.1))
    x, y, _ = project_to_safe_set((5.0, 9.0, -1.0), SafeSet(walls), 0)
    assert x <= 0.9 + 1e-3
    assert half * (x - y) >= -0.9 - 1e-3


def test_a_place_of_a_mission_in_the_ball_of_a_point_moves_to_its_surface() -> None:
    branch = point((1.0, 0.0, -1.0), 0.25)
    around = SafeSet((wall((-1.0, 0.0, 0.0), -1.2, 0.1), branch))
    p = project_to_safe_set((1.05, 0.05, -1.0), around, 0)
    assert math.dist(p, (1.0, 0.0, -1.0)) >= 0.25 - 1e-3
    assert p[0] <= 1.1 + 1e-3
    assert project_to_safe_set((0.0, 0.0, -1.0), around, 0) == (0.0, 0.0, -1.0)


def test_landing_and_return_are_handed_over_and_a_landing_is_reached_on_the_ground() -> None:
    landing = start(go(0.1, 0.0, -1.0), MissionStep(A.LAND)).fly()
    assert landing.next_mode is Mode.LAND
    assert landing.reached == [0]
    assert landing.flight.stage is Stage.GONE
    done = touched_down(landing.flight).progress
    assert (done.reached, done.state) == (1, MissionState.COMPLETE)
    returned = start(MissionStep(A.RETURN)).fly()
    assert returned.next_mode is Mode.RETURN
    assert returned.reached == [0]


def test_a_landing_that_is_broken_off_is_not_reached() -> None:
    landing = start(MissionStep(A.LAND)).fly()
    aborted = paused(landing.flight)
    assert aborted.progress.state is MissionState.PAUSED
    assert touched_down(aborted) is aborted


def test_a_pause_begins_the_same_step_again() -> None:
    flown = start(go(1.0, 0.0, -1.0), go(2.0, 0.0, -1.0)).fly(14.0)
    assert flown.flight.progress.current == 1
    stopped = paused(flown.flight)
    assert stopped.progress.state is MissionState.PAUSED
    here = EndEffectorTarget(flown.t_us, (1.2, 0.3, -1.0), REST, REST, 0.0)
    again = Flown(begun(stopped, here, PACE), flown.t_us).fly()
    assert again.points[0].p_WE == (1.2, 0.3, -1.0)
    assert again.reached == [1]


def test_without_autocontinue_the_vehicle_holds_before_the_next_step() -> None:
    flown = start(go(1.0, 0.0, -1.0, stop_after=True), go(2.0, 0.0, -1.0)).fly()
    assert flown.next_mode is Mode.HOLD
    assert (flown.reached, flown.flight.progress.current) == ([0], 1)


def test_a_flown_mission_can_be_flown_again() -> None:
    flown = start(go(1.0, 0.0, -1.0), go(0.0, 0.0, -1.0)).fly()
    again = Flown(begun(paused(flown.flight), START, PACE), flown.t_us)
    assert again.flight.progress.current == 0
    assert again.flight.progress.reached_count == 2
    assert again.fly().reached == [0, 1]


def test_on_the_ground_the_step_that_comes_next_must_be_a_takeoff() -> None:
    steps = (MissionStep(A.TAKE_OFF, (0.0, 0.0, -1.0)), go(1.0, 0.0, -1.0), MissionStep(A.SPEED))
    for current, allowed in ((0, True), (1, False), (2, False)):
        flight = jumped(loaded(steps), current, 0, PACE)
        assert (refusal(flight, landed=True) is None) is allowed
    done = replace(loaded(steps).progress, state=MissionState.COMPLETE, current=2)
    assert refusal(replace(loaded(steps), progress=done), landed=True) is None, "it starts over"


def test_what_speaks_against_a_mission() -> None:
    assert refusal(loaded(()), landed=False) == "no mission: none was uploaded"
    grounded = refusal(loaded((go(1.0, 0.0, -1.0),)), landed=True)
    assert grounded is not None
    assert "take off first" in grounded
    slow_start = (MissionStep(A.SPEED, speed=0.1), MissionStep(A.TAKE_OFF, (0.0, 0.0, -1.0)))
    assert refusal(loaded(slow_start), landed=True) is None
    assert refusal(loaded((go(1.0, 0.0, -1.0),)), landed=False) is None


def test_a_return_leads_to_the_nearest_of_home_and_rally_points() -> None:
    home = Home((0.0, 0.0, -0.35), 0.5)
    assert nearest(home, (), (9.0, 9.0, -2.0)) == home
    there = nearest(home, ((10.0, 0.0), (0.0, 10.0)), (7.0, 1.0, -2.0))
    assert there == Home((10.0, 0.0, -0.35), 0.5)
    assert nearest(home, ((10.0, 0.0),), (4.0, 1.0, -2.0)) == home
