"""A ground station that downloads a log as QGroundControl and MAVSDK do: by LOG_*, by FTP burst.

It takes the payloads it wants out of datagrams by hand, so that its own reading is not what is
measured. MAVLink 2 without loss: sender and receiver are on one machine.
"""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Iterator
from typing import Any, Final

from messages.frames import FrameWriter

CHUNK: Final = 90  # bytes of a log in one LOG_DATA
WINDOW: Final = 512 * CHUNK  # QGroundControl asks for 512 messages, and for the next when all came
_PATIENCE_S: Final = 0.5  # until what is missing is asked for again
_GIVE_UP_S: Final = 10.0  # without a byte
_HEADER: Final = 10
_CHECKSUM: Final = 2
_LOG_ENTRY, _LOG_REQUEST_LIST, _LOG_DATA, _LOG_REQUEST_DATA = 118, 117, 120, 119
_FTP: Final = 110
_OPEN, _BURST, _RESET, _ACK = 4, 15, 2, 128
_FTP_HEADER: Final = struct.Struct("<HBBBBBxI")  # sequence, session, opcode, size, …, offset
_FTP_BYTES: Final = 239
_ENTRY: Final = struct.Struct("<IIHHH")  # time, size, id, number of logs, id of the last
_DATA: Final = struct.Struct("<IHB")  # offset, id, count
# Longest payloads; MAVLink 2 leaves zeros at the end away.
_LENGTHS: Final = {_LOG_ENTRY: 14, _LOG_DATA: 97, _FTP: 254}


class NothingCame(Exception):
    """The vehicle has stopped sending, in one sentence."""


class DownloadClient:
    """One socket, one vehicle."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(_PATIENCE_S)
        self._writer = FrameWriter(255, 190)
        self._vehicle: Any = None
        self._sequence = 0
        self.asked_again = 0  # for what did not come in time

    @property
    def address(self) -> str:
        """Where telemetry should go."""
        return f"udp:127.0.0.1:{self._socket.getsockname()[1]}"

    def close(self) -> None:
        """Stop."""
        self._socket.close()

    def connect(self, patience_s: float) -> None:
        """Wait for the vehicle and say hello.

        Raises:
            NothingCame: It did not come.
        """
        until_s = time.monotonic() + patience_s
        while self._vehicle is None:
            if time.monotonic() > until_s:
                raise NothingCame(f"no vehicle was heard within {patience_s:g} s")
            try:
                _, self._vehicle = self._socket.recvfrom(4096)
            except TimeoutError:
                continue
        self._send(0, 0, 6, 8, 0, 4, 3)

    def logs(self) -> dict[int, int]:
        """Bytes of each log that the vehicle lists, by number."""
        self._send(_LOG_REQUEST_LIST, 0, 0xFFFF, 1, 1)
        found: dict[int, int] = {}
        for payload in self._payloads(_LOG_ENTRY):
            if payload is None:
                self._send(_LOG_REQUEST_LIST, 0, 0xFFFF, 1, 1)
                continue
            _, size, number, count, _ = _ENTRY.unpack_from(payload)
            found[number] = size
            if len(found) == count:
                break
        return found

    def by_log_messages(self, number: int, size: int) -> bytes:
        """Download a log by LOG_REQUEST_DATA.

        Raises:
            NothingCame: It ended early.
        """
        data = bytearray(size)
        for base in range(0, size, WINDOW):
            end = min(base + WINDOW, size)
            missing = set(range(base, end, CHUNK))
            self._send(_LOG_REQUEST_DATA, base, end - base, number, 1, 1)
            for payload in self._payloads(_LOG_DATA):
                if payload is None:
                    first = min(missing)
                    self._send(_LOG_REQUEST_DATA, first, end - first, number, 1, 1)
                    continue
                offset, _, count = _DATA.unpack_from(payload)
                data[offset : offset + count] = payload[7 : 7 + count]
                missing.discard(offset)
                if not missing:
                    break
        return bytes(data)

    def by_ftp(self, path: str, size: int) -> bytes:
        """Download a file by bursts.

        Raises:
            NothingCame: It ended early, or the vehicle refused.
        """
        self._ask_ftp(_RESET)
        data, at, session = bytearray(size), 0, 0
        for payload in self._payloads(_FTP):
            if payload is None:
                self._ask_ftp(_BURST, session, at)
                continue
            sequence, session_, opcode, count, request, complete, offset = _FTP_HEADER.unpack_from(
                payload, 3
            )
            self._sequence = sequence
            if request == _RESET:
                self._ask_ftp(_OPEN, data=path.encode())
                continue
            if opcode != _ACK:
                raise NothingCame(f"the vehicle refused {path} with FTP error {payload[15]}")
            if request == _OPEN:
                session = session_
                self._ask_ftp(_BURST, session, at)
                continue
            data[offset : offset + count] = payload[15 : 15 + count]
            at = offset + count
            if at >= size:
                break
            if complete:
                self._ask_ftp(_BURST, session, at)
        return bytes(data[:size])

    def _ask_ftp(self, opcode: int, session: int = 0, at: int = 0, data: bytes = b"") -> None:
        self._sequence = (self._sequence + 1) & 0xFFFF
        size = len(data) or _FTP_BYTES
        header = _FTP_HEADER.pack(self._sequence, session, opcode, size, 0, 0, at)
        self._send(_FTP, 0, 1, 1, *(header + data).ljust(251, b"\0"))

    def _send(self, message_id: int, *values: float) -> None:
        self._socket.sendto(self._writer.frame(message_id, *values), self._vehicle)

    def _payloads(self, wanted: int) -> Iterator[bytes | None]:
        """Payloads of one message as they come; None where it is time to ask again."""
        heard_s = asked_s = time.monotonic()
        while True:
            try:
                datagram = self._socket.recv(65536)
            except TimeoutError:
                datagram = b""
            now_s, at = time.monotonic(), 0
            while at < len(datagram):
                size = datagram[at + 1]
                if datagram[at + 7] == wanted and not datagram[at + 8] and not datagram[at + 9]:
                    heard_s = asked_s = now_s
                    payload = datagram[at + _HEADER : at + _HEADER + size]
                    yield payload.ljust(_LENGTHS[wanted], b"\0")
                at += _HEADER + size + _CHECKSUM
            if now_s - heard_s > _GIVE_UP_S:
                raise NothingCame(f"nothing came for {_GIVE_UP_S:g} s")
            if now_s - asked_s > _PATIENCE_S:  # telemetry goes on meanwhile
                asked_s = now_s
                self.asked_again += 1
                yield None
