"""Which runs of a group are timed stage by stage."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from fsw.autopilot.periods import PLANNING_US, TICK_US
from fsw.runtime.rate_groups import INNER, MPC, STAGES_EVERY, Member, RateGroup, RateGroupRunner

_PLACES = PLANNING_US // TICK_US


def timed_runs(group: RateGroup, runs: int) -> list[int]:
    """The numbers of the runs in which each member was timed by itself."""
    looks, timed = [0], []

    def clock() -> int:
        looks[0] += 1
        return looks[0]

    methods: dict[Member, Callable[[int], None]] = {one: lambda cycle: None for one in Member}
    runner = RateGroupRunner(group, methods, clock)
    for run in range(runs):
        before = looks[0]
        runner.run(run, 0, 0)
        if looks[0] - before > 1:
            timed.append(run)
    assert all(times.count == len(timed) for times in runner.stages.values())
    assert runner.timer.ticks == runs
    return timed


def test_every_place_in_a_planning_period_is_timed_as_often() -> None:
    """Some places have much more to do than others."""
    timed = timed_runs(INNER, 3 * STAGES_EVERY * _PLACES)
    assert Counter(run % _PLACES for run in timed) == dict.fromkeys(range(_PLACES), 3)


def test_a_group_that_runs_seldom_is_timed_in_every_run() -> None:
    assert timed_runs(MPC, 20) == list(range(20))
