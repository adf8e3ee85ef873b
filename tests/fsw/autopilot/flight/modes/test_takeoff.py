"""A takeoff: up at its speed as far as was asked, then hold."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fsw.autopilot.flight.modes.takeoff import Takeoff
from fsw.autopilot.signals import Mode
from tests.fsw.autopilot.flight.contexts import READY
from tests.fsw.autopilot.flight.contexts import flying as in_the_air
from tests.fsw.autopilot.flight.in_flight import flying, limits, vehicle_at

CONFIG = limits(climb_speed=0.5, takeoff_wait_us=3_000_000)
TAKEOFF = Takeoff(CONFIG)
STATE = flying(
    Mode.TAKEOFF, mode_origin=(1.0, 2.0, -0.1), mode_yaw=0.4, mode_begin_us=1_000_000, climb=2.0
)


@pytest.mark.parametrize(
    ("t_us", "risen", "speed"),
    [(1_000_000, 0.0, 0.5), (3_000_000, 1.0, 0.5), (5_000_001, 2.0, 0.0), (9_000_000, 2.0, 0.0)],
)
def test_the_reference_climbs_at_its_speed_and_stays_there(
    t_us: int, risen: float, speed: float
) -> None:
    target = TAKEOFF.reference(STATE, t_us)
    assert target.p_WE == pytest.approx((1.0, 2.0, -0.1 - risen))
    assert target.yaw == 0.4
    if t_us > 1_000_000:
        assert target.v_WE == pytest.approx((0.0, 0.0, -speed))


@pytest.mark.parametrize(("t_us", "done"), [(4_999_999, False), (5_000_000, True)])
def test_it_is_done_when_the_reference_has_climbed(t_us: int, done: bool) -> None:
    after, result = TAKEOFF.update(STATE, vehicle_at((1.0, 2.0, -1.0), t_us=t_us))
    assert after is STATE
    assert result.next_mode is (Mode.HOLD if done else None)
    assert result.completed


@pytest.mark.parametrize(("later_us", "forgotten"), [(2_999_999, False), (3_000_000, True)])
def test_chosen_before_arming_it_is_forgotten_after_a_while(later_us: int, forgotten: bool) -> None:
    state = replace(STATE, vehicle=replace(STATE.vehicle, intended_us=500_000))
    text = TAKEOFF.waits(state, 500_000 + later_us)
    assert (text == "takeoff cancelled: not armed within 3 s") is forgotten
    assert (text is None) is not forgotten


def test_a_vehicle_in_the_air_does_not_take_off_but_goes_on_doing_so() -> None:
    assert TAKEOFF.refusal(READY) is None
    assert "in the air already" in (TAKEOFF.refusal(in_the_air()) or "")
    assert TAKEOFF.refusal(in_the_air(mode=Mode.TAKEOFF)) is None
