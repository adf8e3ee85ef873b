"""What telemetry shows is of the state that a tick left, every field of it."""

from __future__ import annotations

from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.flight.snapshot import Shown
from fsw.autopilot.signals import (
    ArmingReport,
    FlightSnapshot,
    HostHealth,
    Mode,
    PayloadReport,
    PlanInput,
    SensorFrame,
)
from fsw.frozen import replace
from tests.fsw.autopilot.flight.in_flight import flying, vehicle_at

NONE = (0.0, 0.0, 0.0)
FRAME = SensorFrame(2_000, NONE, NONE, (1.0, *NONE), NONE, (0.1, 0.2, -9.7), (0.0, 0.0), (0.0, 0.0))


def shown(**changes: Any) -> Shown:
    state = flying(Mode.LAND, gripper=1.0, failsafe_from=Mode.ORBIT, **changes)
    full = HostHealth(log_failure="the disk is full")
    state = replace(state, arming=ArmingReport((5,)), host=full)
    r = state.record.copy()
    r.state_estimate = vehicle_at((1.0, 2.0, -3.0), t_us=2_000)
    r.plan_input = PlanInput((0.1, 0.2, 0.3), 0.4, (0.5, 0.6))
    r.payload.mass = 0.25
    return Shown(replace(state, record=r), FRAME)


def test_every_field_is_found_in_the_state() -> None:
    one = shown()
    for name, kind in get_type_hints(FlightSnapshot).items():
        kinds = get_args(kind) if isinstance(kind, UnionType) else (kind,)
        assert isinstance(getattr(one, name), tuple(get_origin(k) or k for k in kinds)), name
    assert (one.t_us, one.mode, one.armed, one.landed) == (2_000, Mode.LAND, True, False)
    assert one.estimate.p_WB == (1.0, 2.0, -3.0)
    assert one.accel_B == FRAME.accel_B
    assert one.payload == PayloadReport(True, 0.25)
    assert one.touching is None
    assert (one.arming, one.log_failure) == (ArmingReport((5,)), "the disk is full")
    assert (one.intended_mode, one.failsafe_from) == (one.state.vehicle.intended_mode, Mode.ORBIT)


def test_failures_are_those_conditions_that_are_faults() -> None:
    assert shown().failures == ()
    held = (Condition.ESTIMATE_INVALID, Condition.BATTERY_LOW)
    assert shown(conditions=held).failures == (Condition.ESTIMATE_INVALID.value,)


def test_a_vehicle_that_does_not_fly_follows_no_plan() -> None:
    one = shown()
    r = one.state.record.copy()
    r.has_plan = 1
    flies = Shown(replace(one.state, record=r), FRAME)
    assert flies.plan_state is not None
    assert flies.plan_input == PlanInput((0.1, 0.2, 0.3), 0.4, (0.5, 0.6))
    stands = replace(one.state.vehicle, mode=Mode.DISARMED)
    still = Shown(replace(one.state, record=r, vehicle=stands), FRAME)
    assert still.plan_state is None
    assert still.plan_input is None
