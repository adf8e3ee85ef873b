"""What a network can do to a datagram: split() never raises, never delivers what was not sent."""

import struct

import fastcrc
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v10.common import MAVLink
from pymavlink.dialects.v10.common import MAVLink_heartbeat_message as Heartbeat

from messages import dialect
from messages.frames import Frame, FrameWriter, Losses, split

HIL_SENSOR = dialect.MAVLINK_MSG_ID_HIL_SENSOR
SENSOR_VALUES = (1_000_000, *(0.5 * k for k in range(1, 14)), 0x1FFF, 0)
GOOD = FrameWriter(1, 200).frame(HIL_SENSOR, *SENSOR_VALUES)
OTHER = FrameWriter(1, 195).frame(
    dialect.MAVLINK_MSG_ID_WORKSPACE_SPHERE, 0, 0, -0.225, 0.075, 1, 1
)

OLD = Heartbeat(6, 8, 0, 0, 4, 3).pack(MAVLink(None, srcSystem=255, srcComponent=190))


def with_checksum(header_and_payload, message_id=HIL_SENSOR):
    extra = bytes([dialect.mavlink_map[message_id].crc_extra])
    checksum = fastcrc.crc16.mcrf4xx(header_and_payload[1:] + extra)
    return header_and_payload + checksum.to_bytes(2, "little")


def delivered(datagram):
    return [frame.message_id for frame in split(datagram)]


@given(st.binary(max_size=1500))
def test_garbage_is_skipped_without_an_exception(garbage):
    losses = Losses()
    assert split(garbage, losses) == []
    assert losses.bytes == len(garbage)


@pytest.mark.parametrize("length", range(len(GOOD)))
def test_a_truncated_frame_is_not_delivered(length):
    assert delivered(GOOD[:length]) == []


def test_no_single_flipped_bit_is_delivered():
    for bit in range(8 * len(GOOD)):
        damaged = bytearray(GOOD)
        damaged[bit // 8] ^= 1 << bit % 8
        assert delivered(bytes(damaged)) == [], f"bit {bit}"


def test_a_damaged_datagram_does_not_swallow_the_next():
    for length in range(len(GOOD)):
        split(GOOD[:length])
        assert delivered(GOOD) == [HIL_SENSOR]


@given(st.data())
def test_good_frames_survive_between_damaged_ones(data):
    flipped = st.integers(0, 8 * len(GOOD) - 1).map(
        lambda bit: bytes(b ^ (1 << bit % 8 if i == bit // 8 else 0) for i, b in enumerate(GOOD))
    )
    cut = st.integers(0, len(GOOD) - 1).map(lambda length: GOOD[:length])
    noise = st.binary(max_size=40)
    parts = data.draw(st.lists(st.sampled_from([GOOD, OTHER]) | flipped | cut | noise, max_size=8))
    sent = [split(part)[0] for part in parts if part in (GOOD, OTHER)]
    assert split(b"".join(parts)) == sent


def test_a_false_start_does_not_hide_the_frame_that_its_length_covers():
    false_start = bytes([0xFD, 200, 0, 0, 0, 1, 1, HIL_SENSOR, 0, 0])
    assert delivered(false_start + GOOD + bytes(200)) == [HIL_SENSOR]


def test_frames_come_in_the_order_of_the_datagram_and_nothing_is_counted_as_lost():
    losses = Losses()
    frames = split(OTHER + OTHER + GOOD, losses)
    assert [frame.message_id for frame in frames] == [60208, 60208, HIL_SENSOR]
    assert losses == Losses(bytes=0, frames=0)


def test_losses_add_up_over_datagrams():
    losses = Losses()
    for datagram in (GOOD + b"xyz", GOOD[:-1], GOOD):
        split(datagram, losses)
    assert losses.bytes == 3 + len(GOOD) - 1
    assert losses.frames == GOOD[:-1].count(0xFD)


def test_a_message_of_another_dialect_is_skipped():
    unknown = bytearray(GOOD)
    unknown[7:10] = (0xABCDEF).to_bytes(3, "little")
    assert delivered(bytes(unknown) + OTHER) == [60208]


def test_a_damaged_frame_of_protocol_1_is_skipped():
    version_1 = struct.pack("<BBBBBB", 0xFE, 9, 0, 1, 1, 0) + bytes(11)
    assert delivered(version_1 + GOOD) == [HIL_SENSOR]


def test_no_single_flipped_bit_of_protocol_1_is_delivered():
    for bit in range(8 * len(OLD)):
        damaged = bytearray(OLD)
        damaged[bit // 8] ^= 1 << bit % 8
        assert delivered(bytes(damaged)) == [], f"bit {bit}"


@pytest.mark.parametrize("length", range(len(OLD)))
def test_a_truncated_frame_of_protocol_1_is_not_delivered(length):
    assert delivered(OLD[:length]) == []


def test_protocol_1_is_looked_for_only_where_a_frame_must_begin():
    """Its short header would be found in noise, checksum and all, every few seconds of a flood."""
    assert delivered(OLD + OLD + GOOD + OLD) == [0, 0, HIL_SENSOR, 0]
    assert delivered(b"x" + OLD) == []
    assert delivered(b"x" + GOOD + OLD) == [HIL_SENSOR, 0]


def test_a_message_of_another_dialect_in_protocol_1_is_stepped_over():
    unknown = struct.pack("<BBBBBB", 0xFE, 3, 0, 1, 1, 199) + bytes(5)
    assert 199 not in dialect.mavlink_map
    assert delivered(unknown + OLD + GOOD) == [0, HIL_SENSOR]
    assert delivered(unknown + b"x" + OLD) == []


def test_protocol_1_leaves_nothing_out():
    """What is shorter than the message without its extensions was never sent by anybody."""
    short = bytearray(OLD[:-3])
    short[1] -= 1
    assert delivered(with_checksum(bytes(short), 0)) == []


def test_an_unknown_incompatibility_flag_is_refused_even_with_a_right_checksum():
    body = bytearray(GOOD[:-2])
    body[2] = 0x02
    assert delivered(with_checksum(bytes(body))) == []


def test_a_signed_frame_of_pymavlink_is_read_and_its_signature_stepped_over():
    sender = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
    sender.signing.secret_key = bytes(range(32))
    sender.signing.sign_outgoing = True
    signed = dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(sender)
    assert len(signed) == 10 + 9 + 2 + 13
    assert delivered(signed + GOOD) == [0, HIL_SENSOR]
    assert delivered(signed[:-1]) == []


def test_extensions_of_a_newer_peer_are_left_off():
    body = bytearray(GOOD[:-2])
    newer = dialect.mavlink_map[HIL_SENSOR].unpacker.size + 3
    body += bytes(newer - 1 - (len(body) - 10)) + b"\x07"
    body[1] = newer
    (frame,) = split(with_checksum(bytes(body)))
    assert frame == Frame(1, 200, 0, HIL_SENSOR, SENSOR_VALUES)


def test_a_datagram_of_start_markers_is_given_up_early():
    losses = Losses()
    assert split(b"\xfd" * 1400, losses) == []
    assert losses == Losses(bytes=1400, frames=64)
