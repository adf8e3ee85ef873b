"""MAVLink FTP replies that take more than one tick."""

from __future__ import annotations

import zlib
from collections.abc import Generator, Iterator
from typing import Final, TypeAlias

from fsw.link.files.ftp_message import (
    MAX_DATA,
    MAX_FILE,
    Opcode,
    Refusal,
    Reply,
    Request,
    refused,
)
from fsw.link.files.served_file import OpenFile, ServedFile

Job: TypeAlias = Generator[Reply | None, None, None]
"""Yields what to send, and None where it has to go on at the next tick."""

_BURST: Final = 256  # messages; then the client asks on: one that has gone is not served for long
_CRC_PIECE: Final = 1 << 16  # bytes a tick, about 30 µs
_ALL_ONES: Final = 0xFFFFFFFF


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
        yield refused(Refusal.END_OF_FILE)
        return
    try:
        for data in _delivered(file, offset, min(size, left)):
            if data is None:
                yield None
            else:
                yield Reply(Opcode.ACK, offset=offset, data=data, burst_complete=burst_complete)
    except OSError:
        yield refused(Refusal.FAIL)


def checksum(served: ServedFile) -> Job:
    """The CRC-32 of all that is served of a file, without zlib's inversions at both ends."""
    try:
        file = served.open()
    except OSError:
        yield refused(Refusal.FILE_NOT_FOUND)
        return
    try:
        crc = _ALL_ONES
        size = served_size(file)
        for offset in range(0, size, _CRC_PIECE):
            for data in _delivered(file, offset, min(_CRC_PIECE, size - offset)):
                crc = crc if data is None else zlib.crc32(data, crc)
                yield None
        yield Reply(Opcode.ACK, data=(crc ^ _ALL_ONES).to_bytes(4, "little"))
    except OSError:
        yield refused(Refusal.FAIL)
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
