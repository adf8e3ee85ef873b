"""A ground station's side of the mission protocol, by pymavlink over a socket that may lose."""

from __future__ import annotations

import random
import socket
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from fsw.link.gcs_link import GcsLink
from messages import dialect as mavlink

TICK_US = 2_000
Item = dict[str, Any]


@dataclass
class Weather:
    """Shares of datagrams that are lost, doubled or delivered after the next, either way."""

    lost: float = 0.0
    doubled: float = 0.0
    late: float = 0.0
    random: random.Random = field(default_factory=lambda: random.Random(5))
    held: list[bytes] = field(default_factory=list)

    def through(self, datagram: bytes) -> list[bytes]:
        dice = self.random.random()
        if dice < self.lost:
            return []
        if dice < self.lost + self.late:
            self.held.append(datagram)
            return []
        copies = [datagram] * (2 if dice > 1.0 - self.doubled else 1)
        held, self.held = self.held, []
        return copies + held


class Client:
    """One ground station; ``pump`` lets the vehicle's link live for a while meanwhile."""

    def __init__(
        self,
        link: GcsLink,
        station: socket.socket,
        system: int = 255,
        weather: Weather | None = None,
        after_tick: Callable[[int], None] = lambda t_us: None,
    ) -> None:
        self.mav = mavlink.MAVLink(None, srcSystem=system, srcComponent=190)
        self.mav.robust_parsing = True
        self.heard: list[Any] = []
        self.t_us = 1_000_000
        self._link = link
        self._station = station
        self._in, self._out = weather or Weather(), weather or Weather()
        self._after_tick = after_tick

    def send(self, message: Any) -> None:
        for datagram in self._out.through(message.pack(self.mav)):
            self._station.sendto(datagram, ("127.0.0.1", self._link.port))

    def pump(self, seconds: float, until: Callable[[Any], bool] | None = None) -> Any:
        """Let time pass; returns the first message that is wanted, None if it did not come."""
        for _ in range(round(seconds * 1e6) // TICK_US):
            self.t_us += TICK_US
            self._link.read(self.t_us, 4096)
            self._after_tick(self.t_us)
            arrived = self._receive()
            self.heard += arrived
            for message in arrived:
                if until is not None and until(message):
                    return message
        return None

    def ask(self, message: Any, *wanted: str, tries: int = 5, patience_s: float = 1.0) -> Any:
        """Send until one of the wanted messages comes back."""
        for _ in range(tries):
            self.send(message)
            answer = self.pump(patience_s, lambda m: m.get_type() in wanted)
            if answer is not None:
                return answer
        raise AssertionError(f"no {wanted} after {message.get_type()}")

    def texts(self) -> str:
        return "".join(m.text for m in self.heard if m.get_type() == "STATUSTEXT")

    def upload(self, items: list[Item], kind: int = 0, floats: bool = False) -> int:
        """Offer items as QGroundControl does (or MAVProxy, in floats); the result."""
        mav = self.mav
        answer = self.ask(
            mav.mission_count_encode(1, 1, len(items), kind), "MISSION_REQUEST_INT", "MISSION_ACK"
        )
        for _ in range(40 * (len(items) + 1)):
            if answer.get_type() == "MISSION_ACK":
                return int(answer.type)
            sent = self.item(items[answer.seq], answer.seq, kind, floats)
            answer = self.ask(sent, "MISSION_REQUEST_INT", "MISSION_ACK", tries=12)
        raise AssertionError("the vehicle asks for ever")

    def item(self, given: Item, seq: int, kind: int = 0, floats: bool = False) -> Any:
        """One item; x and y are given in the integers of MISSION_ITEM_INT."""
        frame = given.get("frame", 1)
        x, y = given.get("x", 0), given.get("y", 0)
        if floats:
            scale = 1e4 if frame in (1, 7) else 1e7
            x, y = x / scale, y / scale
        params = given.get("params", (0.0, 0.0, 0.0, float("nan")))
        build = self.mav.mission_item_encode if floats else self.mav.mission_item_int_encode
        return build(
            1, 1, seq, frame, given["command"], int(seq == 0), given.get("autocontinue", 1),
            *params, x, y, given.get("z", -1.0), kind,
        )  # fmt: skip

    def download(self, kind: int = 0, floats: bool = False) -> list[Any]:
        """All items, asked for one after the other."""
        mav = self.mav
        count = self.ask(mav.mission_request_list_encode(1, 1, kind), "MISSION_COUNT").count
        items = []
        request = mav.mission_request_encode if floats else mav.mission_request_int_encode
        wanted = "MISSION_ITEM" if floats else "MISSION_ITEM_INT"
        while len(items) < count:
            item = self.ask(request(1, 1, len(items), kind), wanted, tries=20, patience_s=0.3)
            if item.seq == len(items):
                items.append(item)
        self.send(mav.mission_ack_encode(1, 1, 0, kind))
        return items

    def _receive(self) -> list[Any]:
        found: list[Any] = []
        while True:
            try:
                datagram = self._station.recv(4096)
            except BlockingIOError:
                return found
            for piece in self._in.through(datagram):
                found += self.mav.parse_buffer(bytearray(piece)) or []
