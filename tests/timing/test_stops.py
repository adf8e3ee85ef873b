"""Missed releases are held against the machine only where it stood still, release by release."""

from __future__ import annotations

import random

import pytest

from pandion.bench.stops import Stops

PERIOD_US = 2_000
BEGIN_US = 1_000_000
RELEASES = 30_000


def test_a_machine_that_never_stops_excuses_nothing() -> None:
    stops = Stops([[], []], PERIOD_US)
    missed = [(BEGIN_US + 10_000, BEGIN_US + 20_000), (BEGIN_US + 50_000, BEGIN_US + 50_000)]
    assert stops.missed_elsewhere(missed, BEGIN_US, RELEASES) == 7 / RELEASES
    assert stops.share(BEGIN_US, RELEASES) == 0.0


def test_releases_within_a_stop_of_either_processor_are_excused_and_not_counted() -> None:
    stop = (BEGIN_US + 100_000, BEGIN_US + 130_000)
    missed = [(BEGIN_US + 100_000, BEGIN_US + 128_000), (BEGIN_US + 400_000, BEGIN_US + 400_000)]
    for late in ([[stop], []], [[], [stop]], [[stop], [stop]]):
        stops = Stops(late, PERIOD_US)
        # A period before and behind belongs to the stop: 34 ms are 17 releases.
        assert stops.missed_elsewhere(missed, BEGIN_US, RELEASES) == 1 / (RELEASES - 17)


def test_a_sleeping_loop_misses_what_a_tick_of_no_length_would() -> None:
    due = BEGIN_US + 100_000
    one = [(due, due + 1_400), (due + 10_000, due + 11_600), (due + 20_000, due + 39_000)]
    assert Stops([one, []], PERIOD_US).share(BEGIN_US, RELEASES) == (1 + 9) / (2 * RELEASES)
    before = [(BEGIN_US - 50_000, BEGIN_US - 20_000)]
    assert Stops([before], PERIOD_US).share(BEGIN_US, RELEASES) == 0.0


@pytest.mark.parametrize("seed", range(20))
def test_what_has_nothing_to_do_with_the_stops_is_excused_by_chance_only(seed: int) -> None:
    chance = random.Random(seed)
    dues = (BEGIN_US + PERIOD_US * chance.randrange(RELEASES) for _ in range(60))
    stops = Stops([[(due, due + chance.randrange(500, 30_000)) for due in dues]], PERIOD_US)
    missed = [BEGIN_US + PERIOD_US * chance.randrange(RELEASES) for _ in range(600)]
    share = stops.missed_elsewhere([(due, due) for due in missed], BEGIN_US, RELEASES)
    assert share == pytest.approx(len(missed) / RELEASES, rel=0.1)
