"""The stand-in for PX4, and what we tell it, beside recorded conversations of a real one.

Rows of [seconds, ">" simulator to PX4 or "<" back, hex]; PX4 v1.17 at a70a558393, SITL, 250 Hz.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import cast

import pytest

from messages.frames import Frame, split
from sitl.earth import DEFAULT_ORIGIN
from sitl.link.px4_messages import Px4Encoder, read_answer
from sitl.sensors.barometer import PressureMeasurement
from sitl.sensors.encoders import JointMeasurement
from sitl.sensors.gnss import GnssMeasurement
from sitl.sensors.imu import ImuMeasurement
from sitl.sensors.magnetometer import MagneticMeasurement
from sitl.sensors.motion_capture import PoseMeasurement
from sitl.sensors.rangefinder import RangeMeasurement
from tests.px4_stand_in import (
    COMMAND_LONG,
    HEARTBEAT,
    HIL_GPS,
    HIL_SENSOR,
    ODOMETRY,
    Airframe,
    Px4StandIn,
    Wish,
)
from tests.sitl.vehicles import PAPER

FOLDER = Path(__file__).parents[1] / "recordings" / "px4"
AIRFRAME = Airframe(3.5, (0.3, 0.3, 0.6), 0.3, 0.016, 17.17)
DISTANCE_SENSOR = 132


def recording(name: str) -> list[tuple[str, bytes]]:
    rows = json.loads((FOLDER / f"tcp4560_{name}.json").read_text())
    return [(way, bytes.fromhex(text)) for _, way, text in rows]


def said(name: str, way: str) -> list[Frame]:
    return [frame for at, data in recording(name) for frame in split(data) if at == way]


def test_the_stand_in_answers_a_recorded_start_as_px4_did() -> None:
    """Byte for byte, but for the flag that ``closed_frame`` sets in one frame of 256."""
    stand_in = Px4StandIn(AIRFRAME)
    answers = [stand_in.greeting()]
    for way, data in recording("boot"):
        if way == ">":
            answers.append(stand_in.hear(data))
    ours, real = b"".join(answers), b"".join(d for way, d in recording("boot") if way == "<")
    assert split(ours) == split(real)
    different = sum(a != b for a, b in zip(ours, real, strict=True))
    assert different <= 3  # a flag and two bytes of checksum
    assert [len(split(one)) for one in answers[:12]] == [2, *(0,) * 10, 1]


def test_in_flight_it_answers_each_step_in_the_recorded_format() -> None:
    recorded = recording("hover")
    stand_in = Px4StandIn(AIRFRAME, lambda _: Wish(armed=True, joints=(0.31, -0.2)), skipped=0)
    answers = [stand_in.hear(data) for way, data in recorded if way == ">"]
    real = [data for way, data in recorded if way == "<"]
    assert [len(one) for one in answers] == [len(one) for one in real]
    for ours, theirs in zip(answers, real, strict=True):
        (our,), (their,) = split(ours), split(theirs)
        assert our.payload_values[0] == their.payload_values[0]  # the stamp of the step
        assert our.payload_values[1] == their.payload_values[1]  # flags
        assert our.payload_values[-1] == their.payload_values[-1]  # mode
        assert (our.system_id, our.component_id) == (their.system_id, their.component_id)
        for frame, steps in ((our, (0.001, 0.002)), (their, (0.001, 0.002))):
            controls = cast("tuple[float, ...]", frame.payload_values[2:18])
            for k, control in enumerate(controls):
                step = steps[k >= 4]
                assert control == pytest.approx(step * round(control / step), abs=1e-6)
                assert 0.0 <= control <= 1.0 or 4 <= k < 6


def test_every_recorded_answer_is_understood() -> None:
    for name, armed in (("boot", False), ("hover", True)):
        frames = said(name, "<")
        answers = [read_answer(frame, PAPER) for frame in frames]
        for frame, answer in zip(frames, answers, strict=True):
            if frame.message_id in (HEARTBEAT, COMMAND_LONG):
                assert answer is None
                continue
            assert answer is not None
            assert answer.armed is armed
            assert answer.joints == (0.0, 0.0)
            assert all((0.45 < f < 0.55) if armed else f == 0.0 for f in answer.thrust)
        stamps = [answer.t_us for answer in answers if answer is not None]
        assert (
            stamps
            == [
                frame.payload_values[0]
                for frame in said(name, ">")
                if frame.message_id == HIL_SENSOR
            ][-len(stamps) :]
        )


IMU = ImuMeasurement(1_000_000, (0.01, -0.02, 0.03), (0.1, 0.2, -9.8))
POSE = PoseMeasurement(
    985_000, (1.0, 2.0, -3.0), (1.0, 0.0, 0.0, 0.0), (1e-4,) * 3, (4e-6,) * 3, 0, False
)
FIX = GnssMeasurement(990_000, (10.0, 20.0, -30.0), (1.0, 2.0, 3.0), 0.9, 1.8, False)
FIELD, AIR = MagneticMeasurement(1, (0.2, 0.0, 0.4)), PressureMeasurement(2, 95_000.0)
RAY, ARM = RangeMeasurement(3, 1.2, 1e-4, 0.05, 40.0), JointMeasurement(4, (0.1, 0.2))


def told(*measurements: object) -> list[Frame]:
    encoder = Px4Encoder(DEFAULT_ORIGIN)
    return split(encoder.step(1_000_000, list(measurements)))  # type: ignore[arg-type]


def test_hil_sensor_ends_each_step_and_says_what_is_new() -> None:
    recorded = {f.payload_values[14] for f in said("hover", ">") if f.message_id == HIL_SENSOR}
    ours = set()
    for more in ((), (FIELD,), (AIR,), (FIELD, AIR)):
        frames = told(IMU, *more)
        assert [frame.message_id for frame in frames] == [HIL_SENSOR]
        ours.add(frames[-1].payload_values[14])
        assert frames[-1].payload_values[15] == 0
    assert recorded <= ours == {0x3F, 0x1FF, 0x1A3F, 0x1BFF}
    assert told()[-1].payload_values[14] == 0


def test_no_private_message_is_on_that_link() -> None:
    frames = told(IMU, POSE, FIX, FIELD, AIR, RAY, ARM)
    ids = [frame.message_id for frame in frames]
    assert ids == [ODOMETRY, HIL_GPS, DISTANCE_SENSOR, HIL_SENSOR]
    assert max(ids) < 60_000
    (sender,) = {(frame.system_id, frame.component_id) for frame in frames}
    assert sender == (1, 200)


def test_motion_capture_is_vision_to_px4_and_cameras_on_board_are_vio() -> None:
    (pose, _) = told(IMU, POSE)
    (eyes, _) = told(IMU, POSE._replace(from_cameras_on_board=True))
    (real,) = [f for f in said("boot", ">")[:1] if f.message_id == ODOMETRY]
    # frame_id, child_frame_id, reset_counter, estimator_type, quality
    assert real.payload_values[-2] == pose.payload_values[-2] == 2
    assert eyes.payload_values[-2] == 3
    assert real.payload_values[-5] == pose.payload_values[-5] == 1
    assert math.isnan(pose.payload_values[8])  # no velocity is measured


def test_the_inertial_unit_is_the_mean_since_the_last_step() -> None:
    other = IMU._replace(gyro_B=(0.03, 0.02, 0.01), accel_B=(0.3, 0.0, -9.6))
    (frame,) = told(IMU, other)
    assert frame.payload_values[1:7] == pytest.approx((0.2, 0.1, -9.7, 0.02, 0.0, 0.02), abs=1e-6)
