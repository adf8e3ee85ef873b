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

from collections import Counter

from fsw.autopilot.shapes import kind_of
from fsw.autopilot.shapes.zones import surfaces
from fsw.autopilot.signals import SafeSet, Shape, Touch, Vec3, Zone


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
    return Zone(Shape(zone.shape.kind, moved), zone.clearance, zone.keep_in, touch=zone.touch)


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


def _look(zone: Zone) -> tuple[str, float, bool, Touch | None]:
    return zone.shape.kind, zone.clearance, zone.keep_in, zone.touch


def _implies(new: Zone, old: Zone) -> bool:
    """Whether a place that is safe of the new zone is safe of the old one, as far as is shown."""
    if (new.velocity, new.keep_in) != (old.velocity, old.keep_in):
        return False
    if not _touches_no_more(new.touch, old.touch):
        return False
    if is_moving(new) and new.t_us != old.t_us:
        return False
    if new.shape == old.shape:
        return new.clearance >= old.clearance
    if new.shape.kind == old.shape.kind and kind_of(new.shape).covers(new, old):
        return True
    return not old.keep_in and _holds_ball_around(new, old)


def _touches_no_more(new: Touch | None, old: Touch | None) -> bool:
    """Whether the tool may touch nothing that it might not before, nor press harder."""
    if new is None or new == old:
        return True
    return old is not None and new == old._replace(force_max=min(new.force_max, old.force_max))


def _holds_ball_around(new: Zone, old: Zone) -> bool:
    """Whether a ball around all of the old zone, clearance included, is forbidden by the new."""
    around = kind_of(old.shape).ball_around(old.shape.numbers)
    if around is None or kind_of(new.shape).follows_target:
        return False
    centre, radius = around
    (at,) = surfaces(SafeSet((new,)), centre, new.t_us)
    return at.distance <= -(radius + old.clearance)


def _change(old: Zone, zones: tuple[Zone, ...]) -> str:
    """What became of a zone that nothing implies any more, as far as can be seen."""
    for new in zones:
        if new.shape == old.shape and new.clearance < old.clearance:
            return f"loses {1e3 * (old.clearance - new.clearance):.1f} mm of clearance"
    for new in zones:
        if new.shape == old.shape and not _touches_no_more(new.touch, old.touch):
            return "may be touched, or pressed harder"
    before = _reach(old)
    if before is not None:
        normal, reach = before
        reaches = [one[1] for one in map(_reach, zones) if one is not None and one[0] == normal]
        if reaches:
            return f"moves out by {1e3 * (reach - max(reaches)):.1f} mm"
    return "is removed, moved or turned"


def _reach(zone: Zone) -> tuple[Vec3, float] | None:
    """Normal [1, NED] and how far [m] along it a flat zone to keep out of reaches."""
    if zone.keep_in or not kind_of(zone.shape).flat:
        return None
    (at,) = surfaces(SafeSet((zone,)), (0.0, 0.0, 0.0), zone.t_us)
    return at.normal, zone.clearance - at.distance
