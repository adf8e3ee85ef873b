"""The ULog of this flight as it is written, over LOGGING_DATA: MAV_CMD_LOGGING_START and _STOP.

The definitions at the beginning of a log are sent one piece after the other, each when the last one
has been acknowledged; all that follows is sent as it comes and not again, as PX4 does. The stream
begins with the beginning of the log, so that what a client writes down is a whole log.

Source: https://mavlink.io/en/messages/common.html#LOGGING_DATA
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import Final, cast

from fsw.autopilot.signals import CommandRequest, CommandResult, Severity, StatusText
from fsw.link.files.served_file import DiskFile, OpenFile
from fsw.link.files.vehicle_files import FlightLogs
from fsw.link.services.service import LinkService, Outcome
from fsw.link.wire.outgoing import Outgoing, ServiceOutput
from messages import message_ids
from messages.frames import Frame

_START, _STOP = 2510, 2511  # MAV_CMD
PIECE: Final = 249  # bytes of a log in one message
_FRAMES: Final = (
    5  # a tick: a datagram, 2500 messages a second, as many as a client in Python reads
)
_NO_MESSAGE: Final = 255  # no message of the log begins in a piece
_AGAIN_US: Final = 100_000  # a piece that is not acknowledged is sent again,
_TRIES: Final = 50  # so often
_LOOK_US: Final = 50_000  # between two looks whether the file has grown
_FILE_HEAD: Final = 16  # bytes before the first message of a ULog
_HEAD: Final = struct.Struct("<Hc")  # of a message: size of what follows, and type
_DEFINITIONS: Final = frozenset((b"B", b"F", b"I", b"M", b"P", b"Q"))
_DATA: Final = struct.Struct(f"<H4B{PIECE}s")


class LogStreamService(LinkService):
    """One stream a link, to the program that asked for it."""

    message_ids = frozenset({message_ids.LOGGING_ACK})
    commands = frozenset({_START, _STOP})

    def __init__(self, logs: FlightLogs) -> None:
        self._logs = logs
        self._client: tuple[int, int] | None = None  # system and component
        self._log: DiskFile | None = None
        self._file: OpenFile | None = None
        self._begin()

    def _begin(self) -> None:
        self._close()
        self._sequence = 0
        self._offset = 0  # of the next piece
        self._boundary = _FILE_HEAD  # where the next message begins whose size is not known yet
        self._data_begin: int | None = None  # where the definitions end, once that is known
        self._awaited: Outgoing | None = None  # the piece to be acknowledged
        self._tries, self._next_us = 0, 0

    def carry_out(self, request: CommandRequest, t_us: int, armed: bool) -> Outcome:
        """Begin or end a stream."""
        client = (request.source_system, request.source_component)
        if request.command == _STOP:
            self._end()
            return CommandResult.ACCEPTED, ""
        kind = request.params[0]
        if not (kind == 0.0 or math.isnan(kind)):
            return CommandResult.DENIED, f"log not streamed: format {kind:g} is not ULog, 0"
        self._log = self._logs.present_ulog
        if self._log is None:
            return CommandResult.DENIED, "log not streamed: this flight writes no flight.ulg"
        if self._client not in (None, client):
            return CommandResult.TEMPORARILY_REJECTED, "log not streamed: another program has it"
        self._begin()
        self._client = client
        return CommandResult.ACCEPTED, ""

    def handle(self, frame: Frame, t_us: int) -> Sequence[ServiceOutput]:
        """Go on when a piece is acknowledged."""
        sender = (frame.system_id, frame.component_id)
        awaited = self._awaited is not None and frame.payload_values[0] == self._sequence
        if not awaited or sender != self._client:
            return ()
        self._awaited, self._next_us = None, t_us
        self._sequence = (self._sequence + 1) & 0xFFFF
        return self.poll(t_us)

    def poll(self, t_us: int) -> Sequence[ServiceOutput]:
        """Send the next pieces."""
        if self._client is None or t_us < self._next_us:
            return ()
        if self._awaited is not None:
            return self._send_again(t_us)
        pieces: list[ServiceOutput] = []
        while len(pieces) < _FRAMES:
            piece = self._piece(t_us)
            if piece is None:
                break
            pieces.append(piece)
            if piece.message_id == message_ids.LOGGING_DATA_ACKED:
                self._awaited, self._tries, self._next_us = piece, 1, t_us + _AGAIN_US
                break
            self._sequence = (self._sequence + 1) & 0xFFFF
        return pieces

    def _send_again(self, t_us: int) -> Sequence[ServiceOutput]:
        assert self._client is not None
        assert self._awaited is not None
        if self._tries >= _TRIES:
            system, component = self._client
            self._end()
            why = f"log stream ended: {system}/{component} acknowledges nothing"
            return (StatusText(Severity.WARNING, why),)
        self._tries, self._next_us = self._tries + 1, t_us + _AGAIN_US
        return (self._awaited,)

    def _piece(self, t_us: int) -> Outgoing | None:
        """The next piece; None while it is not on the disk."""
        assert self._client is not None
        try:
            found = self._read(t_us)
        except OSError:
            self._end()  # gone or damaged: nothing more will come of it
            return None
        if len(found) < PIECE + _HEAD.size:
            return None
        begins = self._begin_of_message(found)
        acked = self._data_begin is None or self._offset < self._data_begin
        kind = message_ids.LOGGING_DATA_ACKED if acked else message_ids.LOGGING_DATA
        payload = _DATA.pack(self._sequence, *self._client, PIECE, begins, found[:PIECE])
        self._offset += PIECE
        return Outgoing(kind, payload)

    def _read(self, t_us: int) -> bytes:
        """The next piece and the head of a message that begins at its end, if they are there."""
        assert self._log is not None
        wanted = self._offset + PIECE + _HEAD.size
        if self._file is None or self._file.size < wanted:
            # It is opened at a size, and grows; a look costs some microseconds.
            self._close()
            self._file = self._log.open()
            if self._file.size < wanted:
                self._next_us = t_us + _LOOK_US
                return b""
        return self._file.read(self._offset, PIECE + _HEAD.size) or b""

    def _begin_of_message(self, found: bytes) -> int:
        """Where the first message begins that begins in a piece; learns where the next one does."""
        end, first = self._offset + PIECE, self._boundary
        while self._boundary < end:
            size, kind = _HEAD.unpack_from(found, self._boundary - self._offset)
            if self._data_begin is None and kind not in _DEFINITIONS:
                self._data_begin = self._boundary
            self._boundary += _HEAD.size + cast(int, size)
        return first - self._offset if first < end else _NO_MESSAGE

    def _end(self) -> None:
        self._client = None
        self._close()

    def _close(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None
