"""How often sensors are heard: one that comes less often than it did is told.

A sensor that is silent is another matter. What is usual is learned in the first second, and
follows slowly: a sensor may be set to another rate. A lower rate is told, and is the usual one some
ten seconds later.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from fsw.autopilot.estimation.faults.sensor_fault import Health
from fsw.autopilot.measurements import Sensor

_LOOKS: Final = 10  # of 0.1 s, over which samples are counted
_SELDOM: Final = 0.7  # of what is usual; markers that are hidden once leave 0.8
_AGAIN: Final = 0.85
_FOLLOWS: Final = 0.02  # share of the newest count in what is usual
_MIN_USUAL: Final = 4.0  # samples in so many looks; of fewer one is missing now and then
_SILENT: Final = 0.15  # s


class SampleRate(NamedTuple):
    """How often one sensor is heard."""

    sensor: Sensor
    seen: int = 0  # samples, at the last look
    counts: tuple[int, ...] = ()  # of the last looks
    usual: float = 0.0  # samples in so many looks; 0: not known yet
    seldom: bool = False


def looked(
    sample_rates: tuple[SampleRate, ...], health: tuple[Health, ...], now: float
) -> tuple[tuple[SampleRate, ...], tuple[Sensor, ...]]:
    """Paces after a look at ``now`` [s] at what is known of each sensor.

    Beside them those that have begun to come too seldom.
    """
    known = {pace.sensor: pace for pace in sample_rates}
    after, told = [], []
    for one in health:
        pace = _after(known.get(one.sensor, SampleRate(one.sensor)), one, now)
        if pace.seldom and not (one.sensor in known and known[one.sensor].seldom):
            told.append(one.sensor)
        after.append(pace)
    return tuple(after), tuple(told)


def _after(pace: SampleRate, health: Health, now: float) -> SampleRate:
    counts = (*pace.counts, health.seen - pace.seen)[-_LOOKS:]
    usual, seldom, total = pace.usual, pace.seldom, sum(counts)
    silent = now - health.came > _SILENT
    if len(counts) == _LOOKS:
        if not usual:
            usual = float(total)
        elif total > _SELDOM * usual or (seldom and not silent):
            usual += _FOLLOWS * (total - usual)
            seldom = seldom and total < _AGAIN * usual
        elif not silent and usual >= _MIN_USUAL:
            seldom = True
    return SampleRate(pace.sensor, health.seen, counts, usual, seldom)
