"""What is said about a clock that could not be kept: what is new, and not too often."""

from __future__ import annotations

import pytest

from fsw.runtime.slips import Slips, SlipWarning


def test_a_few_slips_are_no_matter_however_long_they_go_on() -> None:
    """Two ticks without sensors every ten seconds lit a ground station's warning for good."""
    warning = SlipWarning()
    for second in range(600):
        slips = Slips(late=second, skipped=second, stale=2 * second, plans_late=second // 4)
        assert warning.sentence(slips, second * 1_000_000) is None


@pytest.mark.parametrize(
    "slips", [Slips(late=50), Slips(skipped=50), Slips(stale=50), Slips(plans_late=5)]
)
def test_what_matters_is_told_at_once_and_once(slips: Slips) -> None:
    warning = SlipWarning()
    assert warning.sentence(Slips(), 0) is None
    sentence = warning.sentence(slips, 1_000_000)
    assert sentence is not None
    assert sentence.startswith("ticks: ")
    for second in range(2, 60):
        assert warning.sentence(slips, second * 1_000_000) is None


def test_warnings_come_at_a_limited_rate_and_sum_up() -> None:
    warning = SlipWarning()
    said = []
    for second in range(60):
        slips = Slips(late=30 * second, skipped=10 * second, stale=0, plans_late=5 * second)
        sentence = warning.sentence(slips, second * 1_000_000)
        if sentence is not None:
            said.append(sentence)
    assert len(said) == 6
    assert said[1] == "ticks: 300 late, 100 skipped, 50 plans late"
    assert all(len(sentence) <= 50 for sentence in said), "one STATUSTEXT"
