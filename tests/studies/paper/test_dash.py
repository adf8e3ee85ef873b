"""At speed the barrier decides: what fails and what does not in the first 20 s, calm."""

from __future__ import annotations

from functools import cache

import pytest

from sitl.mission_clock import MissionClock
from studies.flight.job import Job, Outcome
from studies.paper.cases import Case, configuration, scenario, softened, tightened


@cache
def flown(case: Case, controller: str, more_mm: int = 0, *, soft: bool = False) -> Outcome:
    """A flight of 20 s, which has the first dash."""
    config = configuration("full", controller)
    if controller == "hc":
        config = tightened(softened(config) if soft else config, 1e-3 * max(more_mm, 1))
    calm = scenario(case, disturbed=False, duration_s=20.0, family="dash")
    return Job("full", calm, config, 0).row()


@pytest.mark.parametrize("case", ["I", "II"])
def test_blf_completes_with_room_to_spare(case: Case) -> None:
    row = flown(case, "blf")
    assert row.completed, row.reason
    assert row.margin_m is not None
    assert row.margin_m > 0.06
    assert not row.failures


@pytest.mark.parametrize("case", ["I", "II"])
def test_naive_and_hc_fail(case: Case) -> None:
    for name in ("naive", "hc"):
        row = flown(case, name)
        assert not row.completed
        assert row.margin_m is not None
        assert row.margin_m < -0.01


@pytest.mark.parametrize(("case", "more_mm"), [("I", 100), ("II", 40), ("II", 60)])
def test_no_tightening_is_enough_where_braking_in_time_needs_a_longer_look(
    case: Case, more_mm: int
) -> None:
    row = flown(case, "hc", more_mm)
    assert not row.completed
    assert row.failures  # there was no plan


def test_softened_rows_give_way_by_more_than_they_were_tightened() -> None:
    assert not flown("I", "hc", 100, soft=True).completed


def test_the_vehicle_takes_the_paths_as_they_are() -> None:
    """Faster than STR_V_MAX they would be limited, for every controller."""
    for case in ("I", "II"):
        clock = MissionClock(scenario(case, disturbed=False, family="dash"))
        speeds = [sum(v * v for v in clock.target_at(0.01 * k).v) ** 0.5 for k in range(12_000)]
        assert max(speeds) < 1.5
