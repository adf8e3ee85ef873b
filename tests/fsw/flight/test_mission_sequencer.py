"""A mission in flight: order, smoothness, what is reached and what is not."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from hypothesis import given, settings
from hypothesis import strategies as st

from fsw.flight.mission_sequencer import (
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
from fsw.flight.reference_governor import project, project_to_safe_set
from fsw.flight.trajectory_segment import MotionLimits
from fsw.shapes.ball import point
from fsw.shapes.half_space import wall
from fsw.signals import (
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

    def fly(self, seconds: float = math.inf) -> Flown:
        end_us = self.t_us + min(seconds, 2e4) * 1e6
        while self.next_mode is None and self.t_us < end_us:
            self.t_us += STEP_US
            assert self.flight.segment is not None
            here = project(self.flight.segment.at(self.t_us), self.safe_set)
            self.points.append(here)
            where = MissionContext(
                self.t_us, self.blocked(here.p_WE), self.height, self.home_z, self.safe_set
            )
            count = self.flight.progress.reached_count
            self.flight, event = advance(self.flight, where, PACE)
            if self.flight.progress.reached_count > count:
                self.reached.append(self.flight.progress.reached)
            self.next_mode = event.next_mode
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
        assert math.dist(at.a_WE, last.a_WE) <= bend * STEP_US * 1e-6 + 1e-9
        last = at


def test_steps_come_in_order_and_each_is_stayed_at() -> None:
    flown = start(go(1.0, 0.0, -1.0, hold=2.0), go(1.0, 1.0, -1.5)).fly()
    assert flown.reached == [0, 1]
    there = [at for at in flown.points if math.dist(at.p_WE, (1.0, 0.0, -1.0)) < 1e-9]
    assert 2.0 <= len(there) * STEP_US * 1e-6 <= 2.3
    assert flown.points[-1].p_WE == (1.0, 1.0, -1.5)
    assert flown.texts[-1] == "mission complete"


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


def test_altitude_above_home_counts_from_home() -> None:
    flown = Flown(begun(loaded((go(0.0, 0.0, -2.0, above_home=True),)), START, PACE), home_z=-0.35)
    assert flown.fly().points[-1].p_WE == (0.0, 0.0, -2.35)


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
