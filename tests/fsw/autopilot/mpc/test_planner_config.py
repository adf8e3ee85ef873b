"""A configuration of the planner that cannot be sampled is refused with a sentence."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from fsw.autopilot.mpc.costs import CostWeights
from fsw.autopilot.mpc.planner_config import PlannerConfig, SoftWeights
from fsw.autopilot.mpc.qp_data import InputLimits
from fsw.autopilot.parameters.registry import BY_NAME
from fsw.autopilot.tuning import number_at

CONFIG = PlannerConfig(body="points")


@pytest.mark.parametrize("period_us", [0, -1, -100_000])
def test_a_period_that_is_not_positive_is_refused(period_us: int) -> None:
    with pytest.raises(ValueError, match=r"period is .* it must be positive"):
        PlannerConfig(period_us=period_us)


UNITS = {"deg": math.pi / 180.0}
PARTS = {
    "planner.weights": CostWeights(),
    "planner.limits": InputLimits(),
    "planner.soft": SoftWeights(),
    "planner": PlannerConfig(),
}
ROW = re.compile(r"^- `(\w+)`(?: †)? = (?:INT32 )?(\S+) ?(.*?) \([^)]*…", re.MULTILINE)


@pytest.mark.parametrize("part", PARTS)
def test_an_operator_reads_the_figures_that_are_flown(part: str) -> None:
    page = Path(__file__).parents[4] / "docs/reference/parameters.md"
    shown = {name: (figure, unit) for name, figure, unit in ROW.findall(page.read_text("utf-8"))}
    rows = [
        (*shown[name], parameter.path.rpartition(".")[2])
        for name, parameter in BY_NAME.items()
        if parameter.path.rpartition(".")[0] == part
    ]
    assert len(rows) >= 3
    for figure, unit, name in rows:
        flown = float(figure) * UNITS.get(unit.strip(), 1.0)
        assert number_at(PARTS[part], name) == pytest.approx(flown, rel=1e-5), name


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
