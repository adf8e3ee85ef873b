"""Setpoints for now: the masks that clients send, and everything that is of no use."""

from __future__ import annotations

import math

import pytest

from fsw.autopilot.signals import (
    AttitudeSetpoint,
    JointSetpoint,
    MotionSetpoint,
    Origin,
    PositionFrom,
)
from fsw.link.inbox import Inbox, Received
from messages import message_ids as ids
from messages.frames import Frame, FrameWriter, split, wire_fields

NAN = math.nan
P, V, A = (1.0, 2.0, -3.0), (0.25, 0.5, -0.5), (0.125, -0.25, 0.5)
YAW, YAW_RATE = 0.75, 0.0625
AXES = ("x", "y", "z", "vx", "vy", "vz", "afx", "afy", "afz")
NUMBERS = dict(zip(AXES, (*P, *V, *A), strict=True))


def frame(message_id: int, **fields: float) -> Frame:
    names = wire_fields(message_id)
    assert not set(fields) - set(names)
    wire = FrameWriter(255, 190).frame(message_id, *(fields.get(name, 0) for name in names))
    (decoded,) = split(wire)
    return decoded


def taken(*frames: Frame) -> Received:
    inbox = Inbox()
    for one in frames:
        inbox.accept(one)
    received = inbox.take()
    assert inbox.take() == Received()
    return received


def assert_refused(wrong: Frame, why: str = "") -> None:
    received = taken(wrong)
    assert received == Received(refused_setpoints=1, setpoint_problem=received.setpoint_problem)
    assert received.setpoint_problem.partition(";")[0] == why.partition(";")[0]


def same(one: MotionSetpoint | None, other: MotionSetpoint) -> bool:
    """Equal, NaN to NaN."""
    return repr(one) == repr(other)


def body(mask: int, **changes: float) -> Frame:
    fields = {**NUMBERS, "yaw": YAW, "yaw_rate": YAW_RATE, "type_mask": mask, "coordinate_frame": 1}
    return frame(ids.SET_POSITION_TARGET_LOCAL_NED, **{**fields, **changes})


@pytest.mark.parametrize(
    ("mask", "meant"),
    [
        (0x9F8, MotionSetpoint(False, p=P, yaw=YAW)),
        (0x9C7, MotionSetpoint(False, v=V, yaw=YAW)),
        (0x9C0, MotionSetpoint(False, p=P, v=V, yaw=YAW)),
        (0x800, MotionSetpoint(False, p=P, v=V, a=A, yaw=YAW)),
        (0xC3F, MotionSetpoint(False, a=A)),
        (0x83F, MotionSetpoint(False, a=A, yaw=YAW)),
        (0x5C7, MotionSetpoint(False, v=V, yaw_rate=YAW_RATE)),
    ],
)
def test_every_mask_that_clients_send_is_understood(mask: int, meant: MotionSetpoint) -> None:
    assert taken(body(mask)) == Received(motion=meant)


def test_a_number_that_is_masked_may_be_nan_and_one_that_is_used_may_not() -> None:
    assert taken(body(0x9F8, vx=NAN, afz=NAN, yaw_rate=NAN)).motion is not None
    for field, mask in (("x", 0x9F8), ("vz", 0x9C7), ("afy", 0xC3F), ("yaw", 0x9F8)):
        for bad in (NAN, math.inf):
            assert_refused(body(mask, **{field: bad}), "a number that type_mask uses is not finite")


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        ({"coordinate_frame": 6}, "frame 6 is not one of 1, 7, 8, 9, 12"),
        ({"coordinate_frame": 0}, "frame 0 is not one of 1, 7, 8, 9, 12"),
        ({"coordinate_frame": 8}, "a position in frame 8 is ambiguous; use 1, 7 or 9"),
        ({"target_system": 9}, ""),
        ({"target_system": 1, "target_component": 100}, ""),
        ({"type_mask": 0x9F9}, "north has no position, velocity or acceleration"),
        ({"type_mask": 0x9FF}, "type_mask ignores position, velocity and acceleration"),
        ({"type_mask": 0xE3F}, "forces are not supported"),
        ({"x": 2000.0}, "position out of range: 2000 m, at most 1000 m"),
        (
            {"type_mask": 0x9FA, "coordinate_frame": 9},
            "in frame 9, x and y are used together or not at all",
        ),
    ],
)
def test_what_is_of_no_use_is_refused_and_counted_and_the_reason_kept(
    wrong: dict[str, float], why: str
) -> None:
    assert_refused(body(0x9F8, **{"y": 0.0, "z": -3.0, **wrong}), why)


@pytest.mark.parametrize("force", [0, 0x200])  # clients set the bit of forces that they ignore
def test_an_axis_is_used_by_itself_as_px4_takes_it(force: int) -> None:
    """MAVROS and apmplanner: velocity north and east with a height held."""
    held = MotionSetpoint(False, p=(NAN, NAN, -3.0), v=V, yaw=YAW)
    assert same(taken(body(0x9C3 | force)).motion, held)
    sliding = MotionSetpoint(False, p=(1.0, NAN, -3.0), v=(NAN, 0.5, NAN))
    assert same(taken(body(0xDEA | force)).motion, sliding)


@pytest.mark.parametrize("frame_number", [7, 9, 12])
def test_a_position_may_count_from_the_vehicle(frame_number: int) -> None:
    setpoint = taken(body(0x9F8, coordinate_frame=frame_number)).motion
    assert setpoint == MotionSetpoint(
        False,
        p=P,
        yaw=YAW,
        along_heading=frame_number != 7,
        p_from=PositionFrom.VEHICLE,
    )


def on_earth(mask: int, **changes: float) -> Frame:
    fields = {
        **{name: value for name, value in NUMBERS.items() if name not in "xyz"},
        "lat_int": 473977509,
        "lon_int": 85456080,
        "alt": 2.5,
        "yaw": YAW,
        "type_mask": mask,
        "coordinate_frame": 6,
        "yaw_rate": YAW_RATE,
    }
    return frame(ids.SET_POSITION_TARGET_GLOBAL_INT, **{**fields, **changes})


@pytest.mark.parametrize("frame_number", [0, 5, 3, 6])
def test_mavsdk_s_global_setpoints_are_taken_to_the_local_frame(frame_number: int) -> None:
    """MAVSDK sends frames 5 and 6 with mask 0x9F8, MAVROS any; see set_position_global."""
    inbox = Inbox(Origin(47.3977508, 8.5456072, 488.0))
    inbox.accept(on_earth(0x9F8, coordinate_frame=frame_number))
    setpoint = inbox.take().motion
    assert setpoint is not None
    assert setpoint.p is not None
    above_home = frame_number in (3, 6)
    expected = PositionFrom.HOME_HEIGHT if above_home else PositionFrom.ORIGIN
    assert setpoint.p_from is expected
    assert setpoint.p[0] == pytest.approx(0.0111, abs=1e-3)
    assert setpoint.p[1] == pytest.approx(0.0602, abs=1e-3)
    assert setpoint.p[2] == pytest.approx(-2.5 if above_home else 485.5)
    assert (setpoint.v, setpoint.a, setpoint.yaw, setpoint.yaw_rate) == (None, None, YAW, None)
    assert taken(on_earth(0x9C7)).motion == MotionSetpoint(False, v=V, yaw=YAW)
    height = taken(on_earth(0x9C3, coordinate_frame=frame_number)).motion
    assert height is not None
    assert height.p is not None
    assert math.isnan(height.p[0])


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        ({"coordinate_frame": 11}, "frame 11 counts heights from terrain, which is not known"),
        ({"coordinate_frame": 1}, "frame 1 is not global: 0, 5, or 3, 6 above home"),
        ({"lat_int": 950000000}, "95, 8.54561 is no place on Earth"),
        ({"type_mask": 0x9F9}, "latitude and longitude are used together or not at all"),
        ({"alt": NAN}, "a number that type_mask uses is not finite"),
    ],
)
def test_a_global_setpoint_of_no_use_is_refused_with_its_reason(
    wrong: dict[str, float], why: str
) -> None:
    assert_refused(on_earth(0x9F8, **wrong), why)


def test_a_velocity_may_be_along_the_heading() -> None:
    setpoint = taken(body(0x9C7, coordinate_frame=8)).motion
    assert setpoint == MotionSetpoint(False, v=V, yaw=YAW, along_heading=True)


def test_actuators_are_not_commanded_past_the_loops() -> None:
    """MAVSDK's offboard.set_actuator_control and MAVROS' actuator_control."""
    why = "SET_ACTUATOR_CONTROL_TARGET is not supported"
    received = taken(frame(ids.SET_ACTUATOR_CONTROL_TARGET, group_mlx=0))
    assert received.refused_setpoints == 1
    assert received.setpoint_problem.startswith(why)


def attitude(mask: int, **changes: float) -> Frame:
    fields = {"q[0]": 1.0, "thrust": 0.5, "body_roll_rate": 0.25, "type_mask": mask}
    return frame(ids.SET_ATTITUDE_TARGET, **{**fields, **changes})


def test_an_attitude_or_rates_with_a_thrust() -> None:
    level = AttitudeSetpoint(0.5, (1.0, 0.0, 0.0, 0.0))
    assert taken(attitude(7)).attitude == level
    assert taken(attitude(0x80)).attitude == AttitudeSetpoint(0.5, None, (0.25, 0.0, 0.0))
    assert taken(attitude(7, body_roll_rate=NAN)).attitude == level
    assert taken(attitude(0x80, **{"q[1]": NAN})).refused_setpoints == 0
    wrong: tuple[tuple[int, dict[str, float], str], ...] = (
        (7, {"thrust": NAN}, "thrust out of range"),
        (7, {"q[2]": NAN}, "the quaternion is not of length 1"),
        (7, {"q[0]": 2.0}, "the quaternion is not of length 1"),
        (0x80, {"body_yaw_rate": math.inf}, "body rates out of range"),
        (0x87, {}, "type_mask ignores the attitude and a body rate"),
        (0x47, {}, "an attitude needs a thrust, which type_mask ignores"),
        (7, {"target_system": 3}, ""),
    )
    for mask, bad, why in wrong:
        assert_refused(attitude(mask, **bad), why)


def test_joints_and_the_end_effector_of_our_own_dialect() -> None:
    joints = {"position[0]": 0.5, "position[1]": -0.25, "joint_count": 2}
    setpoint = frame(ids.ARM_JOINT_SETPOINT, **joints)
    assert taken(setpoint) == Received(joints=JointSetpoint((0.5, -0.25)))
    wrong: tuple[tuple[dict[str, float], str], ...] = (
        ({"position[1]": NAN}, "a joint angle is not finite"),
        ({"joint_count": 9}, "it is for 9 joints; must be 1 to 8"),
        ({"joint_count": 0}, "it is for 0 joints"),
        ({"target_component": 7}, ""),
    )
    for bad, why in wrong:
        assert_refused(frame(ids.ARM_JOINT_SETPOINT, **{**joints, **bad}), why)
    point = {"position[2]": -1.0, "type_mask": 0xDF8, "coordinate_frame": 1}
    now = taken(frame(ids.END_EFFECTOR_TARGET, **point))
    assert now == Received(motion=MotionSetpoint(True, p=(0.0, 0.0, -1.0)))
    inbox = Inbox()
    inbox.accept(frame(ids.END_EFFECTOR_TARGET, time_usec=5, **point))
    received = inbox.take()
    assert received.motion is None, "a point with a time belongs to the trajectory"
    assert len(received.targets) == 1


def test_the_newest_of_motion_and_attitude_counts_and_joints_stand_beside_it() -> None:
    joints = frame(ids.ARM_JOINT_SETPOINT, joint_count=2)
    setpoints = taken(body(0x9F8), joints, attitude(7))
    assert (setpoints.motion, setpoints.joints) == (None, JointSetpoint((0.0, 0.0)))
    assert setpoints.attitude is not None
    setpoints = taken(attitude(7), body(0x9F8))
    assert setpoints.attitude is None
    assert setpoints.motion is not None


def test_only_a_ground_station_s_heartbeat_is_one() -> None:
    inbox = Inbox()
    inbox.accept(frame(ids.HEARTBEAT, type=18))
    assert not inbox.take().ground_station_heard
    inbox.accept(frame(ids.HEARTBEAT, type=6))
    assert inbox.take().ground_station_heard
    assert not inbox.take().ground_station_heard


@pytest.mark.parametrize("message_id", [82, 84, 86, 60201, 60202])
def test_whatever_numbers_come_nothing_raises(message_id: int) -> None:
    inbox = Inbox()
    for value in (NAN, math.inf, -math.inf, 1e30, -1.0, 0.0):
        for mask in (0, 7, 0x80, 0xFF):
            names = wire_fields(message_id)
            whole = {"type_mask", "target_system", "target_component", "coordinate_frame",
                     "joint_count", "time_usec", "time_boot_ms", "lat_int", "lon_int"}  # fmt: skip
            values = [0 if name in whole else value for name in names]
            if "type_mask" in names:
                values[names.index("type_mask")] = mask
            (decoded,) = split(FrameWriter(255, 190).frame(message_id, *values))
            inbox.accept(decoded)
    assert inbox.take().refused_setpoints > 0
