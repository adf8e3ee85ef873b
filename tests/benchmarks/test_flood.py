"""The flood of `python -m benchmarks flood`, short: what must hold on any machine."""

from __future__ import annotations

import random
import sys

import pytest

from benchmarks.flood import Requirement, correctness, measure
from benchmarks.flood_traffic import KINDS, out_of_range
from messages.frames import FrameWriter, Losses, split
from pandion.display import Display


@pytest.mark.parametrize("kind", KINDS)
def test_only_what_asks_for_nonsense_is_a_valid_frame(kind: object) -> None:
    chance, writer, losses = random.Random(3), FrameWriter(66, 66), Losses()
    for _ in range(300):
        datagram = kind(writer, chance)  # type: ignore[operator]
        frames = split(datagram, losses)
        assert len(frames) == (1 if kind is out_of_range else 0)


@pytest.mark.long
def test_nothing_invalid_is_believed_and_the_vehicle_stays_in_touch() -> None:
    flight = measure(1.5, flooded=True, display=Display(sys.stderr))
    assert flight.sent > 0.5 * 1.5 * 5000.0
    assert [row for row in correctness(flight) if not row.passed] == []
    assert flight.vehicle["links"]["gcs"]["false_starts"] > 0.3 * flight.sent
    assert flight.vehicle["inbox_refused"] > 0
    # How soon and how often is the bench's to measure, on a machine that is free.
    assert flight.heard.heartbeats
    assert flight.heard.acknowledged_s


def test_a_figure_that_is_missing_does_not_pass() -> None:
    assert not Requirement("gap", float("nan"), 1.5, "s").passed
