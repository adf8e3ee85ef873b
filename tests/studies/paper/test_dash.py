"""At speed the barrier decides: what fails and what does not in the first 20 s."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest

from sitl.mission_clock import MissionClock
from studies.flight.job import Job, Outcome
from studies.paper.cases import Case, configuration, scenario, softened, tightened


@cache
def flown(
    case: Case, controller: str, more_mm: int = 0, *, soft: bool = False, disturbed: bool = False
) -> Outcome:
    """A flight of 20 s, which has the first dash."""
    config = configuration("full", controller)
    if controller == "hc":
        config = tightened(softened(config) if soft else config, 1e-3 * max(more_mm, 1))
    path = scenario(case, disturbed=disturbed, duration_s=20.0, family="dash")
    return Job("full", path, config, 1000).row()


@pytest.mark.long
@pytest.mark.parametrize("case", ["I", "II"])
def test_blf_completes_with_room_to_spare(case: Case) -> None:
    row = flown(case, "blf")
    assert row.completed, row.reason
    assert row.margin_m is not None
    assert row.margin_m > 0.06
    assert not row.failures


@pytest.mark.drawn(1)
@pytest.mark.parametrize("case", ["I", "II"])
@pytest.mark.parametrize("controller", ["naive", "hc"])
def test_naive_and_hc_fail_in_disturbance(case: Case, controller: str) -> None:
    row = flown(case, controller, disturbed=True)
    assert not row.completed
    assert row.margin_m is not None
    assert row.margin_m < -0.01


@pytest.mark.long
def test_no_tightening_is_enough_at_a_wall_that_is_seen_too_late() -> None:
    hard, soft = flown("I", "hc", 100), flown("I", "hc", 100, soft=True)
    assert not hard.completed
    assert hard.failures  # there was no plan
    assert not soft.completed  # its rows gave way by more than they were tightened


@pytest.mark.long
def test_the_safety_filter_takes_no_turn_of_the_target_for_a_breach() -> None:
    """As `pandion fly` flies: with the filter, which the tables leave out."""
    config = replace(configuration("full"), soft=False)
    path = scenario("II", disturbed=True, duration_s=20.0, family="dash")
    row = Job("full", path, config, 1000).row()
    assert row.completed, row.reason
    assert not row.modes
    assert row.margin_m is not None
    assert row.margin_m > 0.02


def test_the_vehicle_takes_the_paths_as_they_are() -> None:
    """Faster than STR_V_MAX they would be limited, for every controller."""
    for case in ("I", "II"):
        clock = MissionClock(scenario(case, disturbed=False, family="dash"))
        speeds = [sum(v * v for v in clock.target_at(0.01 * k).v) ** 0.5 for k in range(12_000)]
        assert max(speeds) < 1.5
