"""Any number of joints travels both ways, and two of them as before."""

from __future__ import annotations

import pytest

from fsw.link.inbox import Inbox
from fsw.link.wire.decode import sensor_frame
from fsw.link.wire.decode_sensors import SampleDecoder
from messages.frames import FrameWriter, split
from messages.joint_arrays import STATE_AT, STATE_COUNT_AT, base, joined, more
from sitl.earth import DEFAULT_ORIGIN
from sitl.link.encode import StepEncoder
from sitl.link.encode_sensors import SensorEncoder
from sitl.sensors.encoders import JointMeasurement
from sitl.sensors.exact import SensorReadings

COUNTS = range(1, 9)
ARM, ENCODERS = 60200, 60212


def angles(count: int) -> tuple[float, ...]:
    return tuple(0.125 * k for k in range(1, count + 1))


def readings(count: int) -> SensorReadings:
    some = angles(count)
    return SensorReadings(
        2_000, (1.0, 2.0, -3.0), (0.1, 0.2, 0.3), (1.0, 0.0, 0.0, 0.0), (0.0,) * 3, (0.0,) * 3,
        (0.0, 0.0, -9.75), some, tuple(-one for one in some), (0.5,) * count,
    )  # fmt: skip


@pytest.mark.parametrize("count", COUNTS)
def test_what_is_sent_is_what_is_read(count: int) -> None:
    some = angles(count)
    assert joined((*base(some), *more(some)), 0, 4, count) == some
    datagram = StepEncoder(lockstep=True).datagram(readings(count), ())
    sent = {one.message_id: one for one in split(datagram)}
    frame = sensor_frame(*(sent[k] for k in (331, ARM, 107)), count)  # type: ignore[arg-type]
    assert (frame.q_arm, frame.qd_arm) == (some, tuple(-one for one in some))
    torques = sent[ARM].payload_values
    assert torques[STATE_COUNT_AT] == count
    assert joined(torques, *STATE_AT[2], count) == (0.5,) * count  # type: ignore[arg-type]


@pytest.mark.parametrize("count", COUNTS)
def test_encoders_are_read_as_they_were_sent(count: int) -> None:
    encoder = SensorEncoder(FrameWriter(1, 200), DEFAULT_ORIGIN)
    sent = encoder.frames(4_000, (JointMeasurement(2_000, angles(count)),))
    (frame,) = [one for one in split(b"".join(sent)) if one.message_id == ENCODERS]
    (sample,) = SampleDecoder(Inbox().locate, count).samples([frame])
    assert sample.angles == angles(count)


@pytest.mark.parametrize("count", range(1, 5))
def test_up_to_four_joints_no_byte_is_sent_for_the_others(count: int) -> None:
    datagram = StepEncoder(lockstep=True).datagram(readings(count), ())
    (arm,) = [one for one in split(datagram) if one.message_id == ARM]
    at = datagram.index(ARM.to_bytes(3, "little")) - 7
    assert datagram[at] == 0xFD
    assert datagram[at + 1] == 81, "the length that it had before there were extensions"
    assert arm.payload_values[20:] == (0.0,) * 12
