"""What was uploaded: mission, fence and rally points, shared by every link.

Handed to the tick as what it means; kept as it came once the tick has taken it, so that a download
returns bit for bit what is in force. The tick judges alone: what is acknowledged is in force. It
lives as long as the process (docs/decisions/0013-missions-stop-and-fences-are-walls.md).
"""

from __future__ import annotations

import math
import struct
import zlib
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

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

Meaning = MissionStep | Vec2 | None
"""What one item means; a fence item means something only in its shape."""


class Kind(IntEnum):
    """Values of MAV_MISSION_TYPE."""

    MISSION = 0
    FENCE = 1
    RALLY = 2


_NO_PROGRESS: Final = MissionProgress()
_ITEM: Final = struct.Struct("<HBB4fiif")
ALL_KINDS: Final = 255  # MAV_MISSION_TYPE_ALL
ROOM: Final = {Kind.MISSION: 500, Kind.FENCE: 64, Kind.RALLY: 16}
WAITING: Final = 16  # uploads; a tick takes one
ACCEPTED: Final = 0  # MAV_MISSION_RESULT
ERROR: Final = 1

List = tuple[tuple[MissionItem, ...], tuple[Meaning, ...]]
"""Items, and what each of them means."""
EMPTY: Final[List] = ((), ())


@dataclass(frozen=True, slots=True)
class Site:
    """Where missions are flown."""

    locate: Locate
    clearance: Callable[[], float]  # m, from the walls of a fence uploaded now
    ceiling: Callable[[], float] = lambda: math.inf  # m above the origin


@dataclass(eq=False, slots=True)
class Upload:
    """Lists that take the place of the old ones: the tick takes all of them, or none."""

    items: Mapping[int, tuple[MissionItem, ...]]  # by MAV_MISSION_TYPE
    update: MissionUpdate
    result: int | None = None  # MAV_MISSION_RESULT; None: the tick has not decided
    remarks: tuple[str, ...] = ()  # what the operator should know of it though it is accepted

    def identity(self, number: int) -> int:
        """What the list of a MAV_MISSION_TYPE is known by: a checksum of the upload, as in PX4.

        0 where it has none of that, or an empty one, so no other list has it.
        """
        items = self.items.get(number, ())
        packed = (
            _ITEM.pack(one.command, one.frame, one.autocontinue, *one.params, one.x, one.y, one.z)
            for one in items
        )
        return (zlib.crc32(b"".join(packed)) or 1) if items else 0


class MissionStore:
    """The three lists in force, and what the tick has yet to decide on."""

    def __init__(self, site: Site) -> None:
        self.ids: dict[int, int] = dict.fromkeys(Kind, 0)  # see ``PlanIds``
        self.items: dict[int, tuple[MissionItem, ...]] = dict.fromkeys(Kind, ())
        self._site = site
        self._snapshot: FlightSnapshot | None = None
        self._steps: tuple[MissionStep, ...] = ()  # of the mission
        self._fence = SafeSet()
        self._waiting: deque[Upload] = deque()
        self._offered: Upload | None = None  # to the tick
        self._current: int | None = None  # the step to fly next

    def observe(self, snapshot: FlightSnapshot) -> None:
        """See the vehicle after a tick."""
        self._snapshot = snapshot

    @property
    def progress(self) -> MissionProgress:
        """How far the mission is."""
        return _NO_PROGRESS if self._snapshot is None else self._snapshot.mission

    @property
    def in_mission(self) -> bool:
        """Whether it is being flown."""
        return self._snapshot is not None and self._snapshot.mode is Mode.MISSION

    def read(self, kind: Kind, item: MissionItem) -> Meaning:
        """What an item means; ``BadItem`` where something is wrong with it by itself."""
        if kind is Kind.MISSION:
            return read_step(item, self._site.locate)
        if kind is Kind.RALLY:
            return read_rally(item, self._site.locate)
        check_fence_item(item, self._site.locate)
        return None

    def offer(self, lists: Mapping[Kind, List], source: MessageSource | None = None) -> Upload:
        """Offer whole lists to a tick, which decides on all of them at once; in order of arrival.

        Raises:
            BadItem: The items of a fence are no shapes, or too many uploads wait.
        """
        if len(self._waiting) >= WAITING:
            raise BadItem(ERROR, "too many uploads at once")
        steps: tuple[MissionStep, ...] | None = None
        fence: SafeSet | None = None
        rally: tuple[Vec2, ...] | None = None
        for kind, (items, meanings) in lists.items():
            if kind is Kind.MISSION:
                steps = tuple(step for step in meanings if isinstance(step, MissionStep))
                self._current = None  # it was of the mission before
            elif kind is Kind.RALLY:
                rally = tuple(place for place in meanings if isinstance(place, tuple))
            else:
                fence = read_fence(items, self._site.locate, self._site.clearance())
        update = MissionUpdate(steps, fence, rally, 0 if steps else None, source)
        upload = Upload({kind: items for kind, (items, _) in lists.items()}, update)
        self._waiting.append(upload)
        return upload

    def set_current(self, number: int) -> bool:
        """Make a step the current one; False where there is no such step."""
        if not 0 <= number < len(self.items[Kind.MISSION]):
            return False
        self._current = number
        return True

    def take_update(self) -> MissionUpdate | None:
        """What the next tick is to take over, if anything."""
        if self._waiting:
            self._offered = self._waiting.popleft()
            return self._offered.update
        if self._current is None:
            return None
        number, self._current = self._current, None
        return MissionUpdate(current=number)

    def settle(self, taken: bool | None) -> None:
        """Learn whether the tick took its update; None where it failed before it came to that."""
        upload, self._offered = self._offered, None
        if upload is None:
            return  # the current step alone
        if not taken:
            refused = INVALID if upload.update.steps else DENIED
            upload.result = ERROR if taken is None else refused
            return
        update = upload.update
        self._steps = self._steps if update.steps is None else update.steps
        self._fence = self._fence if update.fence is None else update.fence
        self.items.update(upload.items)
        self.ids.update({kind: upload.identity(kind) for kind in upload.items})
        upload.remarks = tuple(self._remarks(upload))
        upload.result = ACCEPTED

    def _remarks(self, upload: Upload) -> Iterable[str]:
        if upload.update.steps is not None:
            items, ceiling = upload.items[Kind.MISSION], self._site.ceiling()
            yield from mission_remarks(items, self._steps, self._snapshot, ceiling)
        if upload.update.steps is not None or upload.update.fence is not None:
            yield from fence_remarks(self._steps, self._fence, self._snapshot)
