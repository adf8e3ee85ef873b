"""What becomes of a sensor's readings while it fails."""

from __future__ import annotations

import math
from collections import deque
from typing import Any, Final, Generic, TypeVar

import numpy as np

from sitl.faults.keys import Fault
from sitl.ranges import V3
from sitl.sensors.exact import V4, turned
from sitl.sensors.noise import normal

M = TypeVar("M")  # a NamedTuple of readings

# Of each unit the fields of a reading that are its own.
FIELDS: Final[dict[str, tuple[str, ...]]] = {
    "gyro": ("gyro_B",),
    "accel": ("accel_B",),
    "mag": ("field_B",),
    "baro": ("pressure_pa",),
    "gps": ("p_WB", "v_WB"),
    "vio": ("p_WB", "v_WB", "q_WB", "w_WB_B"),
    "attitude": ("q_WB",),
    "distance": ("distance",),
    "encoder": ("q_arm", "qd_arm", "angles"),
}
# Of each field: how far a usual wrong reading is off, on each axis, and how far garbage goes.
_OFFSETS: Final[dict[str, tuple[tuple[float, ...], float]]] = {
    "gyro_B": ((0.5, -0.3, 0.2), 10.0),  # rad/s
    "accel_B": ((1.0, -1.0, 2.0), 50.0),  # m/s²
    "field_B": ((0.2, -0.2, 0.2), 1.0),  # Gauss
    "pressure_pa": ((120.0,), 50_000.0),  # 10 m
    "p_WB": ((1.0, -0.7, 0.5), 100.0),  # m
    "v_WB": ((0.3, -0.2, 0.2), 20.0),  # m/s
    "w_WB_B": ((0.5, -0.3, 0.2), 10.0),  # rad/s
    "distance": ((1.0,), 50.0),  # m
    "q_arm": ((0.3, 0.3, 0.3, 0.3), math.pi),  # rad
    "angles": ((0.3, 0.3, 0.3, 0.3), math.pi),
    "qd_arm": ((0.0, 0.0, 0.0, 0.0), 20.0),  # rad/s
}
_TURN: Final = (0.1, -0.1, 0.2)  # rad, of a wrong attitude
# Of each unit and field: the deviation of white noise on top of its own that is usual.
_NOISE: Final[dict[str, dict[str, float]]] = {
    "gyro": {"gyro_B": 0.05},
    "accel": {"accel_B": 0.5},
    "mag": {"field_B": 0.02},
    "baro": {"pressure_pa": 12.0},
    "gps": {"p_WB": 0.3, "v_WB": 0.1},
    "vio": {"p_WB": 0.001},
    "attitude": {"q_WB": 0.01},
    "distance": {"distance": 0.1},
    "encoder": {"q_arm": 0.01, "angles": 0.01, "qd_arm": 0.1},
}
_FROZEN: Final = 0.01  # of it, on what is frozen
_DRIFT: Final = 0.1  # 1/s, of what a wrong reading is off
_FRAME_RATE: Final = math.radians(1.0)  # rad/s, of a frame that turns or tilts
_WINDOW_US: Final = 100_000  # in which an intermittent unit is there or not


class Windows:
    """When a unit that fails now and then is silent: in a share of windows of 0.1 s."""

    def __init__(self, share: float, random: np.random.Generator) -> None:
        self._share = share
        self._random = random
        self._window = -1
        self._silent = False

    def silent(self, t_us: int) -> bool:
        """Whether it is silent at ``t_us`` [us]; times must not go back."""
        window = t_us // _WINDOW_US
        if window != self._window:
            self._window = window
            self._silent = bool(self._random.random() < self._share)
        return self._silent


class SignalFault(Generic[M]):
    """One fault of one sensor; it is asked only while it lasts, so it leaves nothing behind."""

    def __init__(self, fault: Fault, random: np.random.Generator) -> None:
        self.fault = fault
        self._random = random
        self._kept: M | None = None  # the first reading since it began
        self._next_us = -math.inf
        self._first_us: int | None = None  # of the readings that are spoilt
        self._under_way: deque[tuple[int, M]] = deque()
        self._windows = Windows(fault.share, random)
        # Of each field, how far it has wandered, and when [s].
        self._wandered: dict[str, tuple[float, list[float]]] = {}

    def read(self, t_us: int, reading: M) -> M | None:
        """What is said now of a ``reading`` at ``t_us`` [us]; None: nothing, or not yet."""
        fault = self.fault
        if fault.kind == "off":
            return None
        if fault.kind == "intermittent":
            return None if self._windows.silent(t_us) else reading
        if fault.kind in ("stuck", "frozen"):
            if self._kept is None:
                self._kept = reading
            kept = self._kept
            if fault.kind == "frozen":
                names = self._names(reading)
                kept = _replaced(kept, {n: self._noisy(n, getattr(kept, n)) for n in names})
            return self.merged(reading, kept)
        if fault.kind == "slow":
            if t_us < self._next_us:
                return None
            self._next_us = t_us + 1e6 / fault.rate_hz
            return reading
        if fault.kind == "delayed":
            self._under_way.append((t_us + round(1000.0 * fault.delay_ms), reading))
            return None
        if self._first_us is None:
            self._first_us = t_us
        since_s = 1e-6 * (t_us - self._first_us)
        names = self._names(reading)
        spoilt = {name: self._spoilt(name, getattr(reading, name), since_s) for name in names}
        return self.merged(reading, _replaced(reading, spoilt))

    def due(self, t_us: int) -> list[M]:
        """Delayed readings that arrive at ``t_us`` [us], the oldest first."""
        arrived = []
        while self._under_way and self._under_way[0][0] <= t_us:
            arrived.append(self._under_way.popleft()[1])
        return arrived

    def merged(self, reading: M, source: M) -> M:
        """``reading`` with what the fault hits from ``source``."""
        return _replaced(
            reading,
            {
                name: self._hit(getattr(reading, name), getattr(source, name))
                for name in self._names(reading)
            },
        )

    def silenced(self, reading: M) -> M:
        """``reading`` without what the fault hits: not a number."""
        nothing = {}
        for name in self._names(reading):
            value = getattr(reading, name)
            nothing[name] = (math.nan,) * len(value) if isinstance(value, tuple) else math.nan
        return self.merged(reading, _replaced(reading, nothing))

    def _names(self, reading: M) -> list[str]:
        return [name for name in FIELDS[self.fault.unit] if hasattr(reading, name)]

    def _hit(self, healthy: Any, failed: Any) -> Any:
        if self.fault.axis and not (isinstance(healthy, tuple) and len(healthy) == 3):
            return healthy
        if self.fault.number == 0 == self.fault.axis or not isinstance(healthy, tuple):
            return failed
        pairs = enumerate(zip(healthy, failed, strict=True))
        return tuple(bad if self.fault.hits(k) else good for k, (good, bad) in pairs)

    def _spoilt(self, name: str, value: Any, since_s: float) -> Any:
        """A reading that began to fail ``since_s`` [s] ago."""
        kind, size = self.fault.kind, self.fault.size
        if kind == "garbage":
            return self._garbage(name, value)
        if kind == "noisy":
            return self._noisy(name, value)
        if kind == "wandering":
            return self._off(name, value, self._wander(name, value, since_s))
        if kind in ("turning", "tilting"):
            down, angle = kind == "turning", size * _FRAME_RATE * since_s
            if name == "q_WB":
                return turned(value, tuple(angle * one for one in _row(value, down=down)))
            return value if name == "w_WB_B" else _about(value, angle, down=down)
        if kind == "drifting":
            if name in ("q_WB", "w_WB_B"):
                return value
            # The velocity is that of the drift, which so contradicts itself in nothing.
            offsets = _OFFSETS["p_WB" if name == "v_WB" else name][0]
            size *= _DRIFT * (1.0 if name == "v_WB" else since_s)
        elif name == "q_WB":
            return turned(value, tuple(size * angle for angle in _TURN))
        else:
            offsets = _OFFSETS[name][0]
        if not isinstance(value, tuple):
            return value + size * offsets[0]
        return tuple(v + size * off for v, off in zip(value, offsets, strict=False))

    def _noisy(self, name: str, value: Any) -> Any:
        return self._off(name, value, self._drawn(name, value))

    def _drawn(self, name: str, value: Any) -> list[float]:
        """What white noise adds to each number of a field; of an attitude, about each axis."""
        deviation = abs(self.fault.size) * _NOISE[self.fault.unit].get(name, 0.0)
        if self.fault.kind == "frozen":
            deviation = _FROZEN * (deviation or _NOISE["attitude"].get(name, 0.0))
        count = 3 if name == "q_WB" else len(value) if isinstance(value, tuple) else 1
        return list(normal(self._random, deviation, count)) if deviation else [0.0] * count

    def _wander(self, name: str, value: Any, since_s: float) -> list[float]:
        """How far a field is off of noise that forgets itself slowly, ``since_s`` [s]."""
        drawn = self._drawn(name, value)
        at, before = self._wandered.get(name, (since_s, drawn))
        keeps = math.exp((at - since_s) / self.fault.forgets_s)
        new = math.sqrt(1.0 - keeps * keeps)
        off = [keeps * old + new * more for old, more in zip(before, drawn, strict=True)]
        self._wandered[name] = since_s, off
        return off

    @staticmethod
    def _off(name: str, value: Any, off: list[float]) -> Any:
        """A reading that is ``off`` in each of its numbers."""
        if not any(off):
            return value
        if name == "q_WB":
            return turned(value, tuple(off))
        if not isinstance(value, tuple):
            return value + off[0]
        return tuple(v + more for v, more in zip(value, off, strict=True))

    def _garbage(self, name: str, value: Any) -> Any:
        if name == "q_WB":
            return _attitude(self._random)
        most = _OFFSETS[name][1]
        if not isinstance(value, tuple):
            return abs(float(self._random.uniform(-most, most)))
        return tuple(float(draw) for draw in self._random.uniform(-most, most, len(value)))


def _replaced(reading: M, values: dict[str, Any]) -> M:
    changed: M = reading._replace(**values)  # type: ignore[attr-defined]
    return changed


def _attitude(random: np.random.Generator) -> V4:
    """Any attitude."""
    q = random.standard_normal(4)
    w, x, y, z = (q / math.sqrt(float(q @ q))).tolist()
    return (w, x, y, z)


def _row(q: V4, *, down: bool) -> V3:
    """The axis of W that points north, or ``down``, as B has it: of attitude ``q``."""
    w, x, y, z = q
    if down:
        return (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y))
    return (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y))


def _about(v: V3, angle: float, *, down: bool) -> V3:
    """A vector turned by ``angle`` [rad] about the axis of W that points north, or ``down``."""
    (x, y, z), c, s = v, math.cos(angle), math.sin(angle)
    return (c * x - s * y, s * x + c * y, z) if down else (x, c * y - s * z, s * y + c * z)
