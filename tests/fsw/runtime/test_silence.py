"""Silence counts only while somebody listened."""

from __future__ import annotations

from fsw.runtime.silence import Silence


class Clock:
    """Moved by hand."""

    now_us = 1_000_000

    def __call__(self) -> int:
        return self.now_us


def test_silence_grows_with_time_until_something_is_heard() -> None:
    clock = Clock()
    silence = Silence(clock)
    for _ in range(5):
        clock.now_us += 200_000
        grown = silence.grow()
    assert grown == 1_000_000
    silence.end(clock.now_us)
    clock.now_us += 2_000
    assert silence.grow() == 2_000


def test_a_process_that_stood_still_does_not_blame_the_other() -> None:
    clock = Clock()
    silence = Silence(clock)
    clock.now_us += 60_000_000
    assert silence.grow() <= 250_000
    clock.now_us += 200_000
    assert silence.grow() <= 450_000
