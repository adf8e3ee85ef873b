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


def test_a_result_begins_with_three_lines() -> None:
    stream = io.StringIO()
    result = {"completed": False, "end_reason": "hit the front wall", "logs": {"ulog": "f.ulg"}}
    first = [("minimum margin", "-3.0 mm, front/base"), ("tracking RMS / max", "1.0 mm / 2.0 mm")]
    Display(stream).result(result, first, [("flown", "3.0 s")])
    lines = stream.getvalue().splitlines()
    assert lines[0] == "FAIL hit the front wall"
    assert lines[1].split(maxsplit=2)[:2] == ["minimum", "margin"]
    assert lines[2].startswith("tracking RMS / max")
    assert lines[-1].endswith("f.ulg")


def test_a_short_one_says_each_tenth_only() -> None:
    stream = io.StringIO()
    display = Display(stream, clock=lambda: 0.0)
    for done in range(101):
        display.report("flown", done, 100, f"{done} flights")
    said = [int(line.split()[1]) for line in stream.getvalue().splitlines()]
    assert said == list(range(10, 101, 10))


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_on_a_terminal_the_time_left_is_told_once() -> None:
    for timed, state in ((False, "3 of 4 flights"), (True, "3 of 4 kernels, about 9 s left")):
        stream = Terminal()
        display = Display(stream, threaded=False)
        with display.progress():
            display.report("done", 3, 4, state, timed=timed)
        assert state in stream.getvalue()
        assert ("-:--:--" in stream.getvalue()) is not timed
