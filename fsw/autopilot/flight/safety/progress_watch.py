"""Whether the vehicle gets on: a zone in its way holds it without a word, however long it takes."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from fsw.autopilot.geometry.vectors import dot, norm
from fsw.autopilot.model.body import Body, hull_reach
from fsw.autopilot.shapes.zones import surface
from fsw.autopilot.signals import SafeSet, Severity, StateEstimate, StatusText, Vec3

_ASKED: Final = 0.15  # m; what asks for less is where it wants to be
_MOVED: Final = 0.1  # m that are progress
_WAITS_US: Final = 5_000_000
_NEAR: Final = 0.5  # m from the base; the arm may be what is held
_AGAINST: Final = 0.3  # cosine, of the way that is asked for and the way out of the zone


class ProgressMemory(NamedTuple):
    """Where the vehicle got on last."""

    place: Vec3 = (0.0, 0.0, 0.0)  # m, NED
    at_us: int = 0
    told: bool = False  # that it does not get on


def see_progress(
    memory: ProgressMemory,
    asked: Vec3,
    body: Body,
    safe_set: SafeSet,
    estimate: StateEstimate,
    texts: list[StatusText],
) -> ProgressMemory:
    """Look once a planning period; a text says which zone is in the way, once.

    ``asked`` [m, NED] is the way on from where the vehicle is.
    """
    p, now_us = estimate.p_WB, estimate.t_us
    if not norm(asked) > _ASKED or math.dist(p, memory.place) > _MOVED:
        return ProgressMemory(p, now_us)
    if memory.told or now_us - memory.at_us < _WAITS_US:
        return memory
    zone = _in_the_way(asked, body, safe_set, estimate)
    if zone is None:
        return memory._replace(at_us=now_us)
    which = f"zone {zone + 1} ({safe_set.zones[zone].shape.kind})"
    texts.append(StatusText(Severity.WARNING, f"no progress: blocked by {which}"))
    return memory._replace(told=True)


def _in_the_way(asked: Vec3, body: Body, safe_set: SafeSet, estimate: StateEstimate) -> int | None:
    """The nearest zone against which it is ``asked`` [m, NED] to go on."""
    near: list[tuple[float, int]] = []
    for zone in range(len(safe_set.zones)):
        at = surface(safe_set, zone, estimate.p_WB, estimate.t_us)
        if at is not None and -dot(at.normal, asked) > _AGAINST * norm(asked):
            near.append((at.distance - hull_reach(body, at.normal), zone))
    distance, nearest = min(near, default=(math.inf, 0))
    return nearest if distance < _NEAR else None
