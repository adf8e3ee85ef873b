"""The way home: up, across, down to where it waits; and what follows."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsw.autopilot.flight.modes.return_ import Return
from fsw.autopilot.flight.state import FlightState
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import Mode, Vec3
from tests.fsw.autopilot.flight.contexts import STANDING
from tests.fsw.autopilot.flight.contexts import flying as in_the_air
from tests.fsw.autopilot.flight.in_flight import CONFIG, HANDOVER, HOME, flying, limits, vehicle_at

HEIGHTS = limits(return_height=3.0, return_descent=1.0)


def way(z: float, config: FlightConfig = HEIGHTS) -> list[Vec3]:
    """The places from (1, 1, z) home, in order."""
    begun = Return(config).activate(flying(), vehicle_at((1.0, 1.0, z)), HANDOVER)
    goal = begun.setpoint.goal
    assert goal is not None
    assert goal.motion.p is not None
    return [goal.motion.p, *begun.setpoint.waypoints]


def test_from_below_it_climbs_to_the_return_height_where_it_is_then_crosses_then_descends() -> None:
    x, y, ground = HOME.p
    up, across, down = way(-1.5)
    assert up == pytest.approx((1.0, 1.0, ground - 3.0))
    assert across == pytest.approx((x, y, ground - 3.0))
    assert down == pytest.approx((x, y, ground - 1.0))


@given(st.floats(3.01, 40.0))
def test_from_above_it_keeps_its_height_until_it_is_over_home(height: float) -> None:
    x, y, ground = HOME.p
    z = ground - height
    assert way(z) == [(1.0, 1.0, z), (x, y, z), pytest.approx((x, y, ground - 1.0))]


@given(st.floats(0.5, 10.0), st.floats(0.5, 20.0))
def test_whatever_the_heights_no_leg_is_below_the_vehicle_or_the_return_before_home(
    height: float, return_height: float
) -> None:
    x, y, ground = HOME.p
    config = limits(return_height=return_height, return_descent=return_height)
    places = way(ground - height, config)
    level = max(height, return_height)
    assert [ground - p[2] for p in places[:2]] == pytest.approx([level, level])
    assert places[1][:2] == places[-1][:2] == (x, y)
    # It descends over home, and only where there is something to descend.
    assert ground - places[-1][2] == pytest.approx(min(level, return_height))
    assert len(places) == (3 if height > return_height + 1e-9 else 2) or height == return_height


def test_a_rally_point_that_is_nearer_takes_the_place_of_home() -> None:
    state = flying()
    state = replace(state, mission=replace(state.mission, rally=((1.5, 1.0),)))
    begun = Return(HEIGHTS).activate(state, vehicle_at((1.0, 1.0, -1.5)), HANDOVER)
    assert begun.setpoint.waypoints[0][:2] == (1.5, 1.0)


def test_without_a_home_there_is_no_way() -> None:
    state = flying()
    lost = replace(state, vehicle=replace(state.vehicle, home=None))
    setpoint = Return(CONFIG).activate(lost, vehicle_at((1.0, 1.0, -1.5)), HANDOVER).setpoint
    assert (setpoint.reference, setpoint.goal, setpoint.waypoints) == (None, None, ())


def over_home(moved_us: int) -> FlightState:
    """At the last place of the way, at rest, since then."""
    mode, down = Return(HEIGHTS), way(-5.0)[-1]
    state = mode.activate(flying(Mode.RETURN), vehicle_at(down), HANDOVER)
    reference, goal = state.setpoint.reference, state.setpoint.goal
    assert reference is not None
    assert goal is not None
    goal = replace(goal, motion=replace(goal.motion, p=down))
    setpoint = replace(state.setpoint, reference=reference, goal=goal, waypoints=())
    vehicle = replace(state.vehicle, moved_us=moved_us)
    return replace(state, setpoint=setpoint, vehicle=vehicle)


@pytest.mark.parametrize(
    ("wait", "now_us", "follows"),
    [
        (0.0, 1_000_000, Mode.LAND),
        (2.0, 2_998_000, None),
        (2.0, 3_000_000, Mode.LAND),
        (-1.0, 1_000_000, Mode.HOLD),
    ],
)
def test_home_it_waits_then_lands_or_stays(wait: float, now_us: int, follows: Mode | None) -> None:
    config = limits(return_height=3.0, return_descent=1.0, return_wait=wait)
    state = over_home(moved_us=1_000_000)
    estimate = vehicle_at((3.0, -2.0, -1.3), t_us=now_us)
    after, result = Return(config).update(state, estimate)
    assert result.next_mode is follows
    assert after is state
    if follows is not None:
        assert result.completed
        assert result.cause == "return point reached"


@pytest.mark.parametrize("part", ["waypoints", "place", "speed", "reference"])
def test_the_wait_begins_when_the_whole_way_is_flown_and_the_setpoint_rests(part: str) -> None:
    state = over_home(moved_us=0)
    setpoint = state.setpoint
    assert setpoint.reference is not None
    (x, y, z), reference = setpoint.reference.p, setpoint.reference
    setpoint = {
        "waypoints": replace(setpoint, waypoints=((0.0, 0.0, -1.0),)),
        "place": replace(setpoint, reference=replace(reference, p=(x + 0.05, y, z))),
        "speed": replace(setpoint, reference=replace(reference, v=(0.0, 0.1, 0.0))),
        "reference": replace(setpoint, reference=None),
    }[part]
    on_the_way = replace(state, setpoint=setpoint)
    after, result = Return(HEIGHTS).update(on_the_way, vehicle_at((0.0, 0.0, -2.0), t_us=7_000_000))
    assert result.next_mode is None
    assert after.vehicle.moved_us == 7_000_000


def test_only_a_vehicle_in_the_air_returns() -> None:
    mode = Return(CONFIG)
    assert mode.refusal(in_the_air()) is None
    assert "ground" in (mode.refusal(in_the_air(landed=True)) or "")
    assert "not armed" in (mode.refusal(STANDING) or "")
