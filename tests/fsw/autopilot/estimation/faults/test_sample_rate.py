"""A sensor that comes less often than it did is told, once."""

from __future__ import annotations

from collections.abc import Callable

from fsw.autopilot.estimation.faults.sample_rate import SampleRate, looked
from fsw.autopilot.estimation.faults.sensor_fault import Health
from fsw.autopilot.measurements import Sensor


def told(samples: Callable[[int], int], looks: int) -> list[int]:
    """Looks, of 0.1 s, at which a sensor is told that brings ``samples`` before each."""
    sample_rates: tuple[SampleRate, ...] = ()
    seen, came, found = 0, 0.0, []
    for k in range(looks):
        seen += samples(k)
        came = 0.1 * k if samples(k) else came
        sample_rates, seldom = looked(
            sample_rates, (Health(Sensor.GNSS, came=came, seen=seen),), 0.1 * k
        )
        found += [k] if seldom else []
    return found


def test_half_as_many_samples_are_told_within_a_second() -> None:
    (at,) = told(lambda k: 12 if k < 30 else 6, 80)
    assert 30 < at < 40


def test_every_other_window_is_told_too() -> None:
    (at,) = told(lambda k: 12 if k < 30 or k % 2 else 0, 80)
    assert 30 < at <= 40


def test_jitter_one_gap_and_silence_are_not() -> None:
    assert told(lambda k: 12 + k % 3, 80) == []
    assert told(lambda k: 0 if k in (30, 31) else 12, 80) == []
    assert told(lambda k: 12 if k < 30 else 0, 80) == [], "silence is another matter"


def test_a_lower_rate_is_usual_some_seconds_after_it_has_been_told() -> None:
    """12, then 6 and 3 samples in each look: each is told once, and each was usual before."""
    first, second = told(lambda k: 12 if k < 30 else 6 if k < 180 else 3, 400)
    assert 30 < first < 40
    assert 180 < second < 190


def test_of_few_samples_one_less_is_not_told() -> None:
    """Three in a second, and two for a while."""
    assert told(lambda k: k % 10 in ((0, 3, 6) if k < 30 else (0, 5)), 80) == []


def test_another_rate_is_usual_after_a_while_and_then_told_again() -> None:
    assert len(told(lambda k: 12 if k % 40 < 20 else 6, 80)) == 2
