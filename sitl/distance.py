"""Exact distances between the parts of a body and the shapes of zones.

A shape gives the signed distance of a point, which is convex in the point, and the normal there.
The distance of a part is the least over its points. Balls and keeping inside need no search, a
capsule one along its axis. A rotor is searched over the cylinder that it sweeps: every point
with its normal bounds the distance from below as well, which tells when the search is over. If it
does not end, nested golden sections find the minimum in any case.
"""

from __future__ import annotations

import math

from sitl.body import BALL, CAPSULE, SHAFT, Parts
from sitl.compiled import compilable, kernel
from sitl.nearest import nearest
from sitl.plant.vector import V3, Array, add, dot, row, scale, sub

_EXACT = 1e-6  # m, of a rotor's distance
_STEPS = 40
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
_SAMPLES = 48  # of a rotor's rim


@kernel
def _end(parts: Parts, b: int, touch: bool, places: Array) -> V3:
    """The end of capsule ``b``; of a shaft where it may ``touch``, that of the rest of it."""
    end = _place(parts, b, 1, places)
    if touch and parts.tool[b] == SHAFT:
        begin = _place(parts, b, 0, places)
        end = add(end, scale(parts.cut[b], sub(begin, end)))
    return end


@kernel
def _place(parts: Parts, b: int, end: int, places: Array) -> V3:
    p = row(places, parts.row[b, end])
    if parts.rigid[b]:
        p = add(p, _turned(parts, places, row(parts.local[b], end)))
    return p


@kernel
def _turned(parts: Parts, places: Array, v: V3) -> V3:
    """A vector v [any unit, B] in W, by the base's axes in places (rows, 3) [m, NED]."""
    turned = (0.0, 0.0, 0.0)
    for i in range(3):
        turned = add(turned, scale(v[i], row(places, parts.axes + i)))
    return turned


@kernel
def part_bound(
    kind: int,
    numbers: Array,
    keep_in: bool,
    shift: V3,
    parts: Parts,
    b: int,
    places: Array,
    touch: bool = False,
) -> float:
    """Below the distance [m] of part ``b`` to the surface; that distance itself for a ball.

    For places (rows, 3) [m, NED] and a shape of ``numbers`` (16,) [m, NED] that has moved by shift
    [m, NED]; negative beyond the surface. Of a zone that the tool may ``touch``, the end of its
    shaft is left out.
    """
    begin = _place(parts, b, 0, places)
    reach = float(parts.radius[b])
    middle = begin
    if parts.form[b] == CAPSULE:
        end = _end(parts, b, touch, places)
        middle = scale(0.5, add(begin, end))
        half = sub(end, middle)
        reach += math.sqrt(dot(half, half))
    elif parts.form[b] != BALL:
        reach = math.sqrt(reach * reach + parts.half_height[b] * parts.half_height[b])
    d = nearest(kind, numbers, sub(middle, shift)).distance
    return (-d if keep_in else d) - reach


@kernel
def part_distance(
    kind: int,
    numbers: Array,
    keep_in: bool,
    shift: V3,
    parts: Parts,
    b: int,
    places: Array,
    touch: bool = False,
) -> float:
    """Distance [m] of part ``b`` to the surface, negative beyond it.

    For places (rows, 3) [m, NED] and a shape of ``numbers`` (16,) [m, NED] that has moved by shift
    [m, NED], and may be touched or not, as for ``part_bound``.
    """
    form, radius = parts.form[b], float(parts.radius[b])
    begin = sub(_place(parts, b, 0, places), shift)
    if form == BALL:
        d = nearest(kind, numbers, begin).distance
        return (-d if keep_in else d) - radius
    if form == CAPSULE:
        end = sub(_end(parts, b, touch, places), shift)
        if keep_in:
            d = max(nearest(kind, numbers, begin).distance, nearest(kind, numbers, end).distance)
            return -d - radius
        return along_segment(kind, numbers, begin, end) - radius
    axis = _turned(parts, places, row(parts.axis, b))
    if keep_in:
        return -farthest_of_rotor(kind, numbers, begin, axis, radius, parts.half_height[b])
    return of_rotor(kind, numbers, begin, axis, radius, parts.half_height[b])


@kernel
def along_segment(kind: int, numbers: Array, begin: V3, end: V3) -> float:
    """The least distance [m] between ``begin`` [m, NED] and ``end`` [m, NED] to a shape.

    Of ``numbers`` (16,) [m, NED].
    """
    whole = sub(end, begin)
    low, high = 0.0, 1.0
    a, b = 1.0 - _GOLDEN, _GOLDEN
    at_a = nearest(kind, numbers, add(begin, scale(a, whole))).distance
    at_b = nearest(kind, numbers, add(begin, scale(b, whole))).distance
    for _ in range(40):  # 4e-9 of the length
        if at_a <= at_b:
            high, b, at_b = b, a, at_a
            a = high - _GOLDEN * (high - low)
            at_a = nearest(kind, numbers, add(begin, scale(a, whole))).distance
        else:
            low, a, at_a = a, b, at_b
            b = low + _GOLDEN * (high - low)
            at_b = nearest(kind, numbers, add(begin, scale(b, whole))).distance
    ends = min(nearest(kind, numbers, begin).distance, nearest(kind, numbers, end).distance)
    return min(ends, at_a, at_b)


@compilable
def _into_rotor(hub: V3, axis: V3, radius: float, half: float, p: V3) -> V3:
    """The place of a rotor nearest to p."""
    away = sub(p, hub)
    along = dot(away, axis)
    across = sub(away, scale(along, axis))
    length = math.sqrt(dot(across, across))
    share = 1.0 if length <= radius else radius / length
    return add(hub, add(scale(min(max(along, -half), half), axis), scale(share, across)))


@kernel
def of_rotor(kind: int, numbers: Array, hub: V3, axis: V3, radius: float, half: float) -> float:
    """Distance [m] of a rotor to a shape of ``numbers`` (16,) [m, NED].

    About ``axis`` [1, NED] at hub [m, NED], with ``radius`` [m] and ``half`` its height [m].
    """
    here = hub
    at = nearest(kind, numbers, here)
    upper, lower = at.distance, -math.inf
    for _ in range(_STEPS):
        n = (at.nx, at.ny, at.nz)
        tilt = dot(n, axis)
        across = math.sqrt(max(1.0 - tilt * tilt, 0.0))
        # No place of the rotor is farther against this normal.
        least = dot(n, sub(hub, here)) - half * abs(tilt) - radius * across
        lower = max(lower, at.distance + least)
        if upper - lower <= _EXACT:
            return upper
        best, best_at = here, at
        step = max(at.distance, 0.25 * radius)
        for _ in range(6):
            for sign in range(2):
                size = step if sign == 0 else 0.0625 * step
                tried = _into_rotor(hub, axis, radius, half, sub(here, scale(size, n)))
                seen = nearest(kind, numbers, tried)
                if seen.distance < best_at.distance:
                    best, best_at = tried, seen
            step *= 4.0 if at.distance > 0.25 * radius else 0.5
        if not best_at.distance < at.distance - 1e-9:
            break
        here, at = best, best_at
        upper = min(upper, at.distance)
    return min(upper, _searched(kind, numbers, hub, axis, radius, half))


@kernel
def _across(axis: V3) -> tuple[V3, V3]:
    """Two unit vectors that are normal to an axis and to each other."""
    x = sub((1.0, 0.0, 0.0), scale(axis[0], axis))
    if abs(axis[0]) > 0.7:
        x = sub((0.0, 1.0, 0.0), scale(axis[1], axis))
    x = scale(1.0 / math.sqrt(dot(x, x)), x)
    y = (
        axis[1] * x[2] - axis[2] * x[1],
        axis[2] * x[0] - axis[0] * x[2],
        axis[0] * x[1] - axis[1] * x[0],
    )
    return x, y


@kernel
def _searched(kind: int, numbers: Array, hub: V3, axis: V3, radius: float, half: float) -> float:
    """The same by golden sections along the axis, across it, and across both."""
    x, y = _across(axis)
    low, high = -half, half
    a, b = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    at_a = _on_disc(kind, numbers, add(hub, scale(a, axis)), x, y, radius)
    at_b = _on_disc(kind, numbers, add(hub, scale(b, axis)), x, y, radius)
    for _ in range(20):
        if at_a <= at_b:
            high, b, at_b = b, a, at_a
            a = high - _GOLDEN * (high - low)
            at_a = _on_disc(kind, numbers, add(hub, scale(a, axis)), x, y, radius)
        else:
            low, a, at_a = a, b, at_b
            b = low + _GOLDEN * (high - low)
            at_b = _on_disc(kind, numbers, add(hub, scale(b, axis)), x, y, radius)
    bottom = _on_disc(kind, numbers, sub(hub, scale(half, axis)), x, y, radius)
    top = _on_disc(kind, numbers, add(hub, scale(half, axis)), x, y, radius)
    return min(at_a, at_b, bottom, top)


@compilable
def _on_disc(kind: int, numbers: Array, centre: V3, x: V3, y: V3, radius: float) -> float:
    low, high = -radius, radius
    a, b = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    at_a = _on_chord(kind, numbers, centre, x, y, radius, a)
    at_b = _on_chord(kind, numbers, centre, x, y, radius, b)
    for _ in range(28):
        if at_a <= at_b:
            high, b, at_b = b, a, at_a
            a = high - _GOLDEN * (high - low)
            at_a = _on_chord(kind, numbers, centre, x, y, radius, a)
        else:
            low, a, at_a = a, b, at_b
            b = low + _GOLDEN * (high - low)
            at_b = _on_chord(kind, numbers, centre, x, y, radius, b)
    return min(at_a, at_b)


@compilable
def _on_chord(
    kind: int, numbers: Array, centre: V3, x: V3, y: V3, radius: float, at: float
) -> float:
    middle = add(centre, scale(at, x))
    half = scale(math.sqrt(max(radius * radius - at * at, 0.0)), y)
    return along_segment(kind, numbers, sub(middle, half), add(middle, half))


@kernel
def farthest_of_rotor(
    kind: int, numbers: Array, hub: V3, axis: V3, radius: float, half: float
) -> float:
    """How far [m] a rotor reaches out of a shape of ``numbers`` (16,) [m, NED]; see ``of_rotor``.

    About ``axis`` [1, NED] at hub [m, NED], with ``radius`` [m] and ``half`` its height [m]. A
    convex distance is largest on a rim.
    """
    x, y = _across(axis)
    farthest = -math.inf
    for side in range(2):
        centre = add(hub, scale(half if side else -half, axis))
        spacing = 2.0 * math.pi / _SAMPLES
        best, angle = -math.inf, 0.0
        for k in range(_SAMPLES):
            d = _at_rim(kind, numbers, centre, x, y, radius, k * spacing)
            if d > best:
                best, angle = d, k * spacing
        low, high = angle - spacing, angle + spacing
        for _ in range(30):
            a, b = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
            at_a = _at_rim(kind, numbers, centre, x, y, radius, a)
            at_b = _at_rim(kind, numbers, centre, x, y, radius, b)
            best = max(best, at_a, at_b)
            if at_a >= at_b:
                high = b
            else:
                low = a
        farthest = max(farthest, best)
    return farthest


@compilable
def _at_rim(
    kind: int, numbers: Array, centre: V3, x: V3, y: V3, radius: float, angle: float
) -> float:
    rim = add(scale(radius * math.cos(angle), x), scale(radius * math.sin(angle), y))
    return nearest(kind, numbers, add(centre, rim)).distance
