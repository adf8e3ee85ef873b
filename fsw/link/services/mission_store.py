"""What was uploaded: mission, fence and rally points, shared by every link.

Kept as it came, so that a download returns it bit for bit, and handed to the tick as what it
means. It lives as long as the process (docs/decisions/0013-missions-stop-and-fences-are-walls.md).
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Final

from fsw.autopilot.flight.commands.bounds import mission_problem, safe_set_problem
from fsw.autopilot.flight.safety.safe_set import may_grow_fence
from fsw.autopilot.flight.safety.safe_set_change import growth
from fsw.autopilot.shapes.zones import surfaces
from fsw.autopilot.signals import (
    FlightSnapshot,
    MessageSource,
    MissionProgress,
    MissionStep,
    MissionUpdate,
    Mode,
    SafeSet,
    Vec2,
)
from fsw.link.services.mission_remarks import fence_remarks, mission_remarks
from fsw.link.wire.fence_items import check_fence_item, read_fence
from fsw.link.wire.mission_items import (
    DENIED,
    INVALID,
    BadItem,
    Locate,
    MissionItem,
    read_rally,
    read_step,
)

SafeSetCheck = Callable[[SafeSet], tuple[str, ...]]
"""Why the vehicle could not keep a safe set; nothing where it can."""

MarginCheck = Callable[[SafeSet, FlightSnapshot], float]
"""The least margin [m] that the whole vehicle would have in a safe set; below 0 it is outside."""

Meaning = MissionStep | Vec2 | None
"""What one item means; a fence item means something only in its shape."""


class Kind(IntEnum):
    """Values of MAV_MISSION_TYPE."""

    MISSION = 0
    FENCE = 1
    RALLY = 2


def _identity(items: tuple[MissionItem, ...]) -> int:
    """Identity of a list: a checksum of the upload, as in PX4.

    0 means an empty list, so no other list has it.
    """
    if not items:
        return 0
    packed = (
        _ITEM.pack(one.command, one.frame, one.autocontinue, *one.params, one.x, one.y, one.z)
        for one in items
    )
    return zlib.crc32(b"".join(packed)) or 1


_ITEM: Final = struct.Struct("<HBB4fiif")
ALL_KINDS: Final = 255  # MAV_MISSION_TYPE_ALL
ROOM: Final = {Kind.MISSION: 500, Kind.FENCE: 64, Kind.RALLY: 16}


@dataclass(frozen=True, slots=True)
class Site:
    """Where missions are flown."""

    locate: Locate
    judge: SafeSetCheck
    clearance: Callable[[], float]  # m, from the walls of a fence uploaded now
    min_margin: MarginCheck
    owner: Callable[[], int] = lambda: 0  # system that may grow a fence in flight; 0: its uploader
    ceiling: Callable[[], float] = lambda: math.inf  # m above the origin


class MissionStore:
    """The three lists, and what changed since the last tick."""

    def __init__(self, site: Site) -> None:
        self.progress = MissionProgress()
        self.in_mission = False
        self.ids: dict[int, int] = dict.fromkeys(Kind, 0)  # see ``PlanIds``
        self._site = site
        self.items: dict[Kind, tuple[MissionItem, ...]] = dict.fromkeys(Kind, ())
        self._update: MissionUpdate | None = None
        self._snapshot: FlightSnapshot | None = None
        self._steps: tuple[MissionStep, ...] = ()  # of the mission
        self._kept_fence: tuple[SafeSet, MessageSource | None] = (SafeSet(), None)

    def observe(self, snapshot: FlightSnapshot) -> None:
        """See the vehicle after a tick."""
        self._snapshot = snapshot
        self.progress = snapshot.mission
        self.in_mission = snapshot.mode is Mode.MISSION

    def read(self, kind: Kind, item: MissionItem) -> Meaning:
        """What an item means; ``BadItem`` where something is wrong with it by itself."""
        if kind is Kind.MISSION:
            return read_step(item, self._site.locate)
        if kind is Kind.RALLY:
            return read_rally(item, self._site.locate)
        check_fence_item(item, self._site.locate)
        return None

    def keep(
        self,
        kind: Kind,
        items: tuple[MissionItem, ...],
        meanings: tuple[Meaning, ...],
        source: MessageSource | None = None,
    ) -> tuple[str, ...]:
        """Put a whole upload in the place of the old one; ``BadItem`` leaves that.

        Returns what the operator should know of it all the same.
        """
        remarks: tuple[str, ...] = ()
        if kind is Kind.MISSION:
            steps = tuple(step for step in meanings if isinstance(step, MissionStep))
            wrong = mission_problem(steps)
            if wrong is not None:
                raise BadItem(INVALID, f"item {wrong[0]}: {wrong[1]}")
            remarks = mission_remarks(items, steps, self._snapshot, self._site.ceiling())
            self._steps = steps
            self._change(MissionUpdate(steps=steps, current=0 if steps else None))
        elif kind is Kind.RALLY:
            places = tuple(place for place in meanings if isinstance(place, tuple))
            self._change(MissionUpdate(rally=places))
        else:
            fence = self._fence(items, source)
            entitled = self._may_grow(source)
            self._kept_fence = (fence, source if entitled else self._kept_fence[1])
            self._change(MissionUpdate(fence=fence, fence_source=source))
        self.items[kind] = items
        self.ids[kind] = _identity(items)
        if kind is Kind.RALLY:
            return ()
        return remarks + fence_remarks(self._steps, self._kept_fence[0], self._snapshot)

    def clear(self, kinds: tuple[Kind, ...], source: MessageSource | None = None) -> None:
        """Clear all of these lists; ``BadItem`` leaves every one of them as it is."""
        if Kind.FENCE in kinds:
            self._fence((), source)  # the only one that may be refused
        for kind in kinds:
            self.keep(kind, (), (), source)

    def set_current(self, number: int) -> bool:
        """Make a step the current one; False where there is no such step."""
        if not 0 <= number < len(self.items[Kind.MISSION]):
            return False
        self._change(MissionUpdate(current=number))
        return True

    def take_update(self) -> MissionUpdate | None:
        """Hand over what changed."""
        taken, self._update = self._update, None
        return taken

    def _may_grow(self, source: MessageSource | None) -> bool:
        """As the tick will see it: on the ground every source, in flight the fence's owner."""
        flies = self._snapshot is not None and self._snapshot.armed and not self._snapshot.landed
        return not flies or may_grow_fence(self._kept_fence[1], source, self._site.owner())

    def _fence(self, items: tuple[MissionItem, ...], source: MessageSource | None) -> SafeSet:
        fence = read_fence(items, self._site.locate, self._site.clearance())
        problem = safe_set_problem(fence)
        if problem is not None:
            raise BadItem(DENIED, problem)
        grown = "" if self._may_grow(source) else growth(self._kept_fence[0], fence)
        if grown:
            raise BadItem(DENIED, f"{grown}, which {self._kept_fence[1]} owns")
        against = self._site.judge(fence)
        if against:
            raise BadItem(DENIED, f"the fence cannot be kept: {'; '.join(against)}")
        if self._snapshot is not None:
            self._refuse_outside(fence, self._snapshot)
        return fence

    def _refuse_outside(self, fence: SafeSet, seen: FlightSnapshot) -> None:
        """Refuse a fence that leaves the vehicle outside.

        Armed, all of the vehicle counts, as for the failsafe that would act at once, and perhaps
        stop the rotors. Disarmed, none acts, and the base's place is enough.
        """
        if seen.armed:
            margin = self._site.min_margin(fence, seen)
            if not margin >= 0.0:
                reason = f"the vehicle would be outside the fence by {-1e3 * margin:.1f} mm"
                raise BadItem(DENIED, reason)
            return
        estimate = seen.estimate
        for number, at in enumerate(surfaces(fence, estimate.p_WB, estimate.t_us)):
            if not at.distance > 0.0:
                wall = fence.zones[number].shape.kind == "half-space"
                where = "not inside the fence" if wall else "excluded"
                raise BadItem(
                    DENIED,
                    f"the vehicle is {where}: {-at.distance:.2f} m beyond the clearance of "
                    f"wall or cylinder {number}",
                )

    def _change(self, update: MissionUpdate) -> None:
        waiting = self._update
        if waiting is not None:
            update = replace(
                waiting,
                **{
                    name: value
                    for name in ("steps", "fence", "rally", "current", "fence_source")
                    if (value := getattr(update, name)) is not None
                },
            )
        self._update = update
