"""What is said about a clock that could not be kept: what is new, and not too often."""

from __future__ import annotations

from fsw.runtime.slips import WARN_US, Slips, SlipWarning


def test_nothing_new_is_nothing_said() -> None:
    warning = SlipWarning()
    assert warning.sentence(Slips(), 0) is None
    assert warning.sentence(Slips(late=2), 1) == "ticks: 2 late"
    assert warning.sentence(Slips(late=2), 1 + 2 * WARN_US) is None


def test_warnings_come_at_a_limited_rate_and_sum_up() -> None:
    warning = SlipWarning()
    said = []
    for second in range(60):
        slips = Slips(late=3 * second, skipped=second, stale=0, plans_late=second // 2)
        sentence = warning.sentence(slips, second * 1_000_000)
        if sentence is not None:
            said.append(sentence)
    assert len(said) == 6
    assert said[1] == "ticks: 30 late, 10 skipped, 5 plans late"
    assert all(len(sentence) <= 50 for sentence in said), "one STATUSTEXT"
