"""A circle is refused where the body has no room on it, and that is found within a tick."""

from __future__ import annotations

import math
from time import perf_counter

import numpy as np
import pytest

from fsw.autopilot.flight.commands.circle_room import circle_too_close
from fsw.autopilot.model.body import hull_reach
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.shapes.ball import ball
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.shapes.zones import surface
from fsw.autopilot.signals import SafeSet, Vec3, Zone
from fsw.compiled import IN_PYTHON

BODY = flight_config(body="full").body
CENTRE: Vec3 = (1.0, -2.0, -3.0)
SPHERE = target_sphere((0.0, 0.0, 0.0), 0.1)


def at_angle(angle: float, away: float) -> Zone:
    x, y, z = CENTRE
    return Zone(ball((x + away * math.cos(angle), y + away * math.sin(angle), z), 0.2), 0.1)


def room(safe_set: SafeSet, radius: float) -> float:
    """The least room of many places on the circle [m]."""
    least, (x, y, z) = math.inf, CENTRE
    for angle in np.linspace(0.0, 2.0 * math.pi, 2000):
        p = (x + radius * math.cos(angle), y + radius * math.sin(angle), z)
        at = surface(safe_set, 0, p, 0)
        assert at is not None
        least = min(least, at.distance - hull_reach(BODY, at.normal))
    return least


@pytest.mark.parametrize("zone", [at_angle(1.0, 4.0), wall((-1.0, 0.0, 0.0), -5.0, 0.1)])
def test_the_largest_circle_is_the_one_that_still_has_room(zone: Zone) -> None:
    def refused(radius: float) -> bool:
        return circle_too_close(CENTRE, radius, SafeSet((SPHERE, zone)), BODY, 0) == 1

    fits = [radius for radius in np.linspace(0.5, 3.9, 69) if not refused(radius)]
    most = max(fits)
    assert room(SafeSet((zone,)), most) > 0.0
    assert room(SafeSet((zone,)), most + 0.06) < 0.0


@pytest.mark.skipif(IN_PYTHON, reason="kernels as Python are as slow as it")
def test_beside_sixty_four_zones_it_takes_a_part_of_a_tick() -> None:
    """Flown: 130 ms each, and 16 of them at once stopped the vehicle's ticks."""
    zones = SafeSet(tuple(at_angle(0.1 * k, 4.2) for k in range(64)))
    took = []
    for _ in range(20):
        begin = perf_counter()
        assert circle_too_close(CENTRE, 3.2, zones, BODY, 0) is None
        took.append(perf_counter() - begin)
    assert min(took) < 0.01
