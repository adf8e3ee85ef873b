"""Percentiles within two percent, in bounded memory."""

from __future__ import annotations

import random

import pytest

from fsw.runtime.timing import GroupTimer, Histogram


def test_percentiles_are_right_to_two_percent() -> None:
    chance = random.Random(1)
    durations = [chance.lognormvariate(5.0, 1.0) for _ in range(20_000)]
    histogram = Histogram()
    for duration in durations:
        histogram.add(duration)
    durations.sort()
    for share in (0.5, 0.9, 0.99):
        exact = durations[int(share * len(durations))]
        assert histogram.percentile_us(share) == pytest.approx(exact, rel=0.025)
    assert histogram.max_us == durations[-1]
    assert histogram.percentile_us(1.0) <= histogram.max_us


@pytest.mark.parametrize("duration", [0.0, 0.5, 1e12])
def test_very_short_and_long_durations_are_counted(duration: float) -> None:
    histogram = Histogram()
    histogram.add(duration)
    assert histogram.count == 1
    assert histogram.percentile_us(0.5) <= duration


def test_an_interval_reports_itself_and_counts_go_on() -> None:
    timer = GroupTimer(2_000)
    timer.add(100.0)
    timer.add(2_100.0)
    first = timer.close_interval()
    assert (first.ticks, first.late_ticks) == (2, 1)
    assert first.execution_max_us == 2_100.0
    timer.add(50.0, lateness_us=1_960.0)
    second = timer.close_interval()
    assert (second.ticks, second.late_ticks) == (3, 2)
    assert second.execution_max_us == 50.0
    assert timer.execution.max_us == 2_100.0
    assert timer.late_share == pytest.approx(2 / 3)


def test_nothing_measured_is_zero() -> None:
    report = GroupTimer(2_000).close_interval()
    assert (report.execution_p50_us, report.load) == (0.0, 0.0)
