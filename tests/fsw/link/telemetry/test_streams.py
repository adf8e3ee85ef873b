"""The table of streams, and the timetable that each link makes of it."""

from __future__ import annotations

import itertools
from collections import Counter

import pytest

from fsw.link.telemetry.stream_rates import OFF, UNKNOWN, StreamRates
from fsw.link.telemetry.streams import API_RATES, GROUND_RATES, STREAMS
from messages import message_ids as ids

TICK_US = 2_000


def sent(rates: StreamRates, seconds: float, begin_us: int = 1_000_000) -> dict[int, list[int]]:
    """Times at which each message leaves, asked at every slot."""
    times: dict[int, list[int]] = {stream.message_id: [] for stream in STREAMS}
    for t_us in range(begin_us, begin_us + round(1e6 * seconds), rates.slot_us):
        for stream in rates.due(t_us):
            times[stream.message_id].append(t_us)
    return times


def test_the_table_holds_the_stated_rates() -> None:
    rates = {
        (stream.component, stream.message_id): (stream.ground_hz, stream.api_hz)
        for stream in STREAMS
    }
    assert rates == {
        (1, 0): (1, 1), (1, 1): (2, 2), (1, 245): (1, 5), (1, 30): (50, 50), (1, 31): (10, 50),
        (1, 32): (30, 50), (1, 33): (5, 10), (1, 85): (10, 10), (1, 83): (10, 10), (1, 74): (4, 4),
        (1, 141): (1, 2), (1, 242): (0.5, 1), (1, 147): (1, 1), (1, 230): (1, 1), (1, 2): (1, 1),
        (1, 436): (0.5, 0.5), (1, 42): (1, 1), (1, 331): (0, 30), (1, 49): (0, 0),
        (1, 148): (0, 0), (1, 36): (5, 5), (1, 241): (0.5, 0.5), (1, 360): (2, 2),
        (1, 105): (0, 50), (1, 300): (0, 0), (1, 24): (1, 5),
        (25, 60200): (30, 50), (25, 60201): (10, 10), (25, 60202): (10, 10),
        (25, 60203): (10, 10), (25, 60204): (10, 10), (25, 60205): (0, 0), (25, 60213): (0, 0),
        (25, 60215): (10, 20), (25, 60216): (2, 10),
        (25, 60206): (1, 1), (25, 60209): (5, 5),
    }  # fmt: skip


@pytest.mark.parametrize("rates_hz", [GROUND_RATES, API_RATES])
def test_every_rate_is_kept_and_even(rates_hz: tuple[float, ...]) -> None:
    times = sent(StreamRates(STREAMS, rates_hz, TICK_US), seconds=20.0)
    for stream, rate_hz in zip(STREAMS, rates_hz, strict=True):
        if stream.message_id == ids.LOOP_TIMING:
            continue  # two streams of one id
        assert abs(len(times[stream.message_id]) - 20.0 * rate_hz) <= 1, stream
        gaps = [b - a for a, b in itertools.pairwise(times[stream.message_id])]
        assert all(abs(gap - 1e6 / rate_hz) < 10_000 for gap in gaps), stream


def test_streams_are_spread_over_the_slots() -> None:
    times = sent(StreamRates(STREAMS, GROUND_RATES, TICK_US), seconds=10.0, begin_us=2_000_000)
    load = Counter(t_us for at in times.values() for t_us in at)
    # 197 messages a second over 100 slots.
    assert max(load.values()) <= 8


def test_a_pause_is_not_caught_up_on() -> None:
    rates = StreamRates(STREAMS, GROUND_RATES, TICK_US)
    list(rates.due(1_000_000))
    assert sum(stream.message_id == ids.ATTITUDE for stream in rates.due(9_000_000)) == 1
    assert sum(stream.message_id == ids.ATTITUDE for stream in rates.due(9_010_000)) == 0


@pytest.mark.parametrize("interval_us", [4_000, 10_000, 100_000, 1_000_000])
def test_an_interval_that_is_set_is_kept(interval_us: int) -> None:
    rates = StreamRates(STREAMS, GROUND_RATES, TICK_US)
    assert rates.set_interval(ids.ATTITUDE, interval_us, 1_000_000) == ""
    assert rates.interval_us(ids.ATTITUDE) == interval_us
    count = len(sent(rates, seconds=5.0)[ids.ATTITUDE])
    assert abs(count - 5_000_000 / interval_us) <= 1


def test_an_interval_of_minus_one_is_never_and_zero_the_default() -> None:
    rates = StreamRates(STREAMS, GROUND_RATES, TICK_US)
    assert rates.set_interval(ids.ATTITUDE, -1, 1_000_000) == ""
    assert rates.interval_us(ids.ATTITUDE) == OFF
    assert sent(rates, seconds=1.0)[ids.ATTITUDE] == []
    assert rates.set_interval(ids.ATTITUDE, 0, 2_000_000) == ""
    assert rates.interval_us(ids.ATTITUDE) == 20_000


def test_the_timings_of_all_groups_change_together() -> None:
    rates = StreamRates(STREAMS, GROUND_RATES, TICK_US)
    rates.set_interval(ids.LOOP_TIMING, 500_000, 0)
    assert len(sent(rates, seconds=4.0)[ids.LOOP_TIMING]) == 4 * 8


@pytest.mark.parametrize(
    ("message_id", "interval_us"), [(4711, 1_000_000), (ids.ATTITUDE, 1_000), (ids.ATTITUDE, -2)]
)
def test_what_cannot_be_sent_is_refused_with_a_reason(message_id: int, interval_us: int) -> None:
    rates = StreamRates(STREAMS, GROUND_RATES, TICK_US)
    assert rates.set_interval(message_id, interval_us, 0)
    assert rates.interval_us(ids.ATTITUDE) == 20_000


def test_no_link_is_loaded_beyond_its_budget() -> None:
    rates = StreamRates(STREAMS, GROUND_RATES, TICK_US)
    answers = [rates.set_interval(stream.message_id, TICK_US, 0) for stream in STREAMS[:6]]
    assert answers[:2] == ["", ""]
    assert "1500 messages a second" in answers[3]
    assert rates.interval_us(STREAMS[3].message_id) == 20_000


def test_an_unknown_message_has_no_interval() -> None:
    assert StreamRates(STREAMS, GROUND_RATES, TICK_US).interval_us(4711) == UNKNOWN
