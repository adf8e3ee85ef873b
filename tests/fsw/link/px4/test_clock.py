"""PX4's time as the vehicle's."""

from __future__ import annotations

from fsw.link.px4.estimate import Px4Clock
from fsw.link.px4.messages import CompanionWriter
from messages.frames import split


def test_the_vehicles_time_is_px4s_and_goes_on_after_a_restart() -> None:
    clock = Px4Clock()
    assert not clock.take(5_000_000)
    assert not clock.take(5_004_000)
    assert clock.ahead_us == 0
    assert clock.take(200_000)
    assert clock.restarts == 1
    assert 200_000 + clock.ahead_us > 5_004_000
    before = clock.ahead_us
    assert not clock.take(204_000)
    assert clock.ahead_us == before


def test_a_gap_in_which_px4s_time_went_on_changes_nothing() -> None:
    clock = Px4Clock()
    clock.take(1_000_000)
    clock.passed(1_990_000)
    clock.take(2_000_000)
    assert clock.ahead_us == 0


def test_a_px4_whose_time_stood_still_is_not_behind_for_ever() -> None:
    clock = Px4Clock()
    clock.take(1_000_000)
    clock.passed(9_000_000)
    assert not clock.take(1_004_000)
    assert 1_004_000 + clock.ahead_us > 9_000_000


def test_questions_are_answered_and_round_trips_measured() -> None:
    clock, writer = Px4Clock(), CompanionWriter()
    (answer,) = split(clock.answer(0, 777, 2_000, writer))
    assert answer.payload_values == (2_000_000, 777)
    for trip_us in (3_000, 9_000, 4_000):
        sent_us = 1_000_000
        assert clock.answer(1, 1000 * sent_us, sent_us + trip_us, writer) == b""
    assert clock.round_trip_us == 4_000
