"""The planes of one shape near one point, by the machine code that flies."""

from __future__ import annotations

from fsw.autopilot.shapes import kind_of
from fsw.autopilot.shapes.kind import Surface
from fsw.autopilot.shapes.zones import surface_at, zone_arrays
from fsw.autopilot.signals import SafeSet, Shape, Vec3, Zone
from fsw.compiled import machine_code

_surface_at = machine_code(surface_at)


def outside(shape: Shape, p: Vec3) -> Surface:
    """The plane that keeps a point out."""
    return Surface(*_surface_at(zone_arrays(SafeSet((Zone(shape, 0.0),))), 0, 0, *p))


def inside(shape: Shape, p: Vec3) -> tuple[Surface, ...]:
    """The planes that keep a point in."""
    zones = zone_arrays(SafeSet((Zone(shape, 0.0, keep_in=True),)))
    count = kind_of(shape).planes_inside
    return tuple(Surface(*_surface_at(zones, 0, which, *p)) for which in range(count))
