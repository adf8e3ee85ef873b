"""The vehicle as something with a size: what of it must keep clear.

Two bodies: ``points`` are the critical points, without a size; ``full`` has the spheres and
capsules of the vehicle's file and a disc around the rotors. Each part is rigid on the base or on a
link and is kept from a surface by probes: points of it, one row of the planner's program each.

=======  ==========================================================================
part     probes
=======  ==========================================================================
sphere   its centre
capsule  the place between its ends that is nearest (the ends are spheres of others)
disc     four places of the rim, the first of them nearest
=======  ==========================================================================
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.model.multibody import Bodies
from fsw.autopilot.model.parts import ON_BASE, Part
from fsw.autopilot.signals import Vec3
from fsw.compiled import kernel, machine_code
from fsw.frozen import Remembered

BodyName = Literal["points", "full"]
BODIES: Final[tuple[BodyName, ...]] = ("points", "full")

SPHERE, CAPSULE, DISC = 0, 1, 2
_RIM_PLACES = 4


# Columns of a probe's row, for kernels.
PART, FORM, ON, BEGIN, END, RADIUS, RIM, TURN, TOOL, OTHER = 0, 1, 2, 3, 6, 9, 10, 11, 12, 13
"""Index of its part; SPHERE, CAPSULE or DISC; what it is on; begin and end (3 each), radius, rim
[m]; angle along the rim from the nearest place [rad]; whether it is of the tool, and how many parts
before it are not."""


Probes = NDArray[np.float64]
"""A row a probe (probes, 14) [SI], with those columns."""


Hull = NDArray[np.float64]
"""A row a place (places, 3) [m]: a radius, how far it is off the vertical axis, and how low."""
NO_HULL: Final[Hull] = np.zeros((1, 3))


@dataclass(frozen=True, slots=True)
class Body:
    """Parts, of which the first is at the body's origin."""

    name: BodyName
    parts: tuple[Part, ...]

    @property
    def probes(self) -> Probes:
        """In the order of the parts."""
        rows, others = [], 0
        for k, part in enumerate(self.parts):
            form = DISC if part.rim > 0.0 else SPHERE if part.end is None else CAPSULE
            ends = (*part.begin, *(part.end or part.begin))
            for turn in range(_RIM_PLACES if form == DISC else 1):
                angle = 2.0 * math.pi * turn / _RIM_PLACES
                place = (k, form, part.on, *ends, part.radius, part.rim, angle)
                rows.append((*place, part.tool, others))
            others += not part.tool
        return np.array(rows, dtype=np.float64)


def tool_radius(body: Body) -> float:
    """Radius of the ball about the end-effector [m]; 0 for a body of points."""
    return max((part.radius for part in body.parts if part.tool and part.end is None), default=0.0)


def reaches(body: Body, bodies: Bodies) -> tuple[float, ...]:
    """How far any place of a body can be from the base, and from each joint that moves it [m].

    In any posture: a tuple (1 + j,), that of the base first.
    """
    reach = [_extent(body, ON_BASE + bodies.joints)]
    for on in range(bodies.joints, 0, -1):
        offset = math.hypot(*bodies.offset[3 * on - 3 : 3 * on])
        reach.append(max(_extent(body, on - 1), offset + reach[-1]))
    return tuple(reversed(reach))


def _extent(body: Body, on: int) -> float:
    """How far from the origin of what they are on the places of parts are [m], at most."""
    return max(
        (
            math.hypot(*place) + part.rim
            for part in body.parts
            if part.on == on
            for place in (part.begin, part.end or part.begin)
        ),
        default=0.0,
    )


def body_of(name: BodyName, airframe: Airframe) -> Body:
    """The body of a name."""
    return Body(name, airframe.points if name == "points" else airframe.parts)


@Remembered
def hull_of(body: Body) -> Hull:
    """The base and what is rigid on it."""
    return np.array(
        [
            (part.radius, math.hypot(x, y) + part.rim, z)
            for part in body.parts
            if part.on == ON_BASE
            for x, y, z in (part.begin, part.end or part.begin)
        ]
    )


@kernel
def hull_reach_at(hull: Hull, normal: Vec3) -> float:
    """``hull_reach`` of a ``hull`` (places, 3) [m], against a ``normal`` [1, NED]."""
    level, reach = math.hypot(normal[0], normal[1]), -math.inf
    for k in range(len(hull)):
        reach = max(reach, hull[k, 0] + level * hull[k, 1] - normal[2] * hull[k, 2])
    return reach


_hull_reach = machine_code(hull_reach_at)


def hull_reach(body: Body, normal: Vec3) -> float:
    """How far the base and what is rigid on it reach against a ``normal`` [1, NED], level [m].

    Whatever the yaw is; 0 for a body of points.
    """
    return _hull_reach(hull_of(body), normal)
