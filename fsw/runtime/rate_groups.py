"""Which part of the flight software runs how often, and in which order: one table.

The loop walks the table from top to bottom, each group's members from left to right. In real time
releases are an absolute schedule on the monotonic clock; a missed one is skipped and counted, and
shifts nothing. In lockstep each step of the simulator is one
release. PLAN runs where a tick has asked.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, Generic, TypeVar

from fsw.autopilot.periods import PLANNING_US, TICK_US
from fsw.autopilot.ports import Clock
from fsw.runtime.timing import GroupTimer, Histogram

Cycle = TypeVar("Cycle")

# Every 27th tick is timed member by member. The number has no divisor in common with the ticks
# of a planning period, so that every place in one is timed as often.
STAGES_EVERY: Final = 27


class Member(enum.Enum):
    """What a group does; the loop has one method for each."""

    RECEIVE = "receive"  # from the simulator and the planner, and what the ground had sent
    TICK = "tick"  # ``Autopilot.control``: estimate, modes, control, safety gate
    ACTUATE = "actuate"  # answer the simulator; until here the vehicle waits
    CONCLUDE = "conclude"  # the rest of the tick: watches, reference, reports
    PLAN = "plan"  # hand a request to the planner
    PUBLISH = "publish"  # telemetry to the ground, and read what it sends
    LOG = "log"  # the flight log
    SUMMARISE = "summarise"  # timing of the last second
    WARN = "warn"  # what went wrong since the last warning
    CHECK_FILES = "check files"  # whether the disk still takes them


@dataclass(frozen=True, slots=True)
class RateGroup:
    """Members that share a rate."""

    name: str
    number: int  # PANDION_RATE_GROUP of the dialect
    period_us: int
    members: tuple[Member, ...]


INNER: Final = RateGroup(
    "inner", 0, TICK_US, (Member.RECEIVE, Member.TICK, Member.ACTUATE, Member.CONCLUDE)
)
MPC: Final = RateGroup("mpc", 1, PLANNING_US, (Member.PLAN,))
# Every stream of messages has a rate of its own, in whole ticks: fsw/link/telemetry/streams.py.
TELEMETRY: Final = RateGroup("telemetry", 2, TICK_US, (Member.PUBLISH, Member.LOG))
HOUSEKEEPING: Final = RateGroup(
    "housekeeping", 3, 1_000_000, (Member.SUMMARISE, Member.WARN, Member.CHECK_FILES)
)

RATE_GROUPS: Final = (INNER, MPC, TELEMETRY, HOUSEKEEPING)


class RateGroupRunner(Generic[Cycle]):
    """Runs the members of one group in their order, and times them."""

    def __init__(
        self, group: RateGroup, methods: Mapping[Member, Callable[[Cycle], None]], clock: Clock
    ) -> None:
        self.group = group
        self.timer = GroupTimer(group.period_us)
        self.stages = {member: Histogram() for member in group.members}
        self._calls = tuple(methods[member] for member in group.members)
        self._clock = clock
        self._runs = 0
        self._stages_every = STAGES_EVERY if group.period_us == TICK_US else 1

    def run(self, cycle: Cycle, due_us: int, begin_us: int) -> int:
        """Run once; returns when it ended [us, monotonic].

        It was released at ``due_us`` [us, monotonic], and its work began at ``begin_us`` [us,
        monotonic]: now, or when the process woke for it.
        """
        self._runs += 1
        if self._runs % self._stages_every:
            for call in self._calls:
                call(cycle)
        else:
            mark = begin_us
            for call, stage in zip(self._calls, self.stages.values(), strict=True):
                call(cycle)
                now_us = self._clock()
                stage.add(now_us - mark)
                mark = now_us
        end_us = self._clock()
        self.timer.add(end_us - begin_us, begin_us - due_us)
        return end_us
