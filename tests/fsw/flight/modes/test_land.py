"""A landing: down at its speed, and over when the ground is felt."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fsw.flight.modes.land import Land
from fsw.flight.plan_exchange import nominal_at_rest
from fsw.flight.state import FlightState
from fsw.signals import Mode, StateEstimate, Vec3
from tests.fsw.flight.in_flight import GROUND_Z, flying, limits, vehicle_at

CONFIG = limits(land_speed=0.25, landed_height=0.1, landed_speed=0.05, landed_time_us=500_000)
LAND = Land(CONFIG)
STILL: Vec3 = (0.0, 0.0, 0.0)


def descending(estimate: StateEstimate, plan_below: float, moved_us: int = 0) -> FlightState:
    x, y, z = estimate.p_WB
    nominal = nominal_at_rest(estimate)._replace(p=(x, y, z + plan_below))
    return replace(flying(Mode.LAND, moved_us=moved_us), nominal=nominal)


def at(height: float, sink: float = 0.0, t_us: int = 1_000_000) -> StateEstimate:
    return vehicle_at((0.0, 0.0, GROUND_Z - height), (0.0, 0.0, sink), t_us)


@pytest.mark.parametrize("seconds", [0.0, 1.0, 10.0])
def test_the_reference_goes_straight_down_at_the_landing_speed(seconds: float) -> None:
    state = flying(Mode.LAND, mode_origin=(1.0, 2.0, -9.0), mode_begin_us=500_000, mode_yaw=0.7)
    target = LAND.reference(state, 500_000 + round(1e6 * seconds))
    assert target.p_WE == pytest.approx((1.0, 2.0, -9.0 + 0.25 * seconds))
    assert target.yaw == 0.7
    assert LAND.reference(state, 20_000_000).v_WE == pytest.approx((0.0, 0.0, 0.25))


def test_the_descent_goes_on_for_a_hundred_metres_wherever_the_ground_is() -> None:
    state = flying(Mode.LAND, mode_origin=(1.0, 2.0, -9.0))
    assert LAND.reference(state, 399_000_000).v_WE[2] > 0.0


@pytest.mark.parametrize(
    ("height", "sink", "plan_below", "moved_us", "over"),
    [
        # Pressed on the ground: at once, however it still moves.
        (0.0, 0.2, 0.06, 1_000_000, True),
        (0.0, 0.2, 0.04, 1_000_000, False),
        # Held up by the ground: when it has been so for half a second.
        (0.0, 0.0, 0.0, 500_000, True),
        (0.0, 0.04, 0.0, 500_000, True),
        (0.0, -0.04, 0.0, 500_000, True),
        (0.0, 0.0, 0.0, 500_001, False),
        (0.0, 0.05, 0.0, 500_000, False),
        # High above it neither.
        (0.2, 0.0, 0.5, 0, False),
        (0.2, 0.0, 0.0, 0, False),
    ],
)
def test_it_is_over_when_the_ground_is_felt(
    height: float, sink: float, plan_below: float, moved_us: int, over: bool
) -> None:
    estimate = at(height, sink)
    after, result = LAND.update(descending(estimate, plan_below, moved_us), estimate)
    assert (result.next_mode is Mode.DISARMED) is over
    assert after.vehicle.landed is over
    if over:
        assert result.cause == "touched down"


@pytest.mark.parametrize(
    ("height", "sink", "moves"), [(0.0, 0.0, False), (0.0, 0.1, True), (0.0, -0.1, True),
                                  (0.2, 0.0, True)],
)  # fmt: skip
def test_as_long_as_it_moves_the_wait_begins_anew(height: float, sink: float, moves: bool) -> None:
    estimate = at(height, sink)
    after, result = LAND.update(descending(estimate, 0.0, moved_us=900_000), estimate)
    assert result.next_mode is None
    assert after.vehicle.moved_us == (estimate.t_us if moves else 900_000)


def test_without_a_plan_it_waits_for_the_vehicle_to_lie_still() -> None:
    state = replace(flying(Mode.LAND, moved_us=0), nominal=None)
    assert LAND.update(state, at(0.0))[1].next_mode is Mode.DISARMED
    assert LAND.update(state, at(0.0, sink=0.2))[1].next_mode is None
