"""Missed releases in bounded memory; warnings of what is new, and not too often."""

from __future__ import annotations

import pytest

from fsw.runtime.releases import DeadlineMonitor


def test_releases_in_a_row_are_one_interval() -> None:
    monitor = DeadlineMonitor()
    for due_us in (10_000, 12_000, 14_003):
        monitor.add(due_us)
    monitor.add(16_000, 30_000)
    monitor.add(34_000)
    assert monitor.missed == [(10_000, 30_000), (34_000, 34_000)]


def test_memory_is_bounded() -> None:
    monitor = DeadlineMonitor()
    for number in range(100_000):
        monitor.add(10_000 * number)
    assert len(monitor.missed) < 10_000
    assert monitor.missed[0] == (0, 0)


def test_a_few_misses_do_not_matter_for_any_time() -> None:
    """Two ticks without sensors every ten seconds lit a ground station's warning for good."""
    monitor = DeadlineMonitor()
    for second in range(600):
        few = {"late": second, "skipped": second, "stale": 2 * second, "plans_late": second // 4}
        assert monitor.warning(second * 1_000_000, **few) is None


@pytest.mark.parametrize(
    ("what", "count", "words"),
    [
        ("late", 50, "50 late"),
        ("skipped", 50, "50 skipped"),
        ("stale", 50, "50 without sensors"),
        ("plans_late", 5, "5 plans late"),
    ],
)
def test_what_matters_is_reported_at_once_and_once(what: str, count: int, words: str) -> None:
    monitor = DeadlineMonitor()
    assert monitor.warning(0) is None
    assert monitor.warning(500_000, **{what: count - 1}) is None
    assert monitor.warning(1_000_000, **{what: count}) == f"ticks: {words}"
    for second in range(2, 60):
        assert monitor.warning(second * 1_000_000, **{what: count}) is None


def test_warnings_come_at_a_limited_rate_and_sum_up() -> None:
    monitor = DeadlineMonitor()
    reported = []
    for second in range(60):
        sentence = monitor.warning(
            second * 1_000_000, late=30 * second, skipped=10 * second, plans_late=5 * second
        )
        if sentence is not None:
            reported.append(sentence)
    assert len(reported) == 6
    assert reported[1] == "ticks: 300 late, 100 skipped, 50 plans late"
    assert all(len(sentence) <= 50 for sentence in reported), "one STATUSTEXT"
