"""The frame codec against pymavlink's, byte for byte."""

import struct

import fastcrc
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v10 import common as version_1

from messages import dialect
from messages.frames import FrameWriter, as_version_1, split, wire_fields
from tests.messages.frame_bytes import as_pymavlink

SPOKEN = [
    *("HIL_SENSOR", "HIL_ACTUATOR_CONTROLS", "ODOMETRY", "COMMAND_LONG", "COMMAND_ACK"),
    *("HEARTBEAT", "STATUSTEXT", "ATTITUDE_QUATERNION"),
    *("ARM_JOINT_STATE", "ARM_JOINT_SETPOINT", "END_EFFECTOR_TARGET", "BARRIER_MARGIN"),
    *("MPC_STATUS", "LOOP_TIMING", "OBSTACLE_WALL", "WORKSPACE_SPHERE"),
]
MESSAGES = {
    name: dialect.mavlink_map[getattr(dialect, f"MAVLINK_MSG_ID_{name}")] for name in SPOKEN
}

SCALARS = {
    "float": st.just(0.0) | st.floats(width=32, allow_nan=False),
    "double": st.just(0.0) | st.floats(allow_nan=False),
    **{
        f"{sign}int{bits}_t": st.just(0) | st.integers(low, high)
        for bits in (8, 16, 32, 64)
        for sign, low, high in (
            ("u", 0, 2**bits - 1),
            ("", -(2 ** (bits - 1)), 2 ** (bits - 1) - 1),
        )
    },
}


def field_values(message):
    """Strategy for one message: its values by field name, as pymavlink's constructors take them."""
    strategies = {}
    for position, name in enumerate(message.ordered_fieldnames):
        kind = message.fieldtypes[message.fieldnames.index(name)]
        length = message.array_lengths[position]
        if kind == "char":
            strategies[name] = st.binary(max_size=length)
        elif length:
            strategies[name] = st.lists(SCALARS[kind], min_size=length, max_size=length)
        else:
            strategies[name] = SCALARS[kind]
    return st.fixed_dictionaries(strategies)


def in_wire_order(message, values):
    flat = []
    for name in message.ordered_fieldnames:
        flat += values[name] if isinstance(values[name], list) else [values[name]]
    return flat


def pymavlink_sender(system_id=1, component_id=191, sequence=0):
    sender = dialect.MAVLink(None, srcSystem=system_id, srcComponent=component_id)
    sender.seq = sequence
    return sender


@pytest.mark.drawn(6)
@pytest.mark.parametrize("name", SPOKEN)
@settings(max_examples=30)
@given(data=st.data())
def test_frames_are_byte_identical_with_pymavlink_and_its_own_are_read_as_sent(name, data):
    message = MESSAGES[name]
    values = data.draw(field_values(message))
    frame = FrameWriter(1, 191).frame(message.id, *in_wire_order(message, values))
    assert as_pymavlink(frame, message(**values).pack(pymavlink_sender()))
    (frame,) = split(message(**values).pack(pymavlink_sender(7, 13, 200)))
    assert frame[:4] == (7, 13, 200, message.id)
    sent = message.unpacker.pack(*in_wire_order(message, values))
    assert message.unpacker.pack(*frame.payload_values) == sent


class ParserInC:
    """What MAVLink's own ``mavlink_parse_char`` does with a stream, as far as framing goes.

    It knows some messages only. A frame with a wrong checksum, which every frame of a message that
    it does not know has, is dropped; but its last byte, if it is a start marker, begins the next.
    """

    def __init__(self, known):
        self.known = known
        self.buffer = bytearray()
        self.heard = []

    def take(self, datagram):
        for byte in datagram:
            if not self.buffer and byte != 0xFD:
                continue
            self.buffer.append(byte)
            if len(self.buffer) < 12 or len(self.buffer) < 12 + self.buffer[1]:
                continue
            id_ = int.from_bytes(self.buffer[7:10], "little")
            extra = bytes([dialect.mavlink_map[id_].crc_extra if id_ in self.known else 0])
            crc = fastcrc.crc16.mcrf4xx(bytes(self.buffer[1:-2]) + extra)
            if crc == int.from_bytes(self.buffer[-2:], "little"):
                self.heard.append(id_)
                self.buffer.clear()
            else:
                self.buffer = bytearray(b"\xfd" if byte == 0xFD else b"")


def test_a_reader_that_does_not_know_a_message_loses_no_other():
    """QGroundControl 4.4.5 lost an acknowledgement behind ARM_JOINT_STATE."""
    joints, attitude, count = MESSAGES["ARM_JOINT_STATE"], dialect.MAVLINK_MSG_ID_ATTITUDE, 3000
    writer, reader = FrameWriter(1, 191), ParserInC({attitude})
    _, *zeros = joints.unpacker.unpack(bytes(joints.unpacker.size))
    for t in range(count):
        frame = writer.frame(joints.id, 1000 * t, *zeros)
        assert frame[-1] != 0xFD
        assert len(split(frame)) == 1
        reader.take(frame + writer.frame(attitude, t, *[0.0] * 6))
    assert reader.heard == [attitude] * count


@given(st.data())
def test_pymavlink_reads_what_was_sent(data):
    message = MESSAGES["MPC_STATUS"]
    values = data.draw(field_values(message))
    frame = FrameWriter(1, 191).frame(message.id, *in_wire_order(message, values))
    (received,) = pymavlink_sender().parse_buffer(frame)
    assert {name: getattr(received, name) for name in message.fieldnames} == values


OLD = {
    name: message
    for name, message in MESSAGES.items()
    if message.id < 256 and message.id in version_1.mavlink_map
} | {
    "MISSION_COUNT": dialect.mavlink_map[44],  # with extensions
    "MISSION_ITEM_INT": dialect.mavlink_map[73],
    "PARAM_VALUE": dialect.mavlink_map[22],
}


@pytest.mark.parametrize("name", OLD)
@settings(max_examples=30)
@given(data=st.data())
def test_version_1_is_byte_identical_with_pymavlink_s(name, data):
    """pymavlink's modules of MAVLink 1 know no extensions."""
    message, old = OLD[name], version_1.mavlink_map[OLD[name].id]
    values = data.draw(field_values(message))
    frame = FrameWriter(1, 191).frame(message.id, *in_wire_order(message, values))
    base = {key: value for key, value in values.items() if key in old.fieldnames}
    sender = version_1.MAVLink(None, srcSystem=1, srcComponent=191)
    theirs = old(**base).pack(sender)
    assert as_version_1(frame) == theirs
    (read,) = split(theirs)
    assert read[:4] == (1, 191, 0, message.id)
    without = dict.fromkeys(message.fieldnames, 0) | base
    for extension in set(message.fieldnames) - set(base):
        length = message.array_lengths[message.ordered_fieldnames.index(extension)]
        without[extension] = [0] * length if length else 0
    sent = message.unpacker.pack(*in_wire_order(message, without))
    assert message.unpacker.pack(*read.payload_values) == sent


def test_version_1_has_no_message_beyond_255():
    assert as_version_1(FrameWriter(1, 191).frame(MESSAGES["MPC_STATUS"].id, *[0] * 16)) is None


def test_every_base_size_is_the_one_whose_crc_extra_covers_it():
    """MAVLink computes CRC_EXTRA from the fields that are no extensions: an independent count."""
    for message_id, message in dialect.mavlink_map.items():
        extensions = dialect.EXTENSION_FIELDS.get(message_id, 0)
        base = message.ordered_fieldnames[: len(message.ordered_fieldnames) - extensions]
        crc = fastcrc.crc16.mcrf4xx(f"{message.msgname} ".encode())
        for name in base:
            kind = message.fieldtypes[message.fieldnames.index(name)]
            crc = fastcrc.crc16.mcrf4xx(f"{kind} {name} ".encode(), crc)
            length = message.array_lengths[message.ordered_fieldnames.index(name)]
            if length:
                crc = fastcrc.crc16.mcrf4xx(bytes([length]), crc)
        assert (crc & 0xFF) ^ (crc >> 8) == message.crc_extra, message.msgname


def test_trailing_zeros_are_left_out_but_never_the_first_byte():
    sphere = MESSAGES["WORKSPACE_SPHERE"]
    all_zero = FrameWriter(1, 191).frame(sphere.id, *[0] * 6)
    assert len(all_zero) == 10 + 1 + 2
    last_set = FrameWriter(1, 191).frame(sphere.id, *[0] * 5, 1)
    assert len(last_set) == 10 + sphere.unpacker.size + 2
    for frame, last in ((all_zero, 0), (last_set, 1)):
        (read,) = split(frame)
        assert read.payload_values == (0.0, 0.0, 0.0, 0.0, 0, last)


def test_the_sequence_wraps_after_255_as_pymavlinks_does():
    writer, sender = FrameWriter(1, 191), pymavlink_sender()
    message = MESSAGES["HEARTBEAT"]
    values = dict.fromkeys(message.fieldnames, 1)
    for k in range(600):
        frame = writer.frame(message.id, *in_wire_order(message, values))
        assert frame == message(**values).pack(sender)
        sender.seq = (sender.seq + 1) % 256
        assert split(frame)[0].sequence == k % 256


def test_two_components_count_their_own_sequences():
    autopilot, private = FrameWriter(1, 1), FrameWriter(1, 191)
    heartbeat = (0, 2, 12, 81, 4, 3)
    for _ in range(5):
        autopilot.frame(0, *heartbeat)
    assert split(private.frame(0, *heartbeat))[0].sequence == 0


def test_a_refused_value_does_not_use_up_a_sequence_number():
    writer = FrameWriter(1, 1)
    for wrong in ((0, 2, 12, 81, 4), (0, 256, 12, 81, 4, 3), (0, 2, 12, 81, 4, "3")):
        with pytest.raises(struct.error):
            writer.frame(0, *wrong)
    assert split(writer.frame(0, 0, 2, 12, 81, 4, 3))[0].sequence == 0


def test_an_unknown_message_cannot_be_written():
    with pytest.raises(KeyError):
        FrameWriter(1, 1).frame(0xABCDEF)


@pytest.mark.parametrize("ids", [(0, 1), (1, 0), (256, 1), (1, -1)])
def test_a_sender_needs_ids_that_can_be_addressed(ids):
    with pytest.raises(ValueError, match=r"outside 1\.\.255"):
        FrameWriter(*ids)


def test_wire_fields_names_every_value_of_every_message():
    for message_id, message in dialect.mavlink_map.items():
        names = wire_fields(message_id)
        values = message.unpacker.unpack(bytes(message.unpacker.size))
        assert len(names) == len(set(names)) == len(values), message.msgname


def test_wire_fields_writes_arrays_out():
    assert wire_fields(MESSAGES["WORKSPACE_SPHERE"].id) == (
        *("offset[0]", "offset[1]", "offset[2]", "radius", "target_system", "target_component"),
    )
    assert wire_fields(MESSAGES["STATUSTEXT"].id) == ("severity", "text", "id", "chunk_seq")
