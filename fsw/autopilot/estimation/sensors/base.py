"""What a sensor that aids the filter is; each has a file beside this one.

The file says all of it: its numbers and their parameters, what it measures and when that is
plausible, how it is fused, what it may be taken for when sensors contradict each other, and what
log and telemetry call it.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from typing import Any, ClassVar, Final, Generic, NamedTuple, TypeVar

from scipy.special import gammainccinv

from fsw.autopilot.estimation.faults.residuals import NO_AID, Aid
from fsw.autopilot.estimation.faults.sensor_fault import Health, SensorFault
from fsw.autopilot.estimation.faults.sources import NOBODY, Source
from fsw.autopilot.estimation.fusion_memory import FusionMemory
from fsw.autopilot.estimation.imu import TIME_TOLERANCE
from fsw.autopilot.measurements import AidingSample, Sensor
from fsw.autopilot.tuning import Row
from fsw.compiled import packed

PLACE_LIMIT: Final = 1000.0  # m from the origin, that a sensor may say
CREEPS: Final = 0.5  # m/s and rad/s, see ``AidingSensor.changes``
_IN_A_ROW: Final = 5
_LONGEST_APART: Final = 0.25  # s; farther apart, readings were lost

S = TypeVar("S", bound=AidingSample)
T = TypeVar("T")  # the sensor's own numbers
Ratios = tuple[float, ...]  # chi-square over gate, of each part


class LogField(NamedTuple):
    """A field of the sensor's topic: one number, or a vector of some size."""

    name: str
    note: str
    size: int = 0
    kind: str = "double"


class LogTopic(NamedTuple):
    """The topic of the flight log with the fields of a sample, in their order after its time."""

    name: str
    meaning: str
    fields: tuple[LogField, ...]


class AidingSensor(ABC, Generic[S, T]):
    """A sensor of one configuration; holds only what never changes in flight."""

    sensor: ClassVar[Sensor]
    sample: ClassVar[type[AidingSample]]
    measures: ClassVar[tuple[str, ...]]  # fields of it that are measured
    at_rest: ClassVar[AidingSample]  # of a vehicle that stands
    parameters: ClassVar[tuple[Row, ...]]  # by the name of the number in ``T``
    # How many readings in a row may be equal to the last bit. Of poses and satellites none: their
    # noise is far above their resolution. Barometers and rangefinders do repeat themselves.
    repeats: ClassVar[int] = 0
    # How many numbers of a message, of those that are not 0, repeat themselves where an axis is
    # stuck and the others are not. A fix has coarse places: by chance one of them says the same for
    # a second.
    of_an_axis: ClassVar[int | None] = None
    source: ClassVar[Source] = NOBODY  # as which it is named, where sensors contradict each other
    noise_scales: ClassVar[slice] = slice(0)  # of its parts, in the filter's record
    gates: ClassVar[tuple[str, ...]] = ("gate",)  # of each part, in ``T``
    # How fast the innovation of each part changes, because the vehicle's motion is not known any
    # better; those of one without agree where they stay.
    changes: ClassVar[tuple[float, ...]] = ()
    # Nobody knows what it measures against until the first reading.
    starts_anywhere: ClassVar[bool] = False
    status_bit: ClassVar[int]  # MAV_SYS_STATUS_SENSOR, there if it is heard
    ratios: ClassVar[tuple[tuple[str, ...], ...]]  # the ``TestRatios`` that each part counts for
    # Name, size (0: one number) and unit of its innovations in the log.
    innovations: ClassVar[tuple[tuple[str, int, str], ...]]
    topic: ClassVar[LogTopic]

    def __init__(self, tuning: T) -> None:
        self.tuning = tuning
        self.law = packed(tuning)

    def numbers(self, sample: S) -> tuple[float, ...]:
        """All that a ``sample`` measures, without its variance."""
        found: list[float] = []
        for name in self.measures:
            value = getattr(sample, name)
            found += value if isinstance(value, tuple) else (value,)
        return tuple(found)

    @abstractmethod
    def is_plausible(self, sample: S) -> bool:
        """Whether a vehicle of this kind can be where, and as, a ``sample`` says."""

    @abstractmethod
    def fuse(self, memory: FusionMemory, sample: S, half: bool) -> Ratios:
        """Fuse a ``sample`` whose time the filter has; of ``half`` a pose the place alone.

        Returns chi-square over gate of each of its parts, above 1 if refused, and infinite where it
        says nothing at present.
        """

    def measured_at(self, memory: FusionMemory, sample: S) -> float:
        """When a ``sample`` was measured [s]: its time stamp, less what that leaves out."""
        return sample.time

    def take(self, memory: FusionMemory, sample: S, time: float, ratio: Ratios) -> FusionMemory:
        """The memory after parts that the gate refused for long, by ``ratio``, are as measured.

        The ``sample`` was at ``time`` [s].
        """
        return memory

    def stated(self, sample: S) -> tuple[tuple[float, ...], ...]:
        """Variances [SI] of each part of a ``sample``, at least those of the floors."""
        return ()

    def rooms(self, sample: S, scales: Sequence[float], apart: float) -> tuple[float, ...]:
        """By how much innovations of each part may differ that are ``apart`` [s].

        Variances are ``scales`` [1] times as large as stated.
        """
        gates = [getattr(self.tuning, name) for name in self.gates]
        parts = zip(gates, self.stated(sample), self.changes, (*scales, 1.0), strict=False)
        return tuple(
            gate * math.sqrt(2.0 * scale * max(variance)) + change * apart
            for gate, variance, change, scale in parts
        ) or (0.0,)

    def deviations(self, memory: FusionMemory, variances: Iterable[Sequence[float]]) -> list[float]:
        """Of the worst axis of each part, with the noise that there lately was [SI]."""
        scales = memory.numbers["noise_scale"][0, self.noise_scales].tolist()
        pairs = zip(variances, scales, strict=True)
        return [math.sqrt(max(variance) * max(scale, 1.0)) for variance, scale in pairs]

    def aid(self, memory: FusionMemory, sample: S) -> Aid:
        """What a measurement says to the law for who is wrong."""
        return NO_AID

    def fault_of(self, sample: S, numbers: tuple[float, ...]) -> SensorFault:
        """What is wrong with a ``sample`` of these ``numbers`` [SI] by itself."""
        if not math.isfinite(sum(numbers)):
            return SensorFault.NOT_FINITE
        return SensorFault.NONE if self.is_plausible(sample) else SensorFault.IMPLAUSIBLE

    def receive(
        self, health: Health, sample: S, now: float, still: Callable[[], bool]
    ) -> tuple[Health, SensorFault]:
        """The sensor's health after a ``sample`` that came at ``now`` [s], and what is wrong.

        Where the IMU too repeats itself (``still`` says), a reading that does is no fault: all
        stands.
        """
        if not sample.time <= now + TIME_TOLERANCE:
            # Its time stamp is not kept: all that follow would seem to be old.
            return health.with_fault(SensorFault.FUTURE, now), SensorFault.FUTURE
        if sample.time <= health.time:
            return health.with_fault(SensorFault.REPEATED, now), SensorFault.REPEATED
        numbers = self.numbers(sample)
        repeats = health.repeats_of(numbers)
        if any(repeats) and still():
            repeats = (0,) * len(numbers)
        fault = self.fault_of(sample, numbers)
        if not fault and self._is_stuck(numbers, repeats):
            fault = SensorFault.STUCK
        health = health._replace(
            time=sample.time,
            came=now,
            apart=min(sample.time - health.time, _LONGEST_APART),
            seen=health.seen + 1,
            numbers=numbers,
            repeats=repeats,
        )
        return (health.with_fault(fault, now) if fault else health), fault

    def _is_stuck(self, numbers: tuple[float, ...], repeats: tuple[int, ...]) -> bool:
        """Whether all ``numbers`` [SI] of a sample repeat themselves, or those of an axis do."""
        if min(repeats) > self.repeats:
            return True
        of_axis = [k for k, one in zip(repeats, numbers, strict=True) if k >= _IN_A_ROW and one]
        return self.of_an_axis is not None and len(of_axis) >= self.of_an_axis


@cache
def chi_square(sigmas: float, readings: int) -> float:
    """Chi-square of so many ``readings`` exceeded as seldom as ``sigmas`` [1] are by one."""
    return 2.0 * float(gammainccinv(0.5 * readings, math.erfc(sigmas / math.sqrt(2.0))))


def attitude_of(x: Any) -> tuple[float, float, float, float]:
    """The attitude [w, x, y, z] of a filter's record."""
    w, i, j, k = x["q"].tolist()
    return w, i, j, k
