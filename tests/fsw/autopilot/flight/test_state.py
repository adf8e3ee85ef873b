"""What follows from the state alone."""

from __future__ import annotations

import pytest

from fsw.autopilot.control.safety_gate import stopped
from fsw.autopilot.estimation.faults.sensor_fault import SensorFault
from fsw.autopilot.flight.state import (
    Aiding,
    LostSensor,
    OffboardMemory,
    VehicleMemory,
    first_state,
    is_young,
)
from fsw.autopilot.measurements import Sensor
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.signals import Mode, PlannerCounters, SafeSet, SolverStatus


@pytest.mark.parametrize("mode", Mode)
def test_a_vehicle_flies_while_it_is_armed_and_not_on_the_ground(mode: Mode) -> None:
    armed = mode not in (Mode.DISARMED, Mode.FAULT)
    for landed in (True, False):
        vehicle = VehicleMemory(mode=mode, landed=landed)
        assert (vehicle.armed, vehicle.flies) == (armed, armed and not landed)


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize(
    ("pose", "unaided_us", "lost", "held"),
    [
        (Sensor.POSE, 0, Sensor.IMU, True),
        (Sensor.POSE, 249_999, Sensor.IMU, True),
        (Sensor.POSE, 250_000, Sensor.IMU, False),
        (Sensor.GNSS, 0, Sensor.IMU, False),
        (Sensor.GNSS, 10**7, Sensor.ENCODERS, True),
    ],
)
def test_a_pose_or_the_inertial_unit_holds_the_attitude(
    pose: Sensor, unaided_us: int, lost: Sensor, held: bool
) -> None:
    gone = (LostSensor(lost, SensorFault.STALE, 0),)
    aiding = Aiding(pose=pose, unaided_us=unaided_us, lost=gone)
    assert aiding.holds_attitude(250_000) is held


@pytest.mark.parametrize(
    ("last_received_us", "now_us", "young"),
    [
        (-1, 0, False),
        (-1, 10, False),
        (0, 0, True),
        (0, 99, True),
        (0, 100, False),
        (50, 149, True),
    ],
)
def test_what_came_within_the_timeout_is_young_and_what_never_came_is_not(
    last_received_us: int, now_us: int, young: bool
) -> None:
    assert is_young(last_received_us, now_us, timeout_us=100) is young


def test_a_stream_of_setpoints_is_as_fresh_as_its_newest_of_any_kind() -> None:
    assert OffboardMemory().last_received_us < 0
    assert not OffboardMemory().is_fresh(0, 500_000)
    for memory in (OffboardMemory(motion_us=7, joints_us=3), OffboardMemory(joints_us=7)):
        assert memory.last_received_us == 7
        assert memory.is_fresh(106, 100)
        assert not memory.is_fresh(107, 100)


def test_a_vehicle_that_was_switched_on_stands_disarmed_and_has_heard_and_done_nothing() -> None:
    state = first_state(AIRFRAME)
    vehicle, plan, offboard = state.vehicle, state.plan, state.offboard
    assert (vehicle.mode, vehicle.landed, vehicle.intended_mode) == (
        Mode.DISARMED,
        True,
        Mode.HOLD,
    )
    assert vehicle.gcs_heard_us < 0
    assert (state.index, state.invalid_ticks, state.output_replaced) == (-1, 0, False)
    assert (state.record.actuator_command, state.mission.safe_set) == (stopped(AIRFRAME), SafeSet())
    assert (plan.next_id, plan.status, plan.refused) == (0, SolverStatus.UNKNOWN, False)
    assert plan.awaited_id < 0
    assert plan.counters == PlannerCounters(plans=0, missed_deadlines=0, fallbacks=0)
    assert (offboard.accepted, offboard.refused) == (0, 0)
