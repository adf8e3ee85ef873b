"""Progress where there is no terminal: a line for each tenth, and none later than a minute."""

from __future__ import annotations

import io

from pandion.display import Display


def test_a_long_operation_says_something_every_tenth_and_every_minute() -> None:
    now, stream = 0.0, io.StringIO()
    display = Display(stream, clock=lambda: now)
    for done in range(101):
        now = 12.0 * done  # a tenth takes two minutes
        display.report("flown", done, 100, f"{done} flights")
    said = [int(line.split()[1]) for line in stream.getvalue().splitlines()]
    assert set(range(10, 101, 10)) <= set(said)
    gaps = [12.0 * (b - a) for a, b in zip([0, *said], said, strict=False)]
    assert max(gaps) <= 72.0


def test_a_short_one_says_each_tenth_only() -> None:
    stream = io.StringIO()
    display = Display(stream, clock=lambda: 0.0)
    for done in range(101):
        display.report("flown", done, 100, f"{done} flights")
    said = [int(line.split()[1]) for line in stream.getvalue().splitlines()]
    assert said == list(range(10, 101, 10))
