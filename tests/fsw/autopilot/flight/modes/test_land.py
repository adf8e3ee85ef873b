"""A landing: down at its speed, and over when the ground is felt."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fsw.autopilot.control.cascade import in_hover
from fsw.autopilot.flight.modes.land import Land
from fsw.autopilot.flight.plan_exchange import nominal_at_rest, with_plan_state
from fsw.autopilot.signals import Mode, StateEstimate
from tests.fsw.autopilot.flight.in_flight import GROUND_Z, flying, limits, vehicle_at

CONFIG = limits(land_speed=0.25, landed_height=0.1, landed_speed=0.05, landed_time_us=500_000)
LAND = Land(CONFIG)


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


def test_it_is_over_when_the_ground_is_felt() -> None:
    state = flying(Mode.LAND, unloaded=(600_000, 0.0))
    for t_us, over in ((999_999, False), (1_000_000, True)):
        after, result = LAND.update(state, at(0.0, t_us=t_us))
        assert (result.next_mode is Mode.DISARMED) is over
        assert after.vehicle.landed is over
    assert result.cause == "touched down"


def test_a_plan_below_a_vehicle_that_flies_is_no_ground() -> None:
    """It was, and a height that was wrong stopped the rotors 0.28 m above the ground."""
    estimate = at(0.0)
    x, y, z = estimate.p_WB
    nominal = nominal_at_rest(estimate)._replace(p=(x, y, z + 0.06))
    hover = with_plan_state(in_hover(CONFIG.airframe, estimate), nominal)
    state = replace(flying(Mode.LAND, moved_us=0), record=hover)
    after, result = LAND.update(state, estimate)
    assert result.next_mode is None
    assert after.vehicle.moved_us == estimate.t_us
