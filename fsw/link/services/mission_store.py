"""What was uploaded: mission, fence and rally points, shared by every link.

Handed to the tick as what it means; kept as it came once the tick has taken it, so that a download
returns bit for bit what is in force. The tick judges alone: what is acknowledged is in force. It
lives as long as the process (docs/decisions/0013-missions-stop-and-fences-are-walls.md). What an
operator should know of a mission that is accepted is said at the upload, not at the start.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from fsw.autopilot.flight.mission import sequencer as mission_sequencer
from fsw.autopilot.shapes.half_space import KIND as HALF_SPACE
from fsw.autopilot.shapes.vertical_cylinder import KIND as VERTICAL_CYLINDER
from fsw.autopilot.signals import (
    FlightSnapshot,
    MessageSource,
    MissionAction,
    MissionProgress,
    MissionStep,
    MissionUpdate,
    Mode,
    SafeSet,
    Vec2,
    Zone,
)
from fsw.link.wire.fence_items import check_fence_item, read_fence
from fsw.link.wire.mission_items import (
    DENIED,
    INVALID,
    SKIPPED,
    BadItem,
    Locate,
    MissionItem,
    command_name,
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
_NAMED: Final = 4  # of a kind; the others are counted
_PLACES: Final = (MissionAction.GO, MissionAction.CIRCLE, MissionAction.LAND, MissionAction.PUSH)

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


def mission_remarks(
    items: tuple[MissionItem, ...],
    steps: tuple[MissionStep, ...],
    seen: FlightSnapshot | None,
    ceiling: float,
) -> tuple[str, ...]:
    """What of a mission is not flown as it says, for the vehicle last ``seen``.

    Which items are skipped, whether it can start, and what is above the ``ceiling`` [m] over the
    origin.
    """
    skipped: dict[str, list[str]] = {}  # by the reason
    for number, (item, step) in enumerate(zip(items, steps, strict=True)):
        if step.action is MissionAction.SKIP:
            name = f"{number} {command_name(item.command)}"
            skipped.setdefault(SKIPPED[item.command], []).append(name)
    remarks = [
        f"mission items skipped, {reason}: {_listed(names)}" for reason, names in skipped.items()
    ]
    landed = seen is None or seen.landed
    against = mission_sequencer.refusal(mission_sequencer.loaded(steps), landed=landed)
    if steps and against is not None:
        remarks.append(f"mission accepted, but it cannot start: {against}")
    home = 0.0 if seen is None or seen.home is None else -seen.home.p[2]
    above = {
        number: (home if step.above_home else 0.0) - step.position[2] - ceiling
        for number, step in enumerate(steps)
        if step.position is not None
    }
    high = [f"{number} by {by:.2f} m" for number, by in above.items() if by > 0.0]
    if high:
        kept = f"above STR_ALT_MAX ({ceiling:g} m) at item {_listed(high)}: it is kept below"
        remarks.append(f"mission is {kept}")
    return tuple(remarks)


def fence_remarks(
    steps: tuple[MissionStep, ...], fence: SafeSet, seen: FlightSnapshot | None
) -> tuple[str, ...]:
    """Which legs of a mission leave the fence, from where the vehicle was last ``seen`` on."""
    start = None if seen is None else (seen.estimate.p_WB[0], seen.estimate.p_WB[1])
    outside: dict[int, float] = {}
    for number, begin, end in _legs(steps, start):
        # A circle bulges out of the straight leg to its centre by its radius.
        bulge = abs(steps[number].radius)
        margin = min((_min_margin(zone, begin, end) for zone in fence.zones), default=math.inf)
        if margin < bulge:
            outside[number] = max(outside.get(number, 0.0), bulge - margin)
    if not outside:
        return ()
    legs = [f"{number} by {by:.2f} m" for number, by in sorted(outside.items())]
    return (f"mission leaves the fence on the way to item {_listed(legs)}: it is kept inside",)


def _legs(steps: tuple[MissionStep, ...], start: Vec2 | None) -> Iterator[tuple[int, Vec2, Vec2]]:
    """Straight ways by the number of the step that they lead to, begin and end [m, NED].

    A jump is followed once: the way from before it to the place that follows its target.
    """
    at = start
    for number, step in enumerate(steps):
        if step.action is MissionAction.JUMP:
            first = _next_place(steps, step.target)
            if at is not None and first is not None:
                yield first[0], at, first[1]
            if step.repeats < 0:
                at = None  # what follows is reached by other ways alone
            continue
        place = _place_of(step)
        if place is not None:
            yield number, at or place, place
            at = place


def _next_place(steps: tuple[MissionStep, ...], number: int) -> tuple[int, Vec2] | None:
    for k in range(number, len(steps)):
        place = _place_of(steps[k])
        if place is not None:
            return k, place
    return None


def _place_of(step: MissionStep) -> Vec2 | None:
    if step.action not in _PLACES or step.position is None or step.here:
        return None
    return step.position[:2]


def _min_margin(zone: Zone, begin: Vec2, end: Vec2) -> float:
    """The least distance [m] that the way from ``begin`` to ``end`` [m, NED] has from a zone.

    A fence is made of upright walls and columns; the other shapes are none of its.
    """
    numbers, kind = zone.shape.numbers, zone.shape.kind
    if kind == HALF_SPACE.name:
        nearest = min(numbers[0] * p[0] + numbers[1] * p[1] for p in (begin, end))
        return nearest - numbers[3] - zone.clearance
    if kind != VERTICAL_CYLINDER.name:
        return math.inf
    way = (end[0] - begin[0], end[1] - begin[1])
    off = (numbers[0] - begin[0], numbers[1] - begin[1])
    square = way[0] * way[0] + way[1] * way[1]
    share = (off[0] * way[0] + off[1] * way[1]) / square if square > 0.0 else 0.0
    share = min(max(share, 0.0), 1.0)
    distance = math.hypot(off[0] - share * way[0], off[1] - share * way[1])
    return distance - numbers[4] - zone.clearance


def _listed(names: list[str]) -> str:
    rest = len(names) - _NAMED
    return ", ".join(names[:_NAMED]) + (f" and {rest} more" if rest > 0 else "")
