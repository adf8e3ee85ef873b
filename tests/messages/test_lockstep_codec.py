"""The fixed layouts of the lockstep against pymavlink and the general codec, byte for byte."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import dialect
from messages.frames import FrameWriter, split
from messages.lockstep_codec import LockstepFrame, LockstepReader
from tests.messages.frame_bytes import as_pymavlink

ODOMETRY, ARM, HIL_SENSOR, CONTROLS = (
    dialect.MAVLINK_MSG_ID_ODOMETRY,
    dialect.MAVLINK_MSG_ID_ARM_JOINT_STATE,
    dialect.MAVLINK_MSG_ID_HIL_SENSOR,
    dialect.MAVLINK_MSG_ID_HIL_ACTUATOR_CONTROLS,
)
STEP = LockstepReader((ODOMETRY, 14), (ARM, 7), (HIL_SENSOR, 7))
T_US = st.integers(1, 2**53)
FLOAT = st.just(0.0) | st.floats(width=32, allow_nan=False)
FIRST = st.tuples(*[FLOAT] * 13)
_UNKNOWN = [math.nan, *[0.0] * 20]
ODOMETRY_TAIL = (*_UNKNOWN, *_UNKNOWN, 1, 1, 0, 6, 100)


def step(t_us: int = 5, sequence: int = 0) -> bytes:
    writer = FrameWriter(1, 200)
    for _ in range(sequence):
        writer.next_origin()
    return (
        writer.frame(ODOMETRY, t_us, *[0.5] * 13, *ODOMETRY_TAIL)
        + writer.frame(ARM, t_us, *[0.25] * 12, *[0.0] * 6, 2, *[0.0] * 12)
        + writer.frame(HIL_SENSOR, t_us, *[0.125] * 6, *[0.0] * 7, 0x3F, 0)
    )


@given(T_US, FIRST, st.integers(0, 255))
def test_a_frame_with_fixed_last_fields_is_pymavlinks(t_us, first, sequence):
    sender = dialect.MAVLink(None, srcSystem=1, srcComponent=200)
    sender.seq = sequence
    x, y, z, *rest = first
    q, (vx, vy, vz, wx, wy, wz) = rest[:4], rest[4:]
    theirs = sender.odometry_encode(
        t_us, 1, 1, x, y, z, q, vx, vy, vz, wx, wy, wz, _UNKNOWN, _UNKNOWN, 0, 6, 100
    ).pack(sender)
    writer = FrameWriter(1, 200)
    for _ in range(sequence):
        writer.next_origin()
    assert as_pymavlink(LockstepFrame(writer, ODOMETRY, *ODOMETRY_TAIL)(t_us, *first), theirs)


@given(T_US, st.tuples(*[FLOAT] * 6))
def test_fixed_and_free_frames_of_a_component_count_one_sequence(t_us, first):
    tail = (*[0.0] * 7, 0x3F, 0)
    fixed_writer, writer = FrameWriter(1, 200), FrameWriter(1, 200)
    fixed = LockstepFrame(fixed_writer, HIL_SENSOR, *tail)
    for _ in range(3):
        assert fixed(t_us, *first) == writer.frame(HIL_SENSOR, t_us, *first, *tail)
        heartbeat = (0, 2, 12, 0, 3, 3)
        assert fixed_writer.frame(0, *heartbeat) == writer.frame(0, *heartbeat)


def test_a_frame_whose_length_would_vary_is_refused():
    with pytest.raises(ValueError, match="all zero"):
        LockstepFrame(FrameWriter(1, 1), HIL_SENSOR, 0.0, 0, 0)


def test_a_step_is_read_as_the_general_codec_reads_it():
    general = [frame.payload_values for frame in split(step())]
    values = STEP.read(step())
    assert values is not None
    for first, whole in zip(values, general, strict=True):
        assert first == whole[: len(first)]
    assert [len(first) for first in values] == [14, 7, 7]


@given(T_US, st.lists(FLOAT, min_size=16, max_size=16), st.sampled_from([1, 129]))
def test_the_answer_is_read_from_pymavlinks_bytes(t_us, controls, mode):
    sender = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    frame = sender.hil_actuator_controls_encode(t_us, controls, mode, 1).pack(sender)
    (values,) = LockstepReader((CONTROLS, 19)).read(frame) or [()]
    assert values == (t_us, 1, *controls, mode)


@given(st.integers(0, 410), st.integers(1, 255))
def test_no_changed_byte_is_read(position, difference):
    spoilt = bytearray(step())
    spoilt[position] ^= difference
    read = STEP.read(bytes(spoilt))
    # The general codec does not look at everything either, but never at less.
    assert read is None or len(split(bytes(spoilt))) == 3


@given(st.binary(max_size=500))
def test_no_bytes_at_all_make_it_raise(noise):
    assert STEP.read(noise) is None
    assert STEP.read(b"\xfd" + noise) is None


@pytest.mark.parametrize("cut", [1, 2, 11, 60, 400])
def test_part_of_a_step_or_more_than_one_is_left_to_the_general_codec(cut):
    assert STEP.read(step()[:-cut]) is None
    assert STEP.read(step()[cut:]) is None
    assert STEP.read(step() + b"\0") is None
    assert STEP.read(step() + step()) is None


def test_a_signed_frame_is_left_to_the_general_codec():
    signed = bytearray(step())
    signed[2] = 1
    assert STEP.read(bytes(signed)) is None


def test_a_payload_shorter_than_what_is_wanted_is_left_to_the_general_codec():
    short = FrameWriter(1, 1).frame(CONTROLS, 5, 0, *[0.0] * 16, 0)
    assert LockstepReader((CONTROLS, 19)).read(short) is None
    assert len(split(short)) == 1


def test_a_value_that_does_not_fit_is_refused():
    frame = LockstepFrame(FrameWriter(1, 1), HIL_SENSOR, 0x3F, 0)
    with pytest.raises(struct.error):
        frame(5, 1.0)
