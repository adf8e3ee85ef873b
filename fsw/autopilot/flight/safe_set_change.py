r"""What a change of the safe set does: whether it lets the vehicle go anywhere it could not before.

A change is a *shrink* if every place that is safe in the new set was safe in the old one. That is
shown zone by zone: each zone of the old set must be implied by a single one of the new set, such as

* a wall by a parallel one that is no further out, clearance included,
* anything bounded by a zone that holds the ball around it, clearance included,
* a column by a thicker one, a box or pipe by one of the same place and attitude that is no smaller,
* a sphere to stay in by one that lies in it.

What cannot be shown so counts as growth: a wall that turns by a hair, two zones that only together
cover a third, a zone that moves otherwise.
"""

from __future__ import annotations

import math
from collections import Counter

from fsw.autopilot.shapes import kind_of
from fsw.autopilot.shapes.zones import surfaces
from fsw.autopilot.signals import MAX_DISTANCE, SafeSet, Shape, Vec3, Zone

_ROUND = ("ball", "target sphere")


def growth(old: SafeSet, new: SafeSet) -> str:
    """Where ``new`` may let the vehicle go beyond ``old``, in words; empty if it is a shrink."""
    kept = frozenset(new.zones)
    for number, zone in enumerate(old.zones, start=1):
        if zone not in kept and not any(_implies(one, zone) for one in new.zones):
            return f"zone {number} ({zone.shape.kind}) {_change(zone, new.zones)}"
    return ""


def is_update(old: SafeSet, new: SafeSet) -> bool:
    """Whether only moving zones differ, and only in where they are and how fast they move."""
    return len(old.zones) == len(new.zones) and all(
        before == after or is_update_of(before, after)
        for before, after in zip(old.zones, new.zones, strict=True)
    )


def is_update_of(before: Zone, after: Zone) -> bool:
    """Whether both are one moving zone, as far as can be seen."""
    return is_moving(before) and is_moving(after) and _look(before) == _look(after)


def held(zone: Zone, after_us: int) -> Zone:
    """A moving zone, standing where it is so long after its time stamp."""
    vx, vy, vz = zone.velocity
    elapsed = 1e-6 * after_us
    moved = kind_of(zone.shape).moved(
        zone.shape.numbers, (elapsed * vx, elapsed * vy, elapsed * vz)
    )
    return Zone(Shape(zone.shape.kind, moved), zone.clearance, zone.keep_in)


def summary(safe_set: SafeSet) -> str:
    """What a safe set consists of, in words."""
    counts = Counter(zone.shape.kind for zone in safe_set.zones)
    parts = [f"{count} {_plural(kind) if count > 1 else kind}" for kind, count in counts.items()]
    return ", ".join(parts) or "nothing to keep clear of"


def _plural(kind: str) -> str:
    return f"{kind}es" if kind.endswith("x") else f"{kind}s"


def is_moving(zone: Zone) -> bool:
    """Whether a zone is somewhere else at another time."""
    return zone.velocity != (0.0, 0.0, 0.0)


def _look(zone: Zone) -> tuple[str, float, bool]:
    return zone.shape.kind, zone.clearance, zone.keep_in


def _implies(new: Zone, old: Zone) -> bool:
    """Whether a place that is safe of the new zone is safe of the old one, as far as is shown."""
    if (new.velocity, new.keep_in) != (old.velocity, old.keep_in):
        return False
    if is_moving(new) and new.t_us != old.t_us:
        return False
    if new.shape == old.shape:
        return new.clearance >= old.clearance
    if new.shape.kind == old.shape.kind and _covers(new, old):
        return True
    return not old.keep_in and _holds_ball_around(new, old)


def _covers(new: Zone, old: Zone) -> bool:
    """Whether the one of two zones of a kind covers the other, its clearance included."""
    kind, a, b = new.shape.kind, new.shape.numbers, old.shape.numbers
    no_closer = new.clearance >= old.clearance
    if kind == "half-space":
        sign = -1.0 if new.keep_in else 1.0
        return a[:3] == b[:3] and sign * a[3] + new.clearance >= sign * b[3] + old.clearance
    if kind in _ROUND and new.keep_in:
        return math.dist(a[:3], b[:3]) + a[3] - new.clearance <= b[3] - old.clearance
    if kind == "vertical cylinder" and not new.keep_in:
        apart = math.dist(a[:2], b[:2])
        high = a[2] <= max(b[2] - old.clearance, -MAX_DISTANCE)
        low = a[3] >= min(b[3] + old.clearance, MAX_DISTANCE)
        return high and low and apart + b[4] + old.clearance <= a[4] + new.clearance
    if kind == "box" and no_closer and (a[:3], a[6:]) == (b[:3], b[6:]):
        sizes = zip(a[3:6], b[3:6], strict=True)
        return all(x <= y if new.keep_in else x >= y for x, y in sizes)
    if kind == "cylinder" and no_closer and a[:6] == b[:6]:
        return a[6] <= b[6] if new.keep_in else a[6] >= b[6]
    return False


def _holds_ball_around(new: Zone, old: Zone) -> bool:
    """Whether a ball around all of the old zone, clearance included, is forbidden by the new."""
    around = _ball_around(old.shape)
    if around is None or new.shape.kind == "target sphere":
        return False
    centre, radius = around
    (at,) = surfaces(SafeSet((new,)), centre, new.t_us)
    return at.distance <= -(radius + old.clearance)


def _ball_around(shape: Shape) -> tuple[Vec3, float] | None:
    """Centre [m, NED] and radius [m] of a ball that holds a shape; None where none is known."""
    n = shape.numbers
    if shape.kind == "ball":
        return (n[0], n[1], n[2]), n[3]
    if shape.kind == "box":
        return (n[0], n[1], n[2]), math.hypot(n[3], n[4], n[5])
    if shape.kind == "cylinder":
        middle = (0.5 * (n[0] + n[3]), 0.5 * (n[1] + n[4]), 0.5 * (n[2] + n[5]))
        return middle, math.hypot(0.5 * math.dist(n[:3], n[3:6]), n[6])
    if shape.kind == "vertical cylinder":
        return (n[0], n[1], 0.5 * (n[2] + n[3])), math.hypot(0.5 * (n[3] - n[2]), n[4])
    return None


def _change(old: Zone, zones: tuple[Zone, ...]) -> str:
    """What became of a zone that nothing implies any more, as far as can be seen."""
    for new in zones:
        if new.shape == old.shape and new.clearance < old.clearance:
            return f"loses {1e3 * (old.clearance - new.clearance):.1f} mm of clearance"
    if old.shape.kind == "half-space" and not old.keep_in:
        reaches = [
            zone.shape.numbers[3] + zone.clearance
            for zone in zones
            if zone.shape.kind == "half-space" and zone.shape.numbers[:3] == old.shape.numbers[:3]
        ]
        if reaches:
            by = old.shape.numbers[3] + old.clearance - max(reaches)
            return f"moves out by {1e3 * by:.1f} mm"
    return "is removed, moved or turned"
