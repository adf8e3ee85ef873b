"""Exact states as a tick uses them: parts that are missing, frames that do not come, the return."""

from __future__ import annotations

import math
from typing import Any

import pytest

from fsw.autopilot.estimation.estimator import estimate_state
from fsw.autopilot.flight.estimate.exact_state import ExactState
from fsw.autopilot.flight.fast_loop import loops_of
from fsw.autopilot.flight.plan_exchange import nominal_at_rest
from fsw.autopilot.flight.state import AIDED, COMPLETE, FlightState, first_state
from fsw.autopilot.measurements import Sensor
from fsw.autopilot.signals import SensorFrame, StateEstimate, StatusText, TickInputs
from fsw.frozen import replace
from tests.fsw.autopilot.flight.in_flight import CONFIG, flying
from tests.fsw.records import fast_loop, with_record

TICK_US = CONFIG.tick_period_us
EXACT = ExactState(fast_loop(loops_of(CONFIG)))
NOTHING = (math.nan,) * 3
FAR = (0.0, 0.4, -3.0)


def frame(k: int, **changes: Any) -> SensorFrame:
    """Tick k of a vehicle that hovers, or as changed."""
    hovering = SensorFrame(
        t_us=1_000_000 + k * TICK_US,
        p_WB=(0.0, 0.0, -3.0),
        v_WB=(0.0, 0.0, 0.0),
        q_WB=(1.0, 0.0, 0.0, 0.0),
        gyro_B=(0.0, 0.0, 0.0),
        accel_B=(0.0, 0.0, -9.80665),
        q_arm=(0.0, 0.0),
        qd_arm=(0.0, 0.0),
    )
    return replace(hovering, **changes)


def hovering() -> FlightState:
    seen = estimate_state(frame(0))
    assert seen is not None
    return with_record(flying(), state_estimate=seen, plan_state=nominal_at_rest(seen))


def seen(state: FlightState, s: SensorFrame, stale_us: int = 0) -> tuple[FlightState, list[str]]:
    """The state after a tick of estimates, and what it said."""
    texts: list[StatusText] = []
    state, r = EXACT.estimate(state, TickInputs(s, stale_us=stale_us), texts)
    return replace(state, record=r), [one.text for one in texts]


def estimate_of(state: FlightState) -> StateEstimate:
    assert state.estimate is not None
    return state.estimate


def test_a_frame_in_range_is_the_estimate_wherever_it_is() -> None:
    state, texts = seen(hovering(), frame(1, p_WB=FAR))
    assert state.estimate == estimate_state(frame(1, p_WB=FAR))
    assert (state.dropout, state.aiding, texts) == (COMPLETE, AIDED, [])


@pytest.mark.requirement("REQ-EST-10")
def test_a_pose_that_is_missing_is_carried_on_and_the_plan_moves_along_when_it_is_back() -> None:
    state, said = hovering(), []
    for k in range(1, 101):
        state, texts = seen(state, frame(k, p_WB=NOTHING))
        said += texts
    assert said == ["pose implausible"]
    assert math.dist(estimate_of(state).p_WB, (0.0, 0.0, -3.0)) < 1e-3
    assert state.aiding.unaided_us == 99 * TICK_US
    assert 0.0 < state.aiding.position_sigma < 0.01
    state, _ = seen(state, frame(101, p_WB=NOTHING), stale_us=TICK_US)  # it did not come at all
    assert estimate_of(state).t_us == frame(101).t_us
    state, texts = seen(state, frame(102, p_WB=FAR))
    assert estimate_of(state).p_WB == FAR
    assert texts == ["estimate moved by 400 mm, 0.000 rad: the plan moves along"]
    assert state.plan_state is not None
    assert state.plan_state.p[1] == pytest.approx(0.4, abs=1e-3)
    assert state.aiding == AIDED


@pytest.mark.parametrize(
    ("changes", "sensor"),
    [({"gyro_B": NOTHING}, Sensor.IMU), ({"qd_arm": (0.0, 1e3)}, Sensor.ENCODERS)],
)
def test_a_sensor_that_every_tick_needs_is_lost_for_as_long_as_it_is_missing(
    changes: dict[str, Any], sensor: Sensor
) -> None:
    state = hovering()
    for k in range(1, 40):
        state, _ = seen(state, frame(k, **changes))
    (lost,) = state.aiding.lost
    assert (lost.sensor, lost.since_us) == (sensor, frame(1).t_us)
    assert math.isfinite(sum(estimate_of(state).w_WB_B) + sum(estimate_of(state).qd_arm))
    state, _ = seen(state, frame(40))
    assert state.aiding == AIDED
    assert state.estimate == estimate_state(frame(40))


@pytest.mark.parametrize("value", [math.nan, math.inf, 1e300])
def test_on_the_ground_a_frame_is_taken_whole_or_not_at_all(value: float) -> None:
    bad = frame(1, gyro_B=(value, 0.0, 0.0))
    for stale_us in (0, TICK_US):
        state, texts = seen(first_state(CONFIG.airframe), bad, stale_us)
        assert (state.estimate, state.invalid_ticks, texts) == (None, 1, [])
    dropped, _ = seen(hovering(), bad)
    landed, _ = seen(replace(dropped, vehicle=first_state(CONFIG.airframe).vehicle), frame(2))
    assert (landed.dropout, landed.aiding) == (COMPLETE, AIDED)
    assert landed.estimate == estimate_state(frame(2))
