"""What the payload of a FILE_TRANSFER_PROTOCOL message says; pure.

Source: https://mavlink.io/en/services/ftp.html
"""

from __future__ import annotations

import enum
import struct
from dataclasses import dataclass
from typing import Final

MAX_DATA: Final = 239  # bytes in one message
MAX_FILE: Final = 0xFFFFFFFF  # bytes of a file that its fields of 32 bits can name; more stays out
_PAYLOAD: Final = 251
_HEADER: Final = struct.Struct("<HBBBBBxI")


class Opcode(enum.IntEnum):
    """Operation codes of requests and replies."""

    TERMINATE_SESSION = 1
    RESET_SESSIONS = 2
    LIST_DIRECTORY = 3
    OPEN_FILE_RO = 4
    READ_FILE = 5
    CREATE_FILE = 6  # the first that writes
    REMOVE_FILE = 8
    RENAME = 13  # the last
    CALC_FILE_CRC32 = 14
    BURST_READ_FILE = 15
    ACK = 128
    NAK = 129


class Refusal(enum.IntEnum):
    """Error codes of a NAK."""

    FAIL = 1
    INVALID_DATA_SIZE = 3
    INVALID_SESSION = 4
    NO_SESSIONS_AVAILABLE = 5
    END_OF_FILE = 6
    UNKNOWN_COMMAND = 7
    FILE_PROTECTED = 9
    FILE_NOT_FOUND = 10


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
    def damaged(self) -> bool:
        """Whether it announces more data than there is room for."""
        return self.size > MAX_DATA

    @property
    def path(self) -> bytes:
        """The path that the data name; clients may or may not end it with NUL."""
        return self.data.partition(b"\0")[0]


@dataclass(frozen=True, slots=True)
class Reply:
    """A message from the vehicle, but for its sequence number."""

    opcode: Opcode
    session: int | None = None  # that of the request if None
    offset: int = 0
    data: bytes = b""
    burst_complete: bool = False


def read(payload: bytes) -> Request:
    """Take a payload of 251 bytes apart."""
    sequence, session, opcode, size, _, _, offset = _HEADER.unpack_from(payload)
    data = payload[_HEADER.size : _HEADER.size + size]
    return Request(
        sequence=sequence, session=session, opcode=opcode, size=size, offset=offset, data=data
    )


def write(reply: Reply, request: Request, sequence: int) -> bytes:
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


def refused(why: Refusal) -> Reply:
    """A NAK."""
    return Reply(Opcode.NAK, data=bytes([why]))
