"""Runs the members of a rate group in their declared order, and times them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final, Generic, TypeVar

from fsw.ports import Clock
from fsw.runtime.rates import Member, RateGroup
from fsw.runtime.timing import GroupTimer, Histogram

Cycle = TypeVar("Cycle")

_STAGES_EVERY: Final = 8  # runs between two whose members are timed one by one


class RateGroupRunner(Generic[Cycle]):
    """One group of the table, bound to what its members do."""

    def __init__(
        self,
        group: RateGroup,
        methods: Mapping[Member, Callable[[Cycle], None]],
        clock: Clock,
        tick_period_us: int,
    ) -> None:
        """Bind a group.

        Args:
            group: From the table.
            methods: What each member does; every one of the group must be there.
            clock: Monotonic wall time.
            tick_period_us: Of the fastest group.
        """
        self.group = group
        self.ticks = group.period_us // tick_period_us
        self.timer = GroupTimer(group.period_us)
        self.stages = {member: Histogram() for member in group.members}
        self._calls = tuple(methods[member] for member in group.members)
        self._clock = clock
        self._runs = 0

    def run(self, cycle: Cycle, due_us: int, begin_us: int) -> bool:
        """Run once; says whether that ended after the group's next release.

        Args:
            cycle: What the members work on.
            due_us: When the group was released, on the clock.
            begin_us: When it was taken up: now, or when the process woke for it.
        """
        self._runs += 1
        if self._runs % _STAGES_EVERY:
            for call in self._calls:
                call(cycle)
        else:
            self._run_timed(cycle, begin_us)
        return self.timer.add(self._clock() - begin_us, begin_us - due_us)

    def _run_timed(self, cycle: Cycle, mark: int) -> None:
        for call, stage in zip(self._calls, self.stages.values(), strict=True):
            call(cycle)
            now = self._clock()
            stage.add(now - mark)
            mark = now
