"""What an operator should know of a mission that is accepted: at the upload, not at the start.

Which items are skipped, that it cannot start from the ground, and which legs leave the fence.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from fsw.autopilot.flight.mission import sequencer as mission_sequencer
from fsw.autopilot.shapes.half_space import KIND as HALF_SPACE
from fsw.autopilot.shapes.vertical_cylinder import KIND as VERTICAL_CYLINDER
from fsw.autopilot.signals import FlightSnapshot, MissionAction, MissionStep, SafeSet, Vec2, Zone
from fsw.link.wire.mission_items import SKIPPED, MissionItem, command_name

_NAMED: Final = 4  # of a kind; the others are counted
_PLACES: Final = (MissionAction.GO, MissionAction.CIRCLE, MissionAction.LAND, MissionAction.PUSH)


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
