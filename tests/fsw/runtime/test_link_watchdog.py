"""Silence counts only while the process ran."""

from __future__ import annotations

from fsw.runtime.flight_loop import LinkWatchdog


class Clock:
    """Moved by hand."""

    now_us = 1_000_000

    def __call__(self) -> int:
        return self.now_us


def test_silence_grows_with_time_until_a_frame_arrives() -> None:
    clock = Clock()
    watchdog = LinkWatchdog(clock)
    for _ in range(5):
        clock.now_us += 200_000
        silent_us = watchdog.check()
    assert silent_us == 1_000_000
    watchdog.reset(clock.now_us)
    clock.now_us += 2_000
    assert watchdog.check() == 2_000


def test_a_gap_in_which_the_process_was_suspended_counts_little() -> None:
    clock = Clock()
    watchdog = LinkWatchdog(clock)
    clock.now_us += 60_000_000
    assert watchdog.check() <= 250_000
    clock.now_us += 200_000
    assert watchdog.check() <= 450_000
