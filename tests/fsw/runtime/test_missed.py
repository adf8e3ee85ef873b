"""Missed releases are kept as stretches, in bounded memory."""

from __future__ import annotations

from fsw.runtime.missed import MissedReleases


def test_releases_in_a_row_are_one_stretch() -> None:
    missed = MissedReleases()
    for due_us in (10_000, 12_000, 14_003):
        missed.add(due_us)
    missed.add(16_000, 30_000)
    missed.add(34_000)
    assert missed.stretches == [(10_000, 30_000), (34_000, 34_000)]


def test_memory_is_bounded() -> None:
    missed = MissedReleases()
    for number in range(100_000):
        missed.add(10_000 * number)
    assert len(missed.stretches) < 10_000
    assert missed.stretches[0] == (0, 0)
