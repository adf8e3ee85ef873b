"""What of the vehicle is its tool, and the balls with which surfaces push at the vehicle.

The tip is a ball about the end-effector; the tool is every part of the last link that ends there.
"""

from __future__ import annotations

import math

from sitl.plant.vector import V3
from vehicles.description import Vehicle

_SAME: float = 1e-9  # m


def is_tip(vehicle: Vehicle, on: int, place: V3) -> bool:
    """Whether a ``place`` [m, link] on a body, 0 the base, is that of the end-effector."""
    there = math.dist(place, vehicle.end_effector.position) <= _SAME
    return on == len(vehicle.joints) and there


def tip_radius(vehicle: Vehicle) -> float:
    """Of the tip [m]: that of the thickest part that ends at the end-effector, 0 without one."""
    ends = [
        part.radius
        for part in vehicle.parts
        for end in (part.position, part.end)
        if end is not None and is_tip(vehicle, vehicle.places[part.on], end)
    ]
    return max(ends, default=0.0)


def balls_of(vehicle: Vehicle) -> tuple[tuple[int, V3, float], ...]:
    """Body, place in its frame [m] and radius [m] of every ball, the tip first.

    They are balls and ends of capsules; where several have one place, the largest.
    """
    found = {(len(vehicle.joints), vehicle.end_effector.position): tip_radius(vehicle)}
    for part in vehicle.parts:
        on = vehicle.places[part.on]
        for end in (part.position, part.end):
            if end is not None and not is_tip(vehicle, on, end):
                found[on, end] = max(part.radius, found.get((on, end), 0.0))
    return tuple((on, place, radius) for (on, place), radius in found.items())
