"""Rates are exact, and no tick carries more than its share."""

from __future__ import annotations

import itertools
from collections import Counter

import pytest

from fsw.link.streams import HEARTBEAT, STREAMS, Stream, schedule


def test_every_rate_is_exact_over_a_second_and_even_within() -> None:
    slots = schedule(STREAMS, 500)
    for stream in STREAMS:
        due = [tick for tick, slot in enumerate(slots) if stream in slot]
        assert len(due) == stream.rate_hz
        gaps = [after - before for before, after in itertools.pairwise(due)]
        assert all(abs(gap - 500 / stream.rate_hz) <= 1.0 for gap in gaps)


def test_streams_are_spread_over_the_ticks() -> None:
    load = Counter(len(slot) for slot in schedule(STREAMS, 500))
    # 187 messages a second over 500 ticks: no tick needs to carry two.
    assert max(load) == 1


def test_the_table_holds_the_stated_rates() -> None:
    rates = {(stream.component, stream.message_id): stream.rate_hz for stream in STREAMS}
    assert rates == {
        (1, 0): 1, (1, 1): 2, (1, 245): 1, (1, 30): 50, (1, 31): 10, (1, 32): 30, (1, 85): 10,
        (1, 83): 10, (191, 60200): 30, (191, 60201): 10, (191, 60202): 10, (191, 60203): 10,
        (191, 60204): 10, (191, 60206): 1,
    }  # fmt: skip


@pytest.mark.parametrize("rate_hz", [0, 501])
def test_a_rate_that_no_tick_can_carry_is_refused(rate_hz: int) -> None:
    with pytest.raises(ValueError, match="stream rate"):
        schedule((Stream(0, rate_hz, 1, HEARTBEAT.encode),), 500)
