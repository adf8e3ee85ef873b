"""Missed releases are held against the machine only where it stood still, release by release."""

from __future__ import annotations

import random

import pytest

from benchmarks.stops import Stops

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
        # A period before and five behind belong to the stop: 42 ms are 21 releases.
        assert stops.missed_elsewhere(missed, BEGIN_US, RELEASES) == 1 / (RELEASES - 21)


def test_a_stop_excuses_one_period_before_it_was_seen_and_five_behind() -> None:
    stops = Stops([[(BEGIN_US + 100_000, BEGIN_US + 130_000)]], PERIOD_US)
    for due_us, excused in ((97_000, False), (99_000, True), (139_000, True), (141_000, False)):
        missed = [(BEGIN_US + due_us, BEGIN_US + due_us)]
        share = stops.missed_elsewhere(missed, BEGIN_US, RELEASES)
        assert (share == 0.0) is excused, due_us


def test_the_share_of_time_is_the_mean_of_the_processors() -> None:
    one = [(BEGIN_US + 10_000, BEGIN_US + 16_000), (BEGIN_US + 50_000, BEGIN_US + 50_600)]
    stops = Stops([one, []], PERIOD_US)
    assert stops.share(BEGIN_US, 100) == pytest.approx(6_600 / 200_000 / 2)


def test_what_was_before_the_flight_does_not_count() -> None:
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
