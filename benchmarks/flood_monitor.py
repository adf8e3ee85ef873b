"""A ground station that measures what telemetry and acknowledgements a flood leaves it."""

from __future__ import annotations

import select
import socket
import threading
import time
from collections import Counter
from dataclasses import dataclass, field
from typing import Any, Final

from messages.frames import Frame, FrameWriter, split

SYSTEM, COMPONENT = 255, 190  # of the monitor
_HEARTBEAT, _COMMAND_LONG, _COMMAND_ACK = 0, 76, 77
_ARM, _REQUEST_MESSAGE, _AUTOPILOT_VERSION = 400, 512, 148
_ASK_EVERY_S: Final = 0.2


@dataclass
class Heard:
    """What a ground station saw; times are of arrival [s, monotonic]."""

    heartbeats: list[float] = field(default_factory=list)
    modes: list[tuple[int, int]] = field(default_factory=list)  # base and custom mode, each change
    counts: Counter[tuple[int, int]] = field(default_factory=Counter)  # by component and message
    acknowledged_s: list[float] = field(default_factory=list)  # how long each command took
    asked: int = 0
    others: list[tuple[int, int, int, int]] = field(default_factory=list)  # ACKs to others
    first_us: int = 0  # sensor time of the first and the last attitude
    last_us: int = 0


class Monitor:
    """Listens in a thread, says that it is there, and asks a command five times a second."""

    def __init__(self) -> None:
        self.heard = Heard()
        self.vehicle: Any = None  # its address, once heard
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        self._socket.bind(("127.0.0.1", 0))
        self._writer = FrameWriter(SYSTEM, COMPONENT)
        self._waiting: tuple[int, float] | None = None  # command and when it was asked
        self._closing = False
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    @property
    def address(self) -> str:
        """Where telemetry should go."""
        return f"udp:127.0.0.1:{self._socket.getsockname()[1]}"

    def close(self) -> None:
        """Stop."""
        self._closing = True
        self._thread.join()
        self._socket.close()

    def restart(self) -> None:
        """Count from now on: everything so far belongs to the start of the flight."""
        modes = self.heard.modes[-1:]
        self.heard = Heard(modes=modes)

    def _listen(self) -> None:
        sent = asked = 0.0
        while not self._closing:
            ready, _, _ = select.select([self._socket], (), (), 0.01)
            if ready:
                datagram, self.vehicle = self._socket.recvfrom(4096)
                for frame in split(datagram):
                    self._take(frame)
            if self.vehicle is None:
                continue
            now = time.monotonic()
            if now - sent >= 1.0:
                sent = now
                self._send(_HEARTBEAT, 0, 6, 8, 0, 4, 3)
            if now - asked >= _ASK_EVERY_S:
                asked = now
                self._ask()

    def _ask(self) -> None:
        """One command to the link, the next to the vehicle: arm, which it is, or may not be."""
        heard = self.heard
        command, number = (_REQUEST_MESSAGE, _AUTOPILOT_VERSION) if heard.asked % 2 else (_ARM, 1)
        heard.asked += 1
        self._waiting = (command, time.monotonic())
        self._send(_COMMAND_LONG, number, *(0.0,) * 6, command, 1, 1, 0)

    def _send(self, message_id: int, *values: float) -> None:
        self._socket.sendto(self._writer.frame(message_id, *values), self.vehicle)

    def _take(self, frame: Frame) -> None:
        heard, now, values = self.heard, time.monotonic(), frame.payload_values
        heard.counts[(frame.component_id, frame.message_id)] += 1
        if frame.message_id == _HEARTBEAT:
            heard.heartbeats.append(now)
            mode = (int(values[3]), int(values[0]))
            if heard.modes[-1:] != [mode]:
                heard.modes.append(mode)
        elif frame.message_id == _COMMAND_ACK:
            command, result, _, _, system, component = (int(value) for value in values)
            if (system, component) != (SYSTEM, COMPONENT):
                heard.others.append((command, result, system, component))
            elif self._waiting is not None and self._waiting[0] == command:
                heard.acknowledged_s.append(now - self._waiting[1])
                self._waiting = None
        elif frame.message_id == 30:
            heard.last_us = 1000 * int(values[0])
            heard.first_us = heard.first_us or heard.last_us
