"""Which part of the flight software runs how often, and in which order: one table.

The loop walks the table from top to bottom, each group's members from left to right. Releases are
an absolute grid on the monotonic clock; a release that was missed is skipped and counted, and
shifts nothing. The planner's cycle runs in a process of its own: its member here only asks.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Final

from fsw.periods import PLANNING_US, TICK_US


class Member(enum.Enum):
    """What a group does; the loop has one method for each."""

    HEAR = "hear"  # what came from the simulator and the planner, and what the ground had sent
    TICK = "tick"  # estimate, modes, control, safety gate: the pure function
    ACTUATE = "actuate"  # answer the simulator; until here the vehicle waits
    ASK = "ask"  # hand a request to the planner
    PUBLISH = "publish"  # telemetry to the ground, and read what it sends
    RECORD = "record"  # the flight log
    SUM_UP = "sum up"  # timing of the second that is over
    WARN = "warn"  # what went wrong since the last warning
    WATCH_FILES = "watch files"  # whether the disk still takes them


@dataclass(frozen=True, slots=True)
class RateGroup:
    """Members that share a rate."""

    name: str
    number: int  # PANDION_RATE_GROUP of the dialect
    period_us: int
    members: tuple[Member, ...]


INNER: Final = RateGroup("inner", 0, TICK_US, (Member.HEAR, Member.TICK, Member.ACTUATE))
MPC: Final = RateGroup("mpc", 1, PLANNING_US, (Member.ASK,))
# Every stream of messages has a rate of its own, in whole ticks: fsw/link/telemetry/streams.py.
TELEMETRY: Final = RateGroup("telemetry", 2, TICK_US, (Member.PUBLISH, Member.RECORD))
HOUSEKEEPING: Final = RateGroup(
    "housekeeping", 3, 1_000_000, (Member.SUM_UP, Member.WARN, Member.WATCH_FILES)
)

RATE_GROUPS: Final = (INNER, MPC, TELEMETRY, HOUSEKEEPING)
