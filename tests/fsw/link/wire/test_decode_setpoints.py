"""Setpoints for now: the masks that clients send, and everything that is of no use."""

from __future__ import annotations

import math

import pytest

from fsw.link.inbox import Inbox, Received
from fsw.link.wire import message_ids as ids
from fsw.signals import AttitudeSetpoint, JointSetpoint, MotionSetpoint
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
            assert taken(body(mask, **{field: bad})) == Received(refused_setpoints=1)


@pytest.mark.parametrize(
    "wrong",
    [
        {"coordinate_frame": 6},
        {"coordinate_frame": 0},
        {"coordinate_frame": 8},  # a position in the body's frame
        {"target_system": 9},
        {"target_system": 1, "target_component": 100},
        {"type_mask": 0x9F9},  # part of a position
        {"type_mask": 0x9FF},  # nothing at all
        {"type_mask": 0xE3F},  # a force
    ],
)
def test_what_is_of_no_use_is_refused_and_counted(wrong: dict[str, float]) -> None:
    assert taken(body(0x9F8, **wrong)) == Received(refused_setpoints=1)


def test_a_velocity_may_be_along_the_heading() -> None:
    setpoint = taken(body(0x9C7, coordinate_frame=8)).motion
    assert setpoint == MotionSetpoint(False, v=V, yaw=YAW, along_heading=True)


def attitude(mask: int, **changes: float) -> Frame:
    fields = {"q[0]": 1.0, "thrust": 0.5, "body_roll_rate": 0.25, "type_mask": mask}
    return frame(ids.SET_ATTITUDE_TARGET, **{**fields, **changes})


def test_an_attitude_or_rates_with_a_thrust() -> None:
    level = AttitudeSetpoint(0.5, (1.0, 0.0, 0.0, 0.0))
    assert taken(attitude(7)).attitude == level
    assert taken(attitude(0x80)).attitude == AttitudeSetpoint(0.5, None, (0.25, 0.0, 0.0))
    assert taken(attitude(7, body_roll_rate=NAN)).attitude == level
    assert taken(attitude(0x80, **{"q[1]": NAN})).refused_setpoints == 0
    for mask, bad in (
        (7, {"thrust": NAN}),
        (7, {"q[2]": NAN}),
        (0x80, {"body_yaw_rate": math.inf}),
        (0x87, {}),
        (0x47, {}),
        (7, {"target_system": 3}),
    ):
        assert taken(attitude(mask, **bad)) == Received(refused_setpoints=1)  # type: ignore[arg-type]


def test_joints_and_the_end_effector_of_our_own_dialect() -> None:
    joints = {"position[0]": 0.5, "position[1]": -0.25, "joint_count": 2}
    setpoint = frame(ids.ARM_JOINT_SETPOINT, **joints)
    assert taken(setpoint) == Received(joints=JointSetpoint((0.5, -0.25)))
    for bad in ({"position[1]": NAN}, {"joint_count": 3}, {"target_component": 7}):
        assert taken(frame(ids.ARM_JOINT_SETPOINT, **{**joints, **bad})) == Received(
            refused_setpoints=1
        )
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
    assert not inbox.take().station_heard
    inbox.accept(frame(ids.HEARTBEAT, type=6))
    assert inbox.take().station_heard
    assert not inbox.take().station_heard


@pytest.mark.parametrize("message_id", [82, 84, 60201, 60202])
def test_whatever_numbers_come_nothing_raises(message_id: int) -> None:
    inbox = Inbox()
    for value in (NAN, math.inf, -math.inf, 1e30, -1.0, 0.0):
        for mask in (0, 7, 0x80, 0xFF):
            names = wire_fields(message_id)
            whole = {"type_mask", "target_system", "target_component", "coordinate_frame",
                     "joint_count", "time_usec", "time_boot_ms"}  # fmt: skip
            values = [0 if name in whole else value for name in names]
            if "type_mask" in names:
                values[names.index("type_mask")] = mask
            (decoded,) = split(FrameWriter(255, 190).frame(message_id, *values))
            inbox.accept(decoded)
    assert inbox.take().refused_setpoints > 0
