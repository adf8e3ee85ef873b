"""A small, fast codec for MAVLink frames, byte-identical with pymavlink but for one in 256.

:func:`closed_frame` says which one.

Frames are written as MAVLink 2 and read as either version; :func:`as_version_1` rewrites one for a
peer that speaks MAVLink 1, as QGroundControl does where a vehicle does not say that it knows more.

pymavlink builds an object for every message and copies its payload several times, which makes it
3 to 4 times as slow to send and 4 to 5 times as slow to receive. Here a message is a flat tuple of
numbers in *wire order*: the order of the fields in the payload (larger types first, extensions
last; see :func:`wire_fields`), arrays written out element by element, text as NUL-padded bytes.
Layouts come from the generated dialect, so the two cannot differ.

Source: MAVLink 2 serialization, https://mavlink.io/en/guide/serialization.html
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from struct import Struct, calcsize
from typing import Any, Final, NamedTuple

import fastcrc

from messages import dialect

_MAGIC: Final = 0xFD
_MAGIC_1: Final = 0xFE  # of MAVLink 1
_HEADER_SIZE: Final = 10
_HEADER_SIZE_1: Final = 6
_CHECKSUM_SIZE: Final = 2
SIGNATURE_SIZE: Final = 13
_SIGNED: Final = 0x01
# Noise of 1400 bytes holds 5 start markers on average. A datagram made of nothing else must not
# hold the flight loop up: 1400 of them would cost a quarter of a tick.
_FALSE_START_LIMIT: Final = 64

checksum: Callable[[bytes], int] = fastcrc.crc16.mcrf4xx


# Of MAVLink 2, but for its flags that may be ignored.
_HEADER: Final = Struct("<BBBxBBB3s")


class Layout(NamedTuple):
    """How one message lies in a frame; a plain tuple because it is taken apart for each frame."""

    payload: Struct
    crc_extra: bytes  # (1,), closes the checksummed bytes
    id_bytes: bytes  # (3,), the message id as it stands in the header
    base_size: int  # bytes of the payload without extensions: its size in MAVLink 1
    message_id: int


def _layout(message_id: int, message: Any) -> Layout:
    extensions = dialect.EXTENSION_FIELDS.get(message_id, 0)
    base = len(message.ordered_fieldnames) - extensions
    codes = zip(message.array_lengths[:base], message.native_format[1:].decode(), strict=False)
    base_size = calcsize("<" + "".join(f"{length or 1}{code}" for length, code in codes))
    id_bytes = message_id.to_bytes(3, "little")
    return Layout(message.unpacker, bytes([message.crc_extra]), id_bytes, base_size, message_id)


LAYOUTS: Final[dict[int, Layout]] = {
    message_id: _layout(message_id, message) for message_id, message in dialect.mavlink_map.items()
}
_BY_ID_BYTES: Final = {layout.id_bytes: layout for layout in LAYOUTS.values()}


class Frame(NamedTuple):
    """A frame whose checksum was right. A tuple: it is built up to 2000 times a second."""

    system_id: int  # 0..255
    component_id: int  # 0..255
    sequence: int  # 0..255, counted by the sending component
    message_id: int
    payload_values: tuple[int | float | bytes, ...]  # wire order, extensions zero if not sent


@dataclass(slots=True)
class Losses:
    """What :func:`split` had to drop; hand the same one to every call to add up a link's life."""

    bytes: int = 0  # bytes that belong to no delivered frame
    frames: int = 0  # start markers that led to no valid frame


class FrameWriter:
    """Builds the frames of one component and counts their sequence."""

    def __init__(self, system_id: int, component_id: int) -> None:
        """Start at sequence 0, with ids of 1..255 that are written into every frame.

        Raises:
            ValueError: An id does not fit one byte or is 0, which is for addressing only.
        """
        for name, value in (("system_id", system_id), ("component_id", component_id)):
            if not 0 < value <= 255:
                raise ValueError(f"{name} {value} is outside 1..255")
        self._sequence = 0
        # For each sequence number the header between length and message id: two flag bytes, both
        # unused, the sequence, the sender.
        self._origins = [bytes([0, 0, n, system_id, component_id]) for n in range(256)]

    def frame(self, message_id: int, *wire_values: float | bytes) -> bytes:
        """Encode every field of a message in wire order, arrays flattened; advance the sequence.

        The frame is unsigned, and trailing zeros of the payload are left out.

        Raises:
            KeyError: The dialect has no such message.
            struct.error: Wrong number of values, or one that does not fit its field; the sequence
                is not advanced.
        """
        layout = LAYOUTS[message_id]
        return self._frame(layout, layout.payload.pack(*wire_values))

    def packed_frame(self, message_id: int, payload: bytes) -> bytes:
        """Encode a message whose whole payload is packed already, and advance the sequence.

        Raises:
            KeyError: The dialect has no such message.
            ValueError: The payload is not of the message's size.
        """
        layout = LAYOUTS[message_id]
        if len(payload) != layout.payload.size:
            raise ValueError(f"message {message_id} has {layout.payload.size} bytes of payload")
        return self._frame(layout, payload)

    def _frame(self, layout: Layout, whole: bytes) -> bytes:
        # The first byte of a payload is sent even if it is zero.
        payload = whole.rstrip(b"\0") or b"\0"
        body = b"%c%b%b%b" % (len(payload), self.next_origin(), layout.id_bytes, payload)
        return closed_frame(body, layout.crc_extra)

    def next_origin(self) -> bytes:
        """Advance the sequence: the header between length and message id of the next frame."""
        origin = self._origins[self._sequence]
        self._sequence = (self._sequence + 1) & 0xFF
        return origin


def announcing_signature(frame: bytes) -> bytes:
    """Mark an unsigned frame of :class:`FrameWriter` as signed; the signature is to follow it.

    The flag is part of what the checksum covers, so that is renewed.
    """
    layout = LAYOUTS[int.from_bytes(frame[7:10], "little")]
    body = b"%b%c%b" % (frame[1:2], _SIGNED, frame[3:-_CHECKSUM_SIZE])
    return closed_frame(body, layout.crc_extra)


def closed_frame(body: bytes, crc_extra: bytes) -> bytes:
    """A frame of MAVLink 2 around all that its checksum covers.

    A reader that does not know the message takes its checksum for wrong. MAVLink's own parser in C,
    which QGroundControl uses, then begins a new frame if the last byte is a start marker, and loses
    up to 280 bytes that follow. So no frame ends in one: of the flags that may be ignored one is
    set, and the checksum is another.
    """
    crc = checksum(body + crc_extra)
    flag = 0
    while crc >> 8 == _MAGIC:
        flag += 1
        body = b"%b%c%b" % (body[:2], flag, body[3:])
        crc = checksum(body + crc_extra)
    return b"\xfd%b%b" % (body, crc.to_bytes(2, "little"))


def is_version_1(frame: bytes) -> bool:
    """Whether a whole frame is of MAVLink 1."""
    return frame[0] == _MAGIC_1


def is_signed(frame: bytes) -> bool:
    """Whether the bytes of a whole frame end in a signature; those of MAVLink 1 never do."""
    return frame[0] == _MAGIC and frame[2] == _SIGNED


def as_version_1(frame: bytes) -> bytes | None:
    """Rewrite an unsigned frame of :class:`FrameWriter` for a peer that speaks MAVLink 1.

    It has the same sequence number, no extension fields and the zeros that MAVLink 2 leaves out.
    None where MAVLink 1 has no such message, its ids being one byte.
    """
    if frame[8] or frame[9]:
        return None
    layout = LAYOUTS[frame[7]]
    size = layout.base_size
    payload = frame[_HEADER_SIZE:-_CHECKSUM_SIZE][:size].ljust(size, b"\0")
    body = b"%c%b%b" % (size, frame[4:8], payload)
    return b"\xfe%b%b" % (body, checksum(body + layout.crc_extra).to_bytes(2, "little"))


def split(datagram: bytes, losses: Losses | None = None) -> list[Frame]:
    """The valid frames of one datagram, in order; see ``cut``."""
    return [frame for frame, _, _ in _frames_in(datagram, losses)]


def cut(datagram: bytes, losses: Losses | None = None) -> Iterator[tuple[Frame, bytes]]:
    """Yield the valid frames of one datagram, in order, each with its own bytes.

    Nothing is kept between datagrams, so a truncated one cannot swallow the next. Whatever is not
    a whole frame of a known message with the right checksum is skipped without an exception: the
    search goes on at the byte after its start marker, since its length cannot be trusted. A
    signature is stepped over and not checked. After 64 false starts a datagram is given up.

    A frame of MAVLink 1 is looked for only where a frame must begin: at the start of the datagram
    and behind another frame. Its header has 8 bits of message id where that of MAVLink 2 has 24, so
    in noise it would be found, by the luck of 16 bits of checksum, every few seconds of a flood.

    What was dropped is added to ``losses`` once the datagram has been read through.
    """
    return ((frame, datagram[at:end]) for frame, at, end in _frames_in(datagram, losses))


def _frames_in(datagram: bytes, losses: Losses | None) -> Iterator[tuple[Frame, int, int]]:
    """Yield the frames of :func:`cut`, with where each begins and ends."""
    delivered_bytes = refused = 0
    at, size = 0, len(datagram)
    while at < size and refused < _FALSE_START_LIMIT:
        length, frame = frame_at(datagram, at)
        if frame is None:
            refused += datagram[at] in (_MAGIC, _MAGIC_1)
            # A message of MAVLink 1 that is not known has a length all the same.
            at = at + length if length else datagram.find(_MAGIC, at + 1)
            if at < 0:
                break
        else:
            yield frame, at, at + length
            delivered_bytes += length
            at += length
    if losses is not None:
        losses.bytes += len(datagram) - delivered_bytes
        losses.frames += refused


def frame_at(datagram: bytes, start: int) -> tuple[int, Frame | None]:
    """Decode the frame of either version that starts here: its size [bytes]; None: none does."""
    marker = datagram[start]
    if marker == _MAGIC:
        return _frame_2_at(datagram, start)
    if marker == _MAGIC_1:
        return _frame_1_at(datagram, start)
    return 0, None


def whole_size(message_id: int) -> int:
    """Bytes of an unsigned frame of MAVLink 2 in which no field is left out, but extensions are.

    Raises:
        KeyError: The dialect has no such message.
    """
    return _HEADER_SIZE + LAYOUTS[message_id].base_size + _CHECKSUM_SIZE


def announced_size(data: bytes, start: int) -> int | None:
    """How many bytes the frame that begins here says it has; 0: none can begin here.

    None while too little of it has come to tell.
    """
    marker, come = data[start], len(data) - start
    if marker == _MAGIC_1:
        if come < _HEADER_SIZE_1:
            return None
        layout, length = LAYOUTS.get(data[start + 5]), data[start + 1]
        known = layout is not None and layout.base_size <= length <= layout.payload.size
        return _HEADER_SIZE_1 + length + _CHECKSUM_SIZE if known else 0
    if marker != _MAGIC:
        return 0
    if come >= 3 and data[start + 2] not in (0, _SIGNED):
        return 0
    if come < _HEADER_SIZE:
        return None
    if int.from_bytes(data[start + 7 : start + _HEADER_SIZE], "little") not in LAYOUTS:
        return 0
    signature = SIGNATURE_SIZE if data[start + 2] else 0
    return _HEADER_SIZE + data[start + 1] + _CHECKSUM_SIZE + signature


def _frame_2_at(datagram: bytes, start: int) -> tuple[int, Frame | None]:
    """Decode the frame that starts at a marker: its size in bytes, and None if it is not valid."""
    payload_at = start + _HEADER_SIZE
    if len(datagram) < payload_at + _CHECKSUM_SIZE:
        return 0, None
    _, length, incompatible, sequence, system_id, component_id, id_bytes = _HEADER.unpack_from(
        datagram, start
    )
    layout = _BY_ID_BYTES.get(id_bytes)
    payload_end = payload_at + length
    end = payload_end + _CHECKSUM_SIZE
    if incompatible:
        # Any flag but the signature's announces a format that this code does not know.
        if incompatible != _SIGNED:
            return 0, None
        end += SIGNATURE_SIZE
    if layout is None or len(datagram) < end:
        return 0, None
    values = _payload_values(datagram, start, payload_at, payload_end, layout)
    if values is None:
        return 0, None
    # By position: up to 2000 a second.
    return end - start, Frame(system_id, component_id, sequence, layout.message_id, values)


def _frame_1_at(datagram: bytes, start: int) -> tuple[int, Frame | None]:
    """Decode the frame of MAVLink 1 that starts at a marker: its size, and None if not valid.

    The size is 0 where it cannot be trusted.
    """
    payload_at = start + _HEADER_SIZE_1
    if len(datagram) < payload_at + _CHECKSUM_SIZE:
        return 0, None
    _, length, sequence, system_id, component_id, message_id = datagram[start:payload_at]
    layout = LAYOUTS.get(message_id)
    payload_end = payload_at + length
    end = payload_end + _CHECKSUM_SIZE
    if len(datagram) < end:
        return 0, None
    if layout is None:
        follows = end == len(datagram) or datagram[end] in (_MAGIC, _MAGIC_1)
        return (end - start if follows else 0), None
    # MAVLink 1 leaves nothing out; what is longer was sent with extensions by a lenient library.
    if not layout.base_size <= length <= layout.payload.size:
        return 0, None
    values = _payload_values(datagram, start, payload_at, payload_end, layout)
    if values is None:
        return 0, None
    return end - start, Frame(system_id, component_id, sequence, message_id, values)


def _payload_values(
    datagram: bytes, start: int, begin: int, end: int, layout: Layout
) -> tuple[Any, ...] | None:
    """The values of a payload; None where the checksum behind it is wrong."""
    payload, crc_extra, *_ = layout
    received = datagram[end] | datagram[end + 1] << 8
    if checksum(datagram[start + 1 : end] + crc_extra) != received:
        return None
    size = payload.size
    if end - begin >= size:  # longer than known: a peer with newer extensions
        return payload.unpack_from(datagram, begin)
    return payload.unpack(datagram[begin:end].ljust(size, b"\0"))  # zeros were left out


def wire_fields(message_id: int) -> tuple[str, ...]:
    """Name each value of :meth:`FrameWriter.frame` and :attr:`Frame.payload_values`, in order.

    An array's elements are ``name[0]``, ``name[1]``, …; a text is one value.

    Raises:
        KeyError: The dialect has no such message.
    """
    message = dialect.mavlink_map[message_id]
    names: list[str] = []
    for position, name in enumerate(message.ordered_fieldnames):
        is_text = message.fieldtypes[message.fieldnames.index(name)] == "char"
        elements = 0 if is_text else message.array_lengths[position]
        names += [f"{name}[{i}]" for i in range(elements)] or [name]
    return tuple(names)
