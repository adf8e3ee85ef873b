r"""How far a bounded disturbance moves the parts of the base off their plan: the tube and its tilt.

The loop pushes back by tilting. A place z below the base and r aside moves, along a normal with
the level part c and the vertical part s, by

.. math:: c\,p - (c\,z \pm s\,r)\,a / g

of the base's deviation p and the acceleration a of the thrust beyond the plan's. The worst of it is
the sum over the response to a push, as for the base alone (``tube.py``): the tilt is at its most
while the base is not, and both count at their own times.

Source: docs/equations.md T4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from fsw.autopilot.control.gains import TrackingTuning
from fsw.autopilot.control.tube import RARE, WIND_COVERED, impulse_responses, random_steps
from fsw.autopilot.model.airframe import GRAVITY, Airframe
from fsw.autopilot.model.body import Body
from fsw.autopilot.model.parts import ON_BASE, Part
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.signals import Vec2, Vec3

_DIRECTIONS = 13  # of a normal, from level to vertical
_BETWEEN = 0.5 * math.pi / (_DIRECTIONS - 1)  # rad


@dataclass(frozen=True, slots=True)
class PartReach:
    """The part that a disturbance on one horizontal axis can move furthest towards a normal."""

    name: str
    worst: float  # m
    expected: float  # m, 3.7 sigma under random steps


@dataclass(frozen=True, slots=True)
class LoopOfParts:
    """What the reach of a part depends on beside the body: a loop, and what pushes it."""

    airframe: Airframe
    tuning: TrackingTuning
    disturbance: float  # m/s^2
    hold_s: float  # of a random one
    dt: float  # s, a tick


@lru_cache(maxsize=4)  # 15 ms, before flight; a safe set that changes in flight finds it here
def part_reaches(loop: LoopOfParts, body: Body) -> tuple[PartReach, ...]:
    """The furthest part of the base towards normals from level to vertical, at equal angles.

    Capsules end in spheres of the body, and reach no further. The body is level, at any yaw.
    """
    push, wind = _responses(loop, wind=False), _responses(loop, wind=True)
    found = []
    for k in range(_DIRECTIONS):
        ways = _ways(body, math.cos(k * _BETWEEN), math.sin(k * _BETWEEN))
        worst, name, way = max(
            (_worst(loop, push @ way, wind @ way), name, way) for name, way in ways
        )
        random = random_steps(push @ way, round(loop.hold_s / loop.dt))
        found.append(PartReach(name, worst, RARE * loop.disturbance * random))
    return tuple(found)


def towards(reaches: tuple[PartReach, ...], normal: Vec3) -> PartReach:
    """The reach towards a ``normal`` [1, NED]; between two angles a bound, as it is convex."""
    angle = math.atan2(abs(normal[2]), math.hypot(normal[0], normal[1])) / _BETWEEN
    low, high = math.floor(angle + 1e-6), math.ceil(angle - 1e-6)
    most = max(reaches[low], reaches[high], key=lambda reach: reach.worst)
    if low == high:
        return most
    wider = 1.0 / math.cos(0.5 * _BETWEEN)
    return PartReach(most.name, most.worst * wider, most.expected * wider)


def _ways(body: Body, level: float, vertical: float) -> list[tuple[str, Vec2]]:
    """How far each part moves with the base's deviation and acceleration."""
    return [
        (
            part.name,
            (level, -(level * part.begin[2] + sign * vertical * _aside(part)) / GRAVITY),
        )
        for part in body.parts
        if part.on == ON_BASE and part.end is None
        for sign in (1.0, -1.0)
    ]


def _aside(part: Part) -> float:
    return math.hypot(part.begin[0], part.begin[1]) + part.rim


def _worst(loop: LoopOfParts, push: Array, wind: Array) -> float:
    covered = min(loop.tuning.wind_limit, WIND_COVERED)
    worst = loop.disturbance * np.abs(push).sum() + covered * np.abs(wind).sum()
    return float(worst)


def _responses(loop: LoopOfParts, *, wind: bool) -> Array:
    """Position and acceleration after a unit push of one tick, a row per tick."""
    states = impulse_responses(loop.airframe, loop.tuning, loop.dt, wind=wind)
    return states[:, [0, 2]]
