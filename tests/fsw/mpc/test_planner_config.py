"""A configuration of the planner that cannot be sampled is refused with a sentence."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from fsw.mpc.planner_config import PlannerConfig

CONFIG = PlannerConfig()


@pytest.mark.parametrize("period_us", [0, -1, -100_000])
def test_a_period_that_is_not_positive_is_refused(period_us: int) -> None:
    with pytest.raises(ValueError, match=r"period is .* it must be positive"):
        PlannerConfig(period_us=period_us)


def test_a_period_counts_in_seconds() -> None:
    assert PlannerConfig(period_us=50_000).period == 0.05


@pytest.mark.parametrize("barrier", ["walls", "workspace"])
@pytest.mark.parametrize("rate", ["slope", "gamma"])
def test_a_barrier_may_be_as_fast_as_the_sampling_and_not_faster(barrier: str, rate: str) -> None:
    fastest = 1.0 / CONFIG.period
    for value, refused in ((fastest, False), (1.01 * fastest, True)):
        changed: Any = {barrier: replace(getattr(CONFIG, barrier), **{rate: value})}
        if refused:
            with pytest.raises(ValueError, match="must not exceed"):
                replace(CONFIG, **changed)
        else:
            replace(CONFIG, **changed)


def test_the_paper_s_controllers_are_flown_as_printed_unless_asked_otherwise() -> None:
    assert (CONFIG.hard_slack, CONFIG.hard_skipped_nodes, CONFIG.tightening) == (None, 0, 0.0)
    assert not CONFIG.centred
