"""Log download: LOG_REQUEST_LIST, LOG_REQUEST_DATA and what follows from them.

The size of a log is the one that was last listed, so that a client gets exactly the file that
was listed even while the flight goes on and the file grows.

Source: https://mavlink.io/en/messages/common.html#LOG_REQUEST_LIST
"""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Sequence
from concurrent.futures import Future
from typing import Final, NamedTuple, cast

from fsw.autopilot.signals import StatusText
from fsw.link.files.served_file import OpenFile
from fsw.link.files.vehicle_files import FlightLogs
from fsw.link.services.service import LinkService
from fsw.link.wire.decode import Numbers
from fsw.link.wire.outgoing import Outgoing, ServiceOutput
from messages import message_ids
from messages.frames import Frame

CHUNK: Final = 90  # bytes of a log in one LOG_DATA
_FRAMES: Final = 6  # a tick: 3000 messages a second, as many as a client in Python can read
# A client that asks for a log in pieces up to this size asks for the next one when it has all of
# the last: it sets the pace. QGroundControl and MAVSDK ask for 512 messages at once.
_PACED_BY_CLIENT: Final = 1 << 16
_DATAGRAM_FRAMES: Final = 12  # LOG_DATA in one datagram
_LOG_DATA: Final = struct.Struct(f"<IHB{CHUNK}s")
_ENTRIES: Final = 8  # a tick: each asks the file system once
_MAX_REQUESTS: Final = 32  # a client asks again for what got lost in up to 20 pieces
_TO_THE_END: Final = 0xFFFFFFFF


class _Request(NamedTuple):
    log_id: int
    offset: int  # the next byte to send
    end: int  # behind the last byte to send
    closed: bool  # whether the client waits for a short message as the sign of the end
    paced: bool  # whether the client sets the pace


class LogService(LinkService):
    """Serves the logs of one link. Messages carry no addressee, so there is one transfer."""

    message_ids = frozenset(
        {
            message_ids.LOG_REQUEST_LIST,
            message_ids.LOG_REQUEST_DATA,
            message_ids.LOG_ERASE,
            message_ids.LOG_REQUEST_END,
        }
    )

    def __init__(self, logs: FlightLogs) -> None:
        self._kept = logs
        self._logs = logs.all
        self._erasure: Future[StatusText] | None = None
        self._listed: dict[int, int] = {}  # bytes that each log was listed with
        self._to_list: deque[int] = deque()
        self._requests: deque[_Request] = deque()
        self._open: tuple[int, OpenFile] | None = None

    def handle(self, frame: Frame, t_us: int) -> Sequence[Outgoing]:
        """Store a request."""
        values = cast(Numbers, frame.payload_values)
        self._look_again()
        if frame.message_id == message_ids.LOG_REQUEST_LIST:
            return self._list(*map(int, values[:2]))
        if frame.message_id == message_ids.LOG_REQUEST_DATA:
            self._request(*map(int, values[:3]))
        elif frame.message_id == message_ids.LOG_REQUEST_END:
            self._stop()
        elif frame.message_id == message_ids.LOG_ERASE:
            if self._erasure is None:  # of one under way the outcome is still to be told
                self._erasure = self._kept.erase()
            self._look_again()
        return ()

    def poll(self, t_us: int) -> Sequence[ServiceOutput]:
        """Send the next entries, and the next piece of a log that was requested whole."""
        if not self._to_list and not self._requests and self._erasure is None:
            return ()
        answers: list[ServiceOutput] = []
        while self._to_list and len(answers) < _ENTRIES:
            answers.append(self._entry(self._to_list.popleft()))
        if self._erasure is not None and self._erasure.done():
            answers.append(self._erasure.result())
            self._erasure = None
        if self._requests and not self._requests[0].paced:
            answers += self._data(_FRAMES - len(answers))
        return answers

    def bulk(self, t_us: int) -> Sequence[ServiceOutput]:
        """Send the next datagram of a log that is requested piece by piece."""
        if not self._requests or not self._requests[0].paced:
            return ()
        return self._data(_DATAGRAM_FRAMES)

    def _look_again(self) -> None:
        """Logs that were erased, over any link, give their numbers to others."""
        if self._kept.all is not self._logs:
            self._logs = self._kept.all
            self._stop()
            self._to_list.clear()
            self._listed.clear()

    def _list(self, first: int, last: int) -> Sequence[Outgoing]:
        if not self._logs:
            return [Outgoing(message_ids.LOG_ENTRY, (0, 0, 0, 0, 0))]
        self._to_list = deque(range(first, min(last, len(self._logs) - 1) + 1))
        return ()

    def _entry(self, log_id: int) -> Outgoing:
        if self._open is not None and self._open[0] == log_id:
            self._close()  # it was opened at its earlier size
        size = self._list_size(log_id)
        try:
            time_s = int(self._logs[log_id].log.status().st_mtime)
        except OSError:
            time_s = 0
        count = len(self._logs)
        return Outgoing(message_ids.LOG_ENTRY, (time_s, size, log_id, count, count - 1))

    def _list_size(self, log_id: int) -> int:
        size = min(self._logs[log_id].log.size, _TO_THE_END)
        self._listed[log_id] = size
        return size

    def _request(self, offset: int, count: int, log_id: int) -> None:
        if not log_id < len(self._logs):
            return
        size = self._listed.get(log_id)
        if size is None:
            size = self._list_size(log_id)
        another = bool(self._requests) and self._requests[0].log_id != log_id
        if another or count == _TO_THE_END:
            self._requests.clear()
        if len(self._requests) < _MAX_REQUESTS:
            end = min(offset + count, size)
            closed = count == _TO_THE_END or offset >= size
            paced = count <= _PACED_BY_CLIENT
            self._requests.append(
                _Request(log_id=log_id, offset=offset, end=end, closed=closed, paced=paced)
            )

    def _data(self, frames: int) -> list[Outgoing]:
        """The next LOG_DATA of the first request; none while the disk has not delivered."""
        request = self._requests[0]
        log_id, offset, end = request.log_id, request.offset, request.end
        try:
            data = self._file(log_id).read(offset, min(CHUNK * frames, max(end - offset, 0)))
        except OSError:
            data = b""  # gone or damaged: nothing more will come of it
        if data is None or frames <= 0:
            return []
        messages = [
            _log_data(log_id, offset + at, data[at : at + CHUNK])
            for at in range(0, len(data), CHUNK)
        ]
        offset += len(data)
        if data and offset < end:
            self._requests[0] = request._replace(offset=offset)
            return messages
        self._requests.popleft()
        # Without an end of its own a request is over for the client at the first message that is
        # not full, so one more is due where the last byte filled its message.
        if not data or (request.closed and len(data) % CHUNK == 0):
            messages.append(_log_data(log_id, offset, b""))
        return messages

    def _file(self, log_id: int) -> OpenFile:
        if self._open is None or self._open[0] != log_id:
            self._close()
            self._open = log_id, self._logs[log_id].log.open()
        return self._open[1]

    def _stop(self) -> None:
        self._requests.clear()
        self._close()

    def _close(self) -> None:
        if self._open is not None:
            self._open[1].close()
            self._open = None


def _log_data(log_id: int, offset: int, data: bytes) -> Outgoing:
    payload = _LOG_DATA.pack(offset, log_id, len(data), data)
    return Outgoing(message_ids.LOG_DATA, payload)
