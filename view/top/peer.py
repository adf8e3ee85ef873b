"""The telemetry of a running vehicle, as a peer that only watches."""

from __future__ import annotations

import re
import time
from functools import cache
from typing import Any, Final

from fsw.link.endpoints import open_endpoint
from messages import dialect
from messages.addresses import LinkAddress
from messages.frames import Frame, FrameWriter, Losses, wire_fields

_SYSTEM, _COMPONENT = 253, 191  # of no ground station in use
_HEARTBEAT: Final = 0
# Not a ground station: its loss is a failsafe, and a watcher may leave when it likes.
_ONBOARD_CONTROLLER, _NO_AUTOPILOT, _ACTIVE, _VERSION = 18, 8, 4, 3
_BEAT_S: Final = 1.0
_AT_ONCE: Final = 500  # datagrams: more than come in a second
_ELEMENT: Final = re.compile(r"(\w+)\[\d+\]")

Value = float | int | str | tuple[float, ...]


class TelemetryPeer:
    """Asks a vehicle to be told, once a second, and takes what comes."""

    def __init__(self, vehicle: LinkAddress) -> None:
        """Open a link of its own."""
        self._endpoint, self._vehicle = open_endpoint(vehicle, lambda: time.monotonic_ns() // 1000)
        self._losses = Losses()
        self._writer = FrameWriter(_SYSTEM, _COMPONENT)
        self._last_beat: float | None = None

    def poll(self, now: float) -> list[Frame]:
        """Everything that has come, without waiting; ``now`` [s] is the time on any clock."""
        if self._last_beat is None or now - self._last_beat >= _BEAT_S:
            self._last_beat = now
            beat = (0, _ONBOARD_CONTROLLER, _NO_AUTOPILOT, 0, _ACTIVE, _VERSION)
            self._endpoint.send(self._writer.frame(_HEARTBEAT, *beat), self._vehicle)
        found: list[Frame] = []
        for _ in range(_AT_ONCE):
            came = self._endpoint.receive_waiting()
            if came is None:
                break
            datagram, sender = came
            if sender == self._vehicle:
                found += [frame for frame, _ in self._endpoint.cut(datagram, self._losses)]
        return found

    def close(self) -> None:
        """Give the port back; the vehicle forgets this peer after a while."""
        self._endpoint.close()


def unit(message_id: int, field: str) -> str:
    """The unit of a field as the dialect has it; empty for a plain number."""
    return str(_kind(message_id).fieldunits_by_name.get(field, ""))


def meaning(message_id: int, field: str, value: Value) -> str:
    """The name of a value of an enumeration; empty where it is none."""
    kind = _kind(message_id)
    enum = kind.fieldenums_by_name.get(field)
    if enum is None or not isinstance(value, int) or field in kind.fielddisplays_by_name:
        return ""
    entry = dialect.enums.get(enum, {}).get(value)
    return "" if entry is None else str(entry.name).removeprefix(f"{enum}_")


@cache
def _kind(message_id: int) -> Any:
    return dialect.mavlink_map[message_id]


@cache
def _places(message_id: int) -> tuple[tuple[str, slice | int], ...]:
    """Each field and where its values are among those of a frame, in the order of the dialect."""
    places: dict[str, slice | int] = {}
    for k, name in enumerate(wire_fields(message_id)):
        element = _ELEMENT.fullmatch(name)
        if element is None:
            places[name] = k
            continue
        known = places.get(element[1])
        begin = known.start if isinstance(known, slice) else k
        places[element[1]] = slice(begin, k + 1)
    return tuple((name, places[name]) for name in _kind(message_id).fieldnames)


def fields(message_id: int, values: tuple[Any, ...]) -> dict[str, Value]:
    """The values of a frame by the names of their fields, in the dialect's order and units."""
    found: dict[str, Value] = {}
    for name, place in _places(message_id):
        value = values[place]
        if isinstance(value, bytes):
            value = value.partition(b"\0")[0].decode("utf-8", "replace")
        found[name] = value
    return found
