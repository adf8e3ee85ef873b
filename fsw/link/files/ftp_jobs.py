"""MAVLink FTP: requests, replies to them, and those replies that take more than one tick.

Source: https://mavlink.io/en/services/ftp.html
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from typing import Final, TypeAlias

from fsw.link.files.served_file import OpenFile, ServedFile
from messages import dialect

MAX_DATA: Final = 239  # bytes in one message
MAX_FILE: Final = 0xFFFFFFFF  # bytes of a file that its fields of 32 bits can name; more stays out
_PAYLOAD: Final = 251
_HEADER: Final = struct.Struct("<HBBBBBxI")
_BURST: Final = 256  # messages; then the client asks on: one that has gone is not served for long
_CRC_PIECE: Final = 1 << 16  # bytes a tick, about 30 µs
_ALL_ONES: Final = 0xFFFFFFFF


@dataclass(frozen=True, slots=True)
class Request:
    """A message to the vehicle."""

    sequence: int
    session: int
    opcode: int
    size: int  # bytes of data, or bytes that a read asks for
    offset: int  # bytes into the file, or entries into the directory
    data: bytes

    @property
    def path(self) -> bytes:
        """The path that the data name; clients may or may not end it with NUL."""
        return self.data.partition(b"\0")[0]


@dataclass(frozen=True, slots=True)
class Reply:
    """A message from the vehicle, but for its sequence number."""

    data: bytes = b""
    offset: int = 0
    session: int | None = None  # that of the request if None
    burst_complete: bool = False
    opcode: int = dialect.MAV_FTP_OPCODE_ACK


def read_request(payload: bytes) -> Request:
    """Take a payload of 251 bytes apart."""
    sequence, session, opcode, size, _, _, offset = _HEADER.unpack_from(payload)
    data = payload[_HEADER.size : _HEADER.size + size]
    return Request(sequence, session, opcode, size, offset, data)


def write_reply(reply: Reply, request: Request, sequence: int) -> bytes:
    """Make a payload of 251 bytes; its sequence, modulo 65536, is the request's and one more."""
    header = _HEADER.pack(
        sequence & 0xFFFF,
        request.session if reply.session is None else reply.session,
        reply.opcode,
        len(reply.data),
        request.opcode,
        reply.burst_complete,
        reply.offset,
    )
    return (header + reply.data).ljust(_PAYLOAD, b"\0")


def refused(why: int) -> Reply:
    """A NAK with one of MAV_FTP_ERR."""
    return Reply(bytes([why]), opcode=dialect.MAV_FTP_OPCODE_NAK)


Job: TypeAlias = Generator[Reply | None, None, None]
"""Yields what to send, and None where it has to go on at the next tick."""


def served_size(file: OpenFile) -> int:
    """Bytes of an open file that can be read: its beginning, if it has more than fit the fields."""
    return min(file.size, MAX_FILE)


def read(request: Request, file: OpenFile) -> Job:
    """One piece of a file."""
    yield from _piece(request.size or MAX_DATA, file, request.offset, burst_complete=False)


def burst(request: Request, file: OpenFile) -> Job:
    """Piece after piece, to the end of the file or of the burst.

    Each as large as fits, whatever size was asked for, as PX4 has it: some clients ask for 4 bytes.
    """
    size = MAX_DATA
    for number in range(_BURST):
        offset = request.offset + number * size
        last = number == _BURST - 1 or offset + size >= served_size(file)
        yield from _piece(size, file, offset, burst_complete=last)
        if last:
            return


def _piece(size: int, file: OpenFile, offset: int, *, burst_complete: bool) -> Job:
    left = served_size(file) - offset
    if left <= 0:
        yield refused(dialect.MAV_FTP_ERR_EOF)
        return
    try:
        for data in _delivered(file, offset, min(size, left)):
            if data is None:
                yield None
            else:
                yield Reply(data, offset, burst_complete=burst_complete)
    except OSError:
        yield refused(dialect.MAV_FTP_ERR_FAIL)


def checksum(served: ServedFile) -> Job:
    """The CRC-32 of all that is served of a file, without zlib's inversions at both ends."""
    try:
        file = served.open()
    except OSError:
        yield refused(dialect.MAV_FTP_ERR_FILENOTFOUND)
        return
    try:
        crc = _ALL_ONES
        size = served_size(file)
        for offset in range(0, size, _CRC_PIECE):
            for data in _delivered(file, offset, min(_CRC_PIECE, size - offset)):
                crc = crc if data is None else zlib.crc32(data, crc)
                yield None
        yield Reply((crc ^ _ALL_ONES).to_bytes(4, "little"))
    except OSError:
        yield refused(dialect.MAV_FTP_ERR_FAIL)
    finally:
        file.close()


def _delivered(file: OpenFile, offset: int, count: int) -> Iterator[bytes | None]:
    """Nones while the disk has not delivered, then the data.

    Raises:
        OSError: The file cannot be read, or has become shorter.
    """
    while (data := file.read(offset, count)) is None:
        yield None
    if not data:
        raise OSError("the file has become shorter")
    yield data
