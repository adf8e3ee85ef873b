"""When a sensor measures, and what its messages go through until they arrive."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque
from typing import Any, ClassVar, NamedTuple, Protocol, Self

import numpy as np

from sitl.earth import Place
from sitl.sensors.exact import SensorReadings, Thrusts
from sitl.sensors.keys import Timing
from vehicles.description import Vehicle

_MAX_DEVIATIONS = 8.0  # of a jitter: one draw in 1e15 is below minus that


class Measurement(Protocol):
    """What a sensor says; each kind has its own, a NamedTuple."""

    @property
    def t_us(self) -> int:
        """The stamp of the measurement [µs]."""

    def _replace(self, *, t_us: int = ...) -> Self: ...


class Aboard(NamedTuple):
    """What a sensor may know of where it is."""

    vehicle: Vehicle
    hover_thrust: float  # N, of one rotor
    origin: Place  # of the local frame


class SensorModel(ABC):
    """One sensor of one flight; each kind has a file in this folder."""

    kind: ClassVar[type[Timing]]  # of its keys
    says: ClassVar[type[Measurement]]

    @abstractmethod
    def __init__(self, keys: Any, random: np.random.Generator) -> None: ...

    @classmethod
    def aboard(cls, keys: Any, random: np.random.Generator, _: Aboard) -> SensorModel:
        """The sensor with these ``keys`` on a vehicle."""
        return cls(keys, random)

    @abstractmethod
    def measure(
        self, exact: SensorReadings, thrust: Thrusts, stamp_us: int, outlier: bool
    ) -> Measurement | None:
        """What it says about the vehicle now, or an outlier; None where it cannot measure.

        The rotors give ``thrust`` [N].
        """


class Channel:
    """Rate, latency, jitter, dropouts and gaps of one sensor.

    A sensor measures in the first step of all, and then in the first step at or after each tick of
    its own clock, whose phase is drawn. A message arrives with the first step at or after its time;
    messages do not overtake each other.
    """

    def __init__(
        self, sensor: SensorModel, keys: Timing, random: np.random.Generator, start_us: int
    ) -> None:
        """Begin at the stamp ``start_us``."""
        self._sensor = sensor
        self._random = random
        self._period_us = 1e6 / keys.rate_hz
        self._due_us = start_us - float(random.uniform()) * self._period_us
        self.next_us = self._due_us  # nothing happens before this stamp
        self._stamp_error_us = round(1e3 * keys.stamp_error_ms)
        self._latency_us = 1e3 * keys.latency_ms
        self._jitter_us = 1e3 * keys.jitter_ms
        self._dropout_share = keys.dropout_share
        self._outlier_share = keys.outlier_share
        self._gap_us = 1e3 * keys.gap_ms
        self._interval_us = 1e6 * keys.gap_every_s
        # Nothing is drawn for each message, so that it need not be asked about each.
        self._steady = not (
            keys.outlier_share or keys.dropout_share or keys.gap_ms or keys.jitter_ms
        )
        self._prompt = self._steady and not self._latency_us  # nothing is ever under way
        # What is measured in a step arrives in a later one.
        self.late = self._latency_us - _MAX_DEVIATIONS * self._jitter_us >= 1.0
        self._start_us = start_us
        self._interval = -1  # of which the gap is known
        self._gap_begins_us = math.inf
        self._newest_us = -math.inf  # arrival of the newest message
        self._under_way: deque[tuple[float, Measurement]] = deque()

    def step(self, exact: SensorReadings, thrust: Thrusts, out: list[Measurement]) -> None:
        """Measure if it is time, and append what arrives in this step, the oldest first.

        The rotors give ``thrust`` [N].
        """
        if self._prompt:
            if exact.t_us >= self._due_us:
                said = self._sensed(exact, thrust, outlier=False)
                if said is not None:
                    out.append(said)
                self.next_us = self._due_us
        else:
            self.measure(exact, thrust)
            self.arrive(exact.t_us, out)

    def arrive(self, t_us: int, out: list[Measurement]) -> None:
        """Append what arrives in the step of ``t_us``, the oldest first."""
        under_way = self._under_way
        while under_way and under_way[0][0] <= t_us:
            out.append(under_way.popleft()[1])
        self.next_us = min(under_way[0][0], self._due_us) if under_way else self._due_us

    def measure(self, exact: SensorReadings, thrust: Thrusts) -> None:
        """Measure if it is time, and send; the rotors give ``thrust`` [N]."""
        t_us = exact.t_us
        if t_us < self._due_us:
            return
        outlier = self._outlier_share > 0.0 and self._random.random() < self._outlier_share
        said = self._sensed(exact, thrust, outlier)
        if said is not None and (self._steady or not self._lost(t_us)):
            arrives_us = t_us + self._latency_us
            if self._jitter_us > 0.0:
                arrives_us += self._jitter_us * float(self._random.standard_normal())
                arrives_us = max(arrives_us, t_us, self._newest_us)
            self._newest_us = arrives_us
            self._under_way.append((arrives_us, said))
        self.next_us = min(self._under_way[0][0], self._due_us) if self._under_way else self._due_us

    def _sensed(self, exact: SensorReadings, thrust: Thrusts, outlier: bool) -> Measurement | None:
        """What the sensor says at a tick of its clock, of which the next one is then due."""
        t_us = exact.t_us
        self._due_us += self._period_us
        if t_us >= self._due_us:  # faster than the steps
            missed = math.floor((t_us - self._due_us) / self._period_us)
            self._due_us += (missed + 1.0) * self._period_us
        return self._sensor.measure(exact, thrust, t_us + self._stamp_error_us, outlier)

    def _lost(self, t_us: int) -> bool:
        """Whether the message of ``t_us`` does not arrive."""
        if self._dropout_share > 0.0 and self._random.random() < self._dropout_share:
            return True
        return self._gap_us > 0.0 and self._silent(t_us)

    def _silent(self, t_us: int) -> bool:
        """Whether ``t_us`` is in a gap; each interval has one, at a place of its own."""
        interval = math.floor((t_us - self._start_us) / self._interval_us)
        while self._interval < interval:
            self._interval += 1
            begins = self._random.random() * max(self._interval_us - self._gap_us, 0.0)
            self._gap_begins_us = self._start_us + self._interval * self._interval_us + begins
        return self._gap_begins_us <= t_us < self._gap_begins_us + self._gap_us
