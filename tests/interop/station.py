"""A ground station made of pymavlink: one socket, and how long each answer took."""

from __future__ import annotations

import contextlib
import socket
import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any

from messages import dialect

Message = Any
"""What mavgen made of a definition."""

PATIENCE_S = 1.0


class Station:
    """Asks a vehicle, and waits for what answers."""

    def __init__(self, port: int, system: int = 255, component: int = 190) -> None:
        self.took: dict[str, float] = {}  # s, by what was asked
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        self._socket.bind(("127.0.0.1", port))
        self._unread: deque[Message] = deque()
        self._vehicle: tuple[str, int] | None = None
        self._reader = dialect.MAVLink(None)
        self._reader.robust_parsing = True
        self.mav = dialect.MAVLink(self, system, component)  # sends what its *_send is called for
        self.hear(lambda m: m.get_type() == "HEARTBEAT", 5.0)
        self.greet()

    def write(self, frame: bytes) -> None:
        """Send a frame; pymavlink calls this."""
        assert self._vehicle is not None
        self._socket.sendto(frame, self._vehicle)

    def greet(self) -> None:
        """The heartbeat of a ground station."""
        self.mav.heartbeat_send(dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID, 0, 0, 4)

    def messages(self, patience_s: float) -> Iterator[Message]:
        """Everything that arrives within a time."""
        until = time.monotonic() + patience_s
        while (left := until - time.monotonic()) > 0.0:
            while self._unread:
                yield self._unread.popleft()
            self._socket.settimeout(left)
            with contextlib.suppress(TimeoutError):
                datagram, self._vehicle = self._socket.recvfrom(4096)
                self._unread += self._reader.parse_buffer(datagram) or ()

    def hear(self, wanted: Callable[[Message], bool], patience_s: float = PATIENCE_S) -> Message:
        """The first message of a kind."""
        for message in self.messages(patience_s):
            if wanted(message):
                return message
        raise AssertionError("nothing of the kind arrived")

    def ask(
        self, what: str, send: Callable[[], object], wanted: Callable[[Message], bool]
    ) -> Message:
        """Ask once, and note how long the answer took."""
        begin = time.monotonic()
        send()
        try:
            answer = self.hear(wanted)
        except AssertionError:
            raise AssertionError(f"{what}: no answer within {PATIENCE_S:g} s") from None
        self.took[what] = time.monotonic() - begin
        return answer

    def command(self, command: int, *params: float, integers: bool = False) -> int:
        """Give a command in either form; returns the result of its COMMAND_ACK."""
        p = (*params, *(0.0,) * (7 - len(params)))
        form = "INT" if integers else "LONG"

        def send() -> None:
            if integers:
                position = (int(p[4]), int(p[5]), p[6])
                self.mav.command_int_send(1, 1, 6, command, 0, 0, *p[:4], *position)
            else:
                self.mav.command_long_send(1, 1, command, 0, *p)

        def wanted(message: Message) -> bool:
            return message.get_type() == "COMMAND_ACK" and message.command == command

        ack = self.ask(f"{command} {form} {params[:1]}", send, wanted)
        assert (ack.get_srcComponent(), ack.target_system) == (1, self.mav.srcSystem)
        return int(ack.result)

    def request(self, message_id: int, which: float = 0.0) -> Message:
        """Ask for one message with MAV_CMD_REQUEST_MESSAGE."""
        name = dialect.mavlink_map[message_id].msgname
        begin = time.monotonic()
        acknowledged, found = False, None
        self.mav.command_long_send(1, 1, 512, 0, message_id, which, 0, 0, 0, 0, 0)
        for message in self.messages(PATIENCE_S):
            if message.get_type() == "COMMAND_ACK" and message.command == 512:
                assert message.result == 0, f"{name}: result {message.result}"
                acknowledged = True
            if message.get_msgId() == message_id:
                found = message
            if acknowledged and found is not None:
                self.took[f"{name} {which:g}"] = time.monotonic() - begin
                return found
        raise AssertionError(f"{name}: acknowledged {acknowledged}, message {found}")

    def close(self) -> None:
        """Give the port back."""
        self._socket.close()
