"""Sensors, what is known of each, and what can be wrong with what it says."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Final, NamedTuple

from fsw.autopilot.measurements import Sensor

_SHOWN: Final = 1.0  # s, for which a fault counts after it was seen
_QUIET: Final = 10.0  # s without a fault, until the same one is told again at once
_LASTS: Final = 1.0  # s, for which one that came back sooner must last; gaps are no longer


class SensorFault(IntEnum):
    """Why a reading was not used."""

    NONE = 0
    NOT_FINITE = 1
    IMPLAUSIBLE = 2
    FUTURE = 3
    REPEATED = 4
    TOO_OLD = 5
    STUCK = 6
    JUMP = 7
    STALE = 8
    RATE_TOO_LOW = 9
    DISAGREES = 10
    NO_FIX = 11
    NOISY = 12


_WORDS = {
    SensorFault.NONE: "in use",
    SensorFault.NOT_FINITE: "not finite",
    SensorFault.IMPLAUSIBLE: "implausible",
    SensorFault.FUTURE: "time stamp in the future",
    SensorFault.REPEATED: "time stamp repeated",
    SensorFault.TOO_OLD: "too late",
    SensorFault.STUCK: "stuck",
    SensorFault.JUMP: "jump rejected",
    SensorFault.STALE: "silent",
    SensorFault.RATE_TOO_LOW: "rate too low",
    SensorFault.DISAGREES: "inconsistent with the other sensors",
    SensorFault.NO_FIX: "no fix",
    SensorFault.NOISY: "noisier than stated",
}


def fault_name(fault: SensorFault) -> str:
    """What telemetry and log call a fault; empty for none."""
    return "" if fault is SensorFault.NONE else fault.name.lower().replace("_", " ")


def sentence(sensor: Sensor, fault: SensorFault) -> str:
    """What the operator reads."""
    return f"{sensor.value} {_WORDS[fault]}"


class FaultSeen(NamedTuple):
    """A fault of one kind, and the run of such faults that it belongs to; times are in seconds."""

    fault: SensorFault
    at: float
    before: float  # the one before it in the run; minus infinity: it is the first
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

    def is_news(self, lasts: float = 0.0) -> bool:
        """Whether the last fault, when it was seen, was one to be told.

        The first one after ten seconds without is, once it ``lasts`` [s], and so is one that came
        back before that and then lasts.
        """
        for one in self.known:
            if one.fault is self.fault:
                lasts = lasts if one.rested > _QUIET else _LASTS
                return one.before - one.since < lasts <= one.at - one.since
        return True

    def with_fused(
        self, fused: tuple[float, ...], ratio: tuple[float, ...], innovation: tuple[float, ...]
    ) -> Health:
        """The same sensor after a sample, of which each part was ``fused`` [s] last so."""
        return self._replace(fused=fused, ratio=ratio, innovation=innovation)

    def with_fault(self, fault: SensorFault, now: float) -> Health:
        """The same sensor, with a ``fault`` that was seen at ``now`` [s]."""
        others, seen = [], FaultSeen(fault, now, -math.inf, now, math.inf)
        for one in self.known:
            if one.fault is not fault:
                others.append(one)
            elif now == one.at:
                seen = one
            elif now - one.at <= _LASTS:
                seen = one._replace(at=now, before=one.at)
            else:
                seen = FaultSeen(fault, now, -math.inf, now, now - one.at)
        return self._replace(fault=fault, fault_at=now, known=(*others, seen))

    def repeats_of(self, numbers: tuple[float, ...]) -> tuple[int, ...]:
        """How often in a row each of the ``numbers`` [SI] of a sample has been the same."""
        if not self.numbers:
            return (0,) * len(numbers)
        same = zip(self.repeats, self.numbers, numbers, strict=True)
        return tuple([count + 1 if new == old else 0 for count, old, new in same])
