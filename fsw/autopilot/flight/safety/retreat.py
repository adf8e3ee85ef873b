"""Where a vehicle goes that is outside its safe set: along the normals, until it is clear."""

from __future__ import annotations

from itertools import product

from fsw.autopilot.geometry.vectors import add_scaled
from fsw.autopilot.model.body import hull_reach
from fsw.autopilot.model.kinematics import frame_of, position
from fsw.autopilot.model.parts import ON_BASE
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.shapes.zones import surfaces
from fsw.autopilot.signals import SafeSet, StateEstimate, Vec3

_PASSES = 30  # one zone after the other; in a corner they have to settle
_TOLERANCE = 1e-3  # m
# m; from deeper than this the way out along a normal is a guess, and a step at a time is enough
_FARTHEST = 1.0


def retreat_place(
    config: FlightConfig, safe_set: SafeSet, estimate: StateEstimate, room: float
) -> Vec3:
    """A place for the base [m, NED] from which no zone is closer than ``room`` [m].

    The arm keeps its pose. A sphere that follows the target comes along
    and is left out. Between zones that leave no such place it is one in their middle.
    """
    frame, body = frame_of(config.airframe.bodies, estimate), config.body
    places: list[tuple[Vec3, float | None]] = [(estimate.p_WB, None)]  # None: the base's hull
    places += [
        (position(frame, part.on, part.begin), part.radius)
        for part in body.parts
        if part.on != ON_BASE and part.end is None
    ]
    zones = [SafeSet((zone,)) for zone in safe_set.zones]
    shift: Vec3 = (0.0, 0.0, 0.0)
    for _ in range(_PASSES):
        before = shift
        for zone, (p, radius) in product(zones, places):
            for at in surfaces(zone, add_scaled(p, shift, 1.0), estimate.t_us):
                reach = hull_reach(body, at.normal) if radius is None else radius
                shortfall = room - (at.distance - reach)
                if shortfall > _TOLERANCE:
                    shift = add_scaled(shift, at.normal, shortfall)
        if shift is before:
            break
    length = sum(value * value for value in shift) ** 0.5
    return add_scaled(estimate.p_WB, shift, min(1.0, _FARTHEST / max(length, _FARTHEST)))
