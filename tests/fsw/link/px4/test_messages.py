"""What a companion says to PX4, byte for byte as pymavlink's dialect has it."""

from __future__ import annotations

import math

import pytest

from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.signals import Setpoint
from fsw.link.px4.arm import Joints, servo_ranges
from fsw.link.px4.messages import CompanionWriter, shares_of, state_of
from messages import dialect
from sitl.servos import targets
from vehicles.vehicle_file import load_vehicle


def read(data: bytes) -> object:
    parser = dialect.MAVLink(None)
    (message,) = parser.parse_buffer(bytearray(data))
    return message


def test_a_set_point_has_every_part_and_is_for_px4() -> None:
    wanted = Setpoint((1.0, 2.0, -3.0), (0.1, 0.2, 0.3), (0.4, 0.5, 0.6), 0.7, 0.8, ())
    said = read(CompanionWriter().target(12_345_678, wanted))
    assert said.get_type() == "SET_POSITION_TARGET_LOCAL_NED"  # type: ignore[attr-defined]
    found = said.to_dict()  # type: ignore[attr-defined]
    assert found["type_mask"] == 0
    assert found["coordinate_frame"] == dialect.MAV_FRAME_LOCAL_NED
    assert (found["target_system"], found["target_component"]) == (1, 1)
    assert found["time_boot_ms"] == 12_345
    names = ("x", "y", "z", "vx", "vy", "vz", "afx", "afy", "afz", "yaw", "yaw_rate")
    expected = (*wanted.p, *wanted.v, *wanted.a, 0.7, 0.8)
    assert [found[name] for name in names] == pytest.approx(expected)
    assert said.get_srcComponent() == dialect.MAV_COMP_ID_ONBOARD_COMPUTER  # type: ignore[attr-defined]


def test_another_mode_is_commanded_with_the_custom_flag() -> None:
    found = read(CompanionWriter().mode((6, 0))).to_dict()  # type: ignore[attr-defined]
    assert found["command"] == dialect.MAV_CMD_DO_SET_MODE
    assert (found["param1"], found["param2"], found["param3"]) == (1.0, 6.0, 0.0)


def test_joints_beyond_those_there_are_stay_as_they_are() -> None:
    found = read(CompanionWriter().joints((0.5, -1.0))).to_dict()  # type: ignore[attr-defined]
    assert found["command"] == dialect.MAV_CMD_DO_SET_ACTUATOR
    assert (found["param1"], found["param2"]) == (0.5, -1.0)
    assert all(math.isnan(found[f"param{k}"]) for k in (3, 4, 5, 6))
    assert found["param7"] == 0.0


@pytest.mark.parametrize("q", [(0.3, -0.4), (-0.9, 1.2), (0.0, 0.0)])
def test_servos_are_sent_where_the_simulators_take_them(q: tuple[float, float]) -> None:
    shares = shares_of(servo_ranges(AIRFRAME), q)
    assert targets(load_vehicle("paper"), shares) == pytest.approx(q)


def test_of_another_autopilots_heartbeat_nothing_is_known() -> None:
    assert state_of((0x00060000, 2, 12, 129, 4, 3)) == (True, (6, 0))
    assert state_of((0, 6, 8, 0, 4, 3)) is None


def test_rates_are_found_from_angles_and_servos_are_believed_to_arrive() -> None:
    joints = Joints((0.0,))
    for k in range(200):
        joints.measured(4000 * k, (0.5 * 0.004 * k,), None)
    assert joints.qd[0] == pytest.approx(0.5, rel=0.01)
    believed = Joints((0.0,))
    for _ in range(50):
        believed.sent((1.0,), 0.02)
    assert believed.q[0] == pytest.approx(1.0, abs=1e-3)
