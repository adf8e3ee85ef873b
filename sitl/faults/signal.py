"""What becomes of a sensor's readings while it fails."""

from __future__ import annotations

import math
from collections import deque
from typing import Any, Final, Generic, TypeVar

import numpy as np

from sitl.faults.keys import Fault
from sitl.sensors.exact import V4, turned

M = TypeVar("M")  # a NamedTuple of readings

# Of each unit the fields of a reading that are its own.
FIELDS: Final[dict[str, tuple[str, ...]]] = {
    "gyro": ("gyro_B",),
    "accel": ("accel_B",),
    "mag": ("field_B",),
    "baro": ("pressure_pa",),
    "gps": ("p_WB", "v_WB"),
    "vio": ("p_WB", "v_WB", "q_WB", "w_WB_B"),
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
        self._under_way: deque[tuple[int, M]] = deque()
        self._windows = Windows(fault.share, random)

    def read(self, t_us: int, reading: M) -> M | None:
        """What is said now of a ``reading`` at ``t_us`` [us]; None: nothing, or not yet."""
        fault = self.fault
        if fault.kind == "off":
            return None
        if fault.kind == "intermittent":
            return None if self._windows.silent(t_us) else reading
        if fault.kind == "stuck":
            if self._kept is None:
                self._kept = reading
            return self.merged(reading, self._kept)
        if fault.kind == "slow":
            if t_us < self._next_us:
                return None
            self._next_us = t_us + 1e6 / fault.rate_hz
            return reading
        if fault.kind == "delayed":
            self._under_way.append((t_us + round(1000.0 * fault.delay_ms), reading))
            return None
        spoilt = {name: self._spoilt(name, getattr(reading, name)) for name in self._names(reading)}
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
        if self.fault.number == 0 or not isinstance(healthy, tuple):
            return failed
        pairs = enumerate(zip(healthy, failed, strict=True))
        return tuple(bad if self.fault.hits(k) else good for k, (good, bad) in pairs)

    def _spoilt(self, name: str, value: Any) -> Any:
        if self.fault.kind == "garbage":
            return self._garbage(name, value)
        size = self.fault.size
        if name == "q_WB":
            return turned(value, tuple(size * angle for angle in _TURN))
        offsets, _ = _OFFSETS[name]
        if not isinstance(value, tuple):
            return value + size * offsets[0]
        return tuple(v + size * off for v, off in zip(value, offsets, strict=False))

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
