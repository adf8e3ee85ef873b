"""Zones arrive as the set that somebody announced, or not at all."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from fsw.autopilot.shapes.ball import point
from fsw.autopilot.signals import SafeSet, Zone
from fsw.link.wire.decode import IndexedObstacle
from fsw.link.wire.zone_transfer import ZoneTransfer


def zone(which: int, index: int) -> Zone:
    return point((float(which), float(index), -1.0), 0.1)


def sent(which: int, count: int, set_id: int = 0) -> list[IndexedObstacle]:
    """Set number ``which``, of so many zones."""
    return [IndexedObstacle(zone(which, k), k, count, set_id) for k in range(count)]


def whole(which: int, count: int) -> SafeSet:
    return SafeSet(tuple(zone(which, k) for k in range(count)))


def received(zones: list[IndexedObstacle]) -> list[SafeSet]:
    transfer = ZoneTransfer()
    found = [transfer.add(one) for one in zones]
    return [one for one in found if one is not None]


@given(st.data())
def test_whatever_is_lost_doubled_or_late_no_set_is_one_that_nobody_announced(
    data: st.DataObject,
) -> None:
    counts = data.draw(st.lists(st.integers(1, 4), min_size=1, max_size=6))
    way = []
    for which, count in enumerate(counts):
        for one in sent(which, count, set_id=which + 1):
            way += [one] * data.draw(st.sampled_from([1, 1, 1, 0, 2]))
    for _ in range(data.draw(st.integers(0, 3))):
        late = way.pop(data.draw(st.integers(0, len(way) - 1))) if way else None
        if late is not None:
            way.insert(data.draw(st.integers(0, len(way))), late)
    announced = [whole(which, count) for which, count in enumerate(counts)]
    assert all(one in announced for one in received(way))


@given(counts=st.lists(st.integers(1, 5), min_size=1, max_size=5), twice=st.booleans())
def test_every_set_that_comes_whole_is_taken_once(counts: list[int], twice: bool) -> None:
    way = [one for which, count in enumerate(counts) for one in sent(which, count)]
    way = [one for one in way for _ in range(1 + (twice and one.count > 1))]
    assert received(way) == [whole(which, count) for which, count in enumerate(counts)]


def test_after_a_loss_the_next_set_is_taken_whole() -> None:
    (a0, a1, a2), b, c = sent(0, 3), sent(1, 3), sent(2, 3)
    assert received([a0, a2, *b]) == [whole(1, 3)]
    assert received([a1, a2, *b, *c]) == [whole(1, 3), whole(2, 3)]
    transfer = ZoneTransfer()
    transfer.add(a0)
    transfer.discard()
    assert [transfer.add(one) for one in (a1, a2)] == [None, None], "of one that was refused"
