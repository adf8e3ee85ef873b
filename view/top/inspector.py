"""What an inspector knows of a vehicle: a function of the messages that it saw."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Final

from fsw.link.wire.px4_mode import AVAILABLE_MODES
from messages import dialect
from view.top.peer import Message, Value

_WINDOW_S: Final = 3.0  # over which a rate is counted
_SILENT_S: Final = 2.0  # without a heartbeat the vehicle is lost
_ARMED: Final = 128  # MAV_MODE_FLAG_SAFETY_ARMED
_AUTOPILOT: Final = 1  # component
_TEXTS: Final = 200
_MODES: Final = {mode.custom_mode: mode.name for mode in AVAILABLE_MODES}


@dataclass(slots=True)
class Stream:
    """All messages of one kind from one component."""

    name: str
    message_id: int
    component: int
    count: int = 0
    at: float = 0.0  # s, when the last one came
    last: dict[str, Value] = field(default_factory=dict)
    arrivals: deque[float] = field(default_factory=deque)  # s, of the last seconds

    def rate(self, now: float) -> float:
        """Messages a second [Hz] at ``now`` [s]."""
        while self.arrivals and now - self.arrivals[0] > _WINDOW_S:
            self.arrivals.popleft()
        return len(self.arrivals) / _WINDOW_S

    def age(self, now: float) -> float:
        """Time [s] since the last one, at ``now`` [s]."""
        return now - self.at


@dataclass(frozen=True, slots=True)
class Said:
    """A status text."""

    t: float  # s, of its arrival
    severity: int  # MAV_SEVERITY
    text: str


@dataclass(frozen=True, slots=True)
class MarginLine:
    """One margin."""

    number: int
    margin: float  # m
    barrier: float  # m/s, h
    least: bool


class Inspector:
    """Counts and keeps; asks nothing of the vehicle."""

    def __init__(self) -> None:
        """Nothing was seen yet."""
        self.streams: dict[tuple[str, int], Stream] = {}
        self.texts: deque[Said] = deque(maxlen=_TEXTS)
        self._pieces: dict[int, str] = {}  # of long texts, by their id

    def see(self, messages: Iterable[Message]) -> None:
        """Take what came."""
        for message in messages:
            key = (message.name, message.component)
            stream = self.streams.get(key)
            if stream is None:
                stream = Stream(message.name, message.message_id, message.component)
                self.streams[key] = stream
            stream.count += 1
            stream.last = message.fields
            stream.at = message.t
            stream.arrivals.append(message.t)
            if message.name == "STATUSTEXT":
                self._listen(message)

    def _listen(self, message: Message) -> None:
        """A long text comes in pieces of 50 characters; the last one is shorter."""
        fields: dict[str, Any] = message.fields
        text, number = str(fields["text"]), int(fields["id"])
        whole = self._pieces.pop(number, "") + text if number else text
        if number and len(text.encode()) == 50:
            self._pieces[number] = whole
            return
        self.texts.append(Said(message.t, int(fields["severity"]), whole))

    def last(self, name: str, component: int | None = None) -> dict[str, Any] | None:
        """Fields of the newest message of a name; None before the first."""
        for (known, source), stream in self.streams.items():
            if known == name and component in (None, source):
                return stream.last
        return None

    def headline(self, now: float) -> str:
        """The vehicle in one line, at ``now`` [s]."""
        beat = self.streams.get(("HEARTBEAT", _AUTOPILOT))
        if beat is None:
            return "no vehicle has answered yet"
        if beat.age(now) > _SILENT_S:
            return f"vehicle lost: silent for {beat.age(now):.0f} s"
        fields: dict[str, Any] = beat.last
        parts = [
            _MODES.get(fields["custom_mode"], f"mode {fields['custom_mode']}"),
            "armed" if fields["base_mode"] & _ARMED else "disarmed",
            self._state(fields["system_status"]),
            self._battery(),
            self._place(),
            self._margin(),
            self._solver(),
        ]
        return "  ".join(part for part in parts if part)

    @staticmethod
    def _state(number: int) -> str:
        entry = dialect.enums["MAV_STATE"].get(number)
        return "" if entry is None else entry.name.removeprefix("MAV_STATE_").lower()

    def _battery(self) -> str:
        fields = self.last("SYS_STATUS")
        if fields is None or fields["battery_remaining"] < 0:
            return ""
        return f"battery {fields['battery_remaining']} %"

    def _place(self) -> str:
        fields = self.last("LOCAL_POSITION_NED")
        if fields is None:
            return ""
        return f"N {fields['x']:+.2f} E {fields['y']:+.2f} up {-fields['z']:.2f} m"

    def _margin(self) -> str:
        fields = self.last("BARRIER_MARGIN")
        if fields is None or not fields["count"]:
            return ""
        return f"margin {1e3 * fields['margin_min']:.0f} mm"

    def _solver(self) -> str:
        fields = self.last("MPC_STATUS")
        if fields is None:
            return ""
        entry = dialect.enums["PANDION_SOLVER_STATUS"].get(fields["solver_status"])
        word = "" if entry is None else entry.name.removeprefix("PANDION_SOLVER_STATUS_").lower()
        return f"plan {fields['plan_id']} {word} in {1e-3 * fields['total_us']:.1f} ms"

    def margins(self) -> tuple[MarginLine, ...]:
        """The margins of the last BARRIER_MARGIN."""
        fields = self.last("BARRIER_MARGIN")
        if fields is None:
            return ()
        count = min(int(fields["count"]), len(fields["margin"]))
        return tuple(
            MarginLine(k + 1, fields["margin"][k], fields["barrier"][k],
                       k == fields["margin_min_index"])
            for k in range(count)
        )  # fmt: skip
