"""What is known of each sensor, and what is wrong with a sample before the filter looks at it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, NamedTuple

from fsw.autopilot.estimation.faults.sensor_fault import Sensor, SensorFault
from fsw.autopilot.estimation.imu import TIME_TOLERANCE
from fsw.autopilot.estimation.tuning import EstimatorTuning
from fsw.autopilot.geometry.vectors import norm
from fsw.autopilot.measurements import (
    GnssSample,
    MagneticSample,
    PoseSample,
    PressureSample,
    RangeSample,
)

Aiding = PoseSample | GnssSample | PressureSample | MagneticSample | RangeSample
SENSOR_OF: Final[dict[type, Sensor]] = {
    PoseSample: Sensor.POSE,
    GnssSample: Sensor.GNSS,
    PressureSample: Sensor.BAROMETER,
    MagneticSample: Sensor.MAGNETOMETER,
    RangeSample: Sensor.RANGEFINDER,
}
# How many readings in a row may be equal to the last bit. Of poses and satellites none: their noise
# is far above their resolution. Barometers and rangefinders do repeat themselves.
_REPEATS: Final[dict[type, int]] = {
    PoseSample: 0,
    GnssSample: 0,
    MagneticSample: 10,
    PressureSample: 40,
    RangeSample: 40,
}
# How many numbers of a message, of those that are not 0, repeat themselves where an axis is stuck
# and the others are not. A fix has coarse places: by chance one of them says the same for a second.
_OF_AN_AXIS: Final[dict[type, int]] = {PoseSample: 1, GnssSample: 2}
_IN_A_ROW: Final = 5
_SHOWN: Final = 1.0  # s, for which a fault counts after it was seen
_QUIET: Final = 10.0  # s without a fault, until the same one is told again at once
_LASTS: Final = 1.0  # s, for which one that came back sooner must last; gaps are no longer
_LONGEST_APART: Final = 0.25  # s; farther apart, readings were lost
_FARTHEST_RANGE: Final = 200.0  # m
_STRONGEST_FIELD: Final = 5.0  # Gauss, ten times the Earth's


class FaultSeen(NamedTuple):
    """A fault of one kind, and the run of such faults that it belongs to; times are in seconds."""

    fault: SensorFault
    at: float
    before: float  # the one before it in the run; the first: the same
    since: float  # the first of the run
    rested: float  # from the run before to this one; infinite: there was none


class Health(NamedTuple):
    """What is known of one sensor; times are of the tick's clock."""

    sensor: Sensor
    time: float = -math.inf  # s, newest time stamp of a sample
    came: float = -1.0  # s, when that came; negative: never
    apart: float = 0.0  # s, of its time stamp from the one before
    seen: int = 0  # samples so far
    numbers: tuple[float, ...] = ()  # of that sample
    repeats: tuple[int, ...] = ()  # how often in a row each of them was the same
    fused: tuple[float, ...] = ()  # s, when each part of it was fused last
    ratio: tuple[float, ...] = ()  # chi-square over gate, of each part
    innovation: tuple[float, ...] = ()  # of each part: m, m/s, rad
    fault: SensorFault = SensorFault.NONE  # the last one
    fault_at: float = -math.inf  # s
    known: tuple[FaultSeen, ...] = ()  # of every kind of fault so far, the last one

    def fault_now(self, came: float, now: float, stale: float) -> SensorFault:
        """What is wrong at ``now`` [s] with a sensor that ``came`` [s] last.

        Silence counts after ``stale`` [s].
        """
        if now - came > stale:
            return SensorFault.STALE
        return self.fault if now - self.fault_at <= _SHOWN else SensorFault.NONE

    def is_news(self) -> bool:
        """Whether the last fault, when it was seen, was one to be told.

        The first one after ten seconds without is, and so is one that came back before that and
        then lasts.
        """
        for one in self.known:
            if one.fault is self.fault:
                if one.rested > _QUIET:
                    return one.at == one.since
                return one.before - one.since < _LASTS <= one.at - one.since
        return True

    def with_fused(
        self, fused: tuple[float, ...], ratio: tuple[float, ...], innovation: tuple[float, ...]
    ) -> Health:
        """The same sensor after a sample, of which each part was ``fused`` [s] last so."""
        return self._replace(fused=fused, ratio=ratio, innovation=innovation)

    def with_fault(self, fault: SensorFault, now: float) -> Health:
        """The same sensor, with a ``fault`` that was seen at ``now`` [s]."""
        others, seen = [], FaultSeen(fault, now, now, now, math.inf)
        for one in self.known:
            if one.fault is not fault:
                others.append(one)
            elif now == one.at:
                seen = one
            elif now - one.at <= _LASTS:
                seen = one._replace(at=now, before=one.at)
            else:
                seen = FaultSeen(fault, now, now, now, now - one.at)
        return self._replace(fault=fault, fault_at=now, known=(*others, seen))


def arrived(
    health: Health,
    sample: Aiding,
    now: float,
    tuning: EstimatorTuning,
    still: Callable[[], bool],
) -> tuple[Health, SensorFault]:
    """A sensor's health after a ``sample`` that came at ``now`` [s], and what is wrong with it.

    Where the IMU too repeats itself (``still`` says), a reading that does is no fault: all stands.
    """
    if not sample.time <= now + TIME_TOLERANCE:
        # Its time stamp is not kept: all that follow would seem to be old.
        return health.with_fault(SensorFault.FUTURE, now), SensorFault.FUTURE
    if sample.time <= health.time:
        return health.with_fault(SensorFault.REPEATED, now), SensorFault.REPEATED
    numbers = numbers_of(sample)
    repeats = _repeats(health, numbers)
    if any(repeats) and still():
        repeats = (0,) * len(numbers)
    if isinstance(sample, GnssSample) and not sample.has_fix:
        fault = SensorFault.NO_FIX
    elif not math.isfinite(sum(numbers)):
        fault = SensorFault.NOT_FINITE
    elif not _plausible(sample, tuning):
        fault = SensorFault.IMPLAUSIBLE
    elif _is_stuck(sample, numbers, repeats):
        fault = SensorFault.STUCK
    else:
        fault = SensorFault.NONE
    apart = min(sample.time - health.time, _LONGEST_APART)
    health = health._replace(
        time=sample.time,
        came=now,
        apart=apart,
        seen=health.seen + 1,
        numbers=numbers,
        repeats=repeats,
    )
    return (health.with_fault(fault, now) if fault else health), fault


def _repeats(health: Health, numbers: tuple[float, ...]) -> tuple[int, ...]:
    """How often in a row each of the ``numbers`` [SI] of a sample has been the same."""
    if not health.numbers:
        return (0,) * len(numbers)
    same = zip(health.repeats, health.numbers, numbers, strict=True)
    return tuple([count + 1 if new == old else 0 for count, old, new in same])


def _is_stuck(sample: Aiding, numbers: tuple[float, ...], repeats: tuple[int, ...]) -> bool:
    """Whether all ``numbers`` [SI] of a sample repeat themselves, or those of an axis do."""
    if min(repeats) > _REPEATS[type(sample)]:
        return True
    needed = _OF_AN_AXIS.get(type(sample))
    of_axis = [k for k, one in zip(repeats, numbers, strict=True) if k >= _IN_A_ROW and one]
    return needed is not None and len(of_axis) >= needed


def is_attitude_stuck(health: Health) -> bool:
    """Whether of the last pose the attitude repeats itself, and the place does not."""
    return health.sensor is Sensor.POSE and not any(health.repeats[:3])


def numbers_of(sample: Aiding) -> tuple[float, ...]:
    """All that a sample measures, without its variance."""
    match sample:
        case PoseSample():
            return sample.position + sample.attitude
        case GnssSample():
            return sample.position + sample.velocity
        case PressureSample():
            return (sample.altitude,)
        case MagneticSample():
            return sample.field
        case RangeSample():
            return (sample.distance,)


def _plausible(sample: Aiding, tuning: EstimatorTuning) -> bool:
    match sample:
        case PoseSample():
            w, x, y, z = sample.attitude
            squared = w * w + x * x + y * y + z * z
            return 0.8 < squared < 1.25 and norm(sample.position) < tuning.place_limit
        case GnssSample():
            slow = norm(sample.velocity) < tuning.speed_limit
            return slow and norm(sample.position) < tuning.place_limit
        case PressureSample():
            return abs(sample.altitude) < 10.0 * tuning.place_limit
        case MagneticSample():
            return 0.0 < norm(sample.field) < _STRONGEST_FIELD
        case RangeSample():
            return 0.0 < sample.distance < _FARTHEST_RANGE
