"""A sensor that fails in a flight in process: what stands between it and the flight software.

Faults of scenarios (``sitl.faults``) begin when a message arrives and last. Here they go by the
time that was measured, which decides which readings the filter has, and some are a single message
or a wrong time stamp, which no scenario can ask for.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias

from fsw.autopilot.estimation.faults.sensor_fault import SensorFault, sentence
from fsw.autopilot.measurements import ImuSample, JointSample, PoseSample, Sample, Sensor
from fsw.autopilot.signals import SensorFrame, Vec4
from sitl.simulation import START_US

FaultKind: TypeAlias = Literal["silent", "frozen", "over", "fast", "ahead"]

_AFTER_S = 1.0  # in which a fault that is over is still reported
_OVER_RAD = math.radians(75.0)
_FAR = 1e6  # m, or m/s where a velocity is measured
_AHEAD_S = 10.0
# As what the flight software may find it: a reading that is no number where it ought to be silent.
_FOUND: dict[FaultKind, tuple[SensorFault, ...]] = {
    "silent": (SensorFault.STALE, SensorFault.NOT_FINITE, SensorFault.IMPLAUSIBLE),
    "frozen": (SensorFault.STUCK,),
    "over": (SensorFault.JUMP, SensorFault.IMPLAUSIBLE),
    "fast": (SensorFault.JUMP, SensorFault.IMPLAUSIBLE),
    "ahead": (SensorFault.FUTURE,),
}
_SAMPLES: dict[Sensor, type] = {
    Sensor.POSE: PoseSample,
    Sensor.IMU: ImuSample,
    Sensor.ENCODERS: JointSample,
}
_FIELDS: dict[Sensor, tuple[str, ...]] = {
    Sensor.POSE: ("p_WB", "v_WB", "q_WB"),
    Sensor.IMU: ("gyro_B", "accel_B"),
    Sensor.ENCODERS: ("q_arm", "qd_arm"),
}


@dataclass(frozen=True, slots=True)
class Fault:
    """One failure of one sensor in a flight."""

    sensor: Sensor
    kind: FaultKind
    seconds: float  # how long; 0: a single message
    # Since the start of the simulation; the seed chooses one, so that a cell has all of them.
    begins_s: tuple[float, ...]

    def start_s(self, seed: int) -> float:
        """When it begins in the flight of a seed [s]."""
        return self.begins_s[seed % len(self.begins_s)]

    def reported(self, texts: list[tuple[float, str]], seed: int) -> str:
        """The first text that names sensor and fault, out of those with their times [s].

        Empty if there is none. The flight software does not repeat a report while the same fault
        comes back, so one of the suite's own outliers, before, counts as well.
        """
        first = self.start_s(seed)
        last = first + self.seconds + _AFTER_S
        names = [sentence(self.sensor, fault) for fault in _FOUND[self.kind]]
        during = [text for at, text in texts if first <= at <= last]
        before = [text for at, text in texts if at < first]
        found = [text for text in (*during, *before) if any(name in text for name in names)]
        return found[0] if found else ""


class FaultySensors:
    """Sensors of one flight with a fault; without one, everything passes."""

    def __init__(self, fault: Fault | None, seed: int) -> None:
        self._fault = fault
        self._first_s = math.inf if fault is None else fault.start_s(seed)
        self._done = False  # what is one message only
        self._held: Any = None

    def frame(self, frame: SensorFrame) -> SensorFrame:
        """What an exact frame becomes."""
        fault = self._fault
        if fault is None or not self._strikes(1e-6 * (frame.t_us - START_US)):
            return frame
        names = _FIELDS[fault.sensor]
        if fault.kind == "silent":
            nothing = {name: (math.nan,) * len(getattr(frame, name)) for name in names}
            return replace(frame, **nothing)  # type: ignore[arg-type]
        if fault.kind == "fast":
            return replace(frame, v_WB=(_FAR, 0.0, 0.0))
        raise ValueError(f"{fault.kind}: exact states are believed where they are in range")

    def samples(self, samples: tuple[Sample, ...]) -> tuple[Sample, ...]:
        """What the samples of a suite become."""
        if self._fault is None:
            return samples
        kind = _SAMPLES[self._fault.sensor]
        out: list[Sample] = []
        for one in samples:
            if type(one) is kind and self._strikes(one.time - 1e-6 * START_US):
                out += self._spoiled(one)
            else:
                out.append(one)
        return tuple(out)

    def _strikes(self, time_s: float) -> bool:
        fault = self._fault
        assert fault is not None
        if time_s < self._first_s - 1e-9 or self._done:
            return False
        if fault.seconds == 0.0:
            self._done = True
            return True
        return time_s < self._first_s + fault.seconds - 1e-9

    def _spoiled(self, sample: Any) -> list[Sample]:
        fault = self._fault
        assert fault is not None
        if fault.kind == "silent":
            return []
        if fault.kind == "frozen":
            self._held = self._held or sample
            return [replace(self._held, time=sample.time)]
        changes: dict[FaultKind, Callable[[], Any]] = {
            "over": lambda: replace(sample, attitude=_rolled(sample.attitude)),
            # Cameras measure no velocity: a place that would need one.
            "fast": lambda: replace(sample, position=(_FAR, 0.0, 0.0)),
            "ahead": lambda: replace(sample, time=sample.time + _AHEAD_S),
        }
        return [changes[fault.kind]()]


def _rolled(q: Vec4) -> Vec4:
    """An attitude [1] rolled by 75 degrees more."""
    (w, x, y, z), c, s = q, math.cos(0.5 * _OVER_RAD), math.sin(0.5 * _OVER_RAD)
    return (c * w - s * x, c * x + s * w, c * y + s * z, c * z - s * y)
