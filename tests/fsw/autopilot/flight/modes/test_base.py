"""What every flight mode does unless it says otherwise."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fsw.autopilot.flight.land_detector import in_the_air
from fsw.autopilot.flight.modes.base import CONTINUE, FlightMode
from fsw.autopilot.flight.modes.hold import Hold
from fsw.autopilot.flight.modes.land import Land
from fsw.autopilot.flight.modes.takeoff import Takeoff
from fsw.autopilot.flight.modes.trajectory import Trajectory
from fsw.autopilot.flight.setpoints.generator import PositionGoal, ReferenceState
from fsw.autopilot.flight.state import SetpointMemory
from fsw.autopilot.mpc.reference import still_at
from fsw.autopilot.signals import Mode, MotionSetpoint, Vec3
from tests.fsw.autopilot.flight.contexts import STANDING
from tests.fsw.autopilot.flight.in_flight import CONFIG, HANDOVER, flying, vehicle_at

PLAIN = FlightMode(CONFIG)
GOAL = PositionGoal(MotionSetpoint(False, (5.0, 0.0, -2.0)))
PLACE: Vec3 = (9.0, 9.0, -1.0)


def test_a_plain_mode_needs_nothing_stays_and_never_ends() -> None:
    state, estimate = flying(mode_origin=(1.0, 2.0, -3.0), mode_yaw=0.4), vehicle_at(PLACE)
    assert PLAIN.refusal(STANDING) is None
    assert PLAIN.denial(STANDING) is None
    assert PLAIN.waits(state, 10**9) is None
    assert PLAIN.aim(state, estimate) is state
    assert PLAIN.update(state, estimate) == (state, CONTINUE)
    assert PLAIN.target(state, 5) == still_at((1.0, 2.0, -3.0), 5, 0.4)


def test_a_mode_that_goes_on_changes_and_says_nothing() -> None:
    assert (CONTINUE.next_mode, CONTINUE.texts, CONTINUE.lift_off) == (None, (), False)


def test_a_setpoint_is_what_is_flown_until_another_mode_begins() -> None:
    setpoint = SetpointMemory(ReferenceState(True, PLACE, (0.1, 0.0, 0.0), 0.7))
    state = replace(flying(), setpoint=setpoint)
    target = PLAIN.target(state, 5)
    assert (target.p_WE, target.v_WE, target.yaw) == (PLACE, (0.1, 0.0, 0.0), 0.7)
    begun = PLAIN.activate(state, vehicle_at(PLACE), HANDOVER)
    assert begun.setpoint == SetpointMemory()


def test_a_goal_is_flown_as_fast_as_it_says_or_else_as_commanded_or_else_as_usual() -> None:
    slow = replace(GOAL, speed=0.2)
    assert PLAIN.guided(GOAL, flying()) is GOAL
    assert PLAIN.guided(slow, flying(speed=0.6)) is slow
    assert PLAIN.guided(GOAL, flying(speed=0.6)) == replace(GOAL, speed=0.6)
    assert PLAIN.guided(slow, flying(speed=0.6, look_at=PLACE)).speed == 0.2


@pytest.mark.parametrize("speed", [None, 0.6])
def test_the_nose_points_where_it_was_told_to(speed: float | None) -> None:
    guided = PLAIN.guided(GOAL, flying(look_at=PLACE, speed=speed))
    assert guided == replace(GOAL, look_at=PLACE, speed=speed)


def test_a_mode_that_names_what_it_follows_follows_nothing_else() -> None:
    takeoff, hold, land = Takeoff(CONFIG), Hold(CONFIG), Land(CONFIG)
    trajectory = Trajectory(CONFIG)
    assert takeoff.can_follow(hold)
    assert not takeoff.can_follow(trajectory)
    assert not takeoff.can_follow(land)
    assert trajectory.can_follow(hold)
    assert not trajectory.can_follow(land)
    assert hold.can_follow(land)


def test_a_vehicle_that_moves_has_moved_now() -> None:
    state = flying(Mode.LAND, moved_us=3)
    assert in_the_air(state, vehicle_at(PLACE, t_us=8)).vehicle == replace(
        state.vehicle, moved_us=8
    )
