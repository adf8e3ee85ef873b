"""The vehicle as something with a size: what of it must keep clear.

Two bodies: ``points`` are the paper's three critical points, without a size; ``full`` has spheres
and capsules on hull, legs, links and tool and a disc around the rotors. Each part is rigid on the
base or on a link and is kept from a surface by probes: points of it, one row of the planner's
program each.

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
from fsw.autopilot.signals import Vec3

BodyName = Literal["points", "full"]
BODIES: Final[tuple[BodyName, ...]] = ("points", "full")

ON_BASE, ON_LINK1, ON_LINK2 = 0, 1, 2
SPHERE, CAPSULE, DISC = 0, 1, 2
_RIM_PLACES = 4


@dataclass(frozen=True, slots=True)
class Part:
    """One rigid part; ``begin`` and ``end`` are in the axes of what it is on.

    On the base these are the body's (FRD). On a link they are (0, 0, distance from its joint).
    """

    name: str
    on: int  # ON_BASE, ON_LINK1 or ON_LINK2
    begin: Vec3  # m; centre of a sphere or disc
    radius: float  # m, of a sphere or capsule; half the thickness of a disc
    end: Vec3 | None = None  # m; a capsule's other end
    rim: float = 0.0  # m, radius of a disc in the body's x-y plane


# Columns of a probe's row, for kernels.
PART, FORM, ON, BEGIN, END, RADIUS, RIM, TURN = 0, 1, 2, 3, 6, 9, 10, 11
"""Index of its part; SPHERE, CAPSULE or DISC; what it is on; begin and end (3 each), radius, rim
[m]; angle along the rim from the nearest place [rad]."""


@dataclass(frozen=True, slots=True)
class Body:
    """Parts, of which the first is at the body's origin."""

    name: BodyName
    parts: tuple[Part, ...]

    @property
    def probes(self) -> NDArray[np.float64]:
        """A row of numbers a probe (probes, 12) [SI], in the order of the parts."""
        rows = []
        for k, part in enumerate(self.parts):
            form = DISC if part.rim > 0.0 else SPHERE if part.end is None else CAPSULE
            ends = (*part.begin, *(part.end or part.begin))
            for turn in range(_RIM_PLACES if form == DISC else 1):
                angle = 2.0 * math.pi * turn / _RIM_PLACES
                rows.append((k, form, part.on, *ends, part.radius, part.rim, angle))
        return np.array(rows, dtype=np.float64)


def body_of(name: BodyName, airframe: Airframe) -> Body:
    """The body of a name."""
    l1, l2 = airframe.link_length
    if name == "points":
        return Body(
            name,
            (
                Part("base", ON_BASE, (0.0, 0.0, 0.0), 0.0),
                Part("joint2", ON_LINK1, (0.0, 0.0, l1), 0.0),
                Part("end_effector", ON_LINK2, (0.0, 0.0, l2), 0.0),
            ),
        )
    size = airframe.size
    rotors = airframe.rotor_arm + size.blade
    feet = [
        (north * size.feet_spread, east * size.feet_spread, airframe.leg_length - size.leg)
        for north in (1.0, -1.0)
        for east in (1.0, -1.0)
    ]
    legs = [Part(f"foot{k}", ON_BASE, foot, size.leg) for k, foot in enumerate(feet, start=1)]
    legs += [
        Part(f"leg{k}", ON_BASE, (0.0, 0.0, 0.0), size.leg, end=foot)
        for k, foot in enumerate(feet, start=1)
    ]
    return Body(
        name,
        (
            Part("base", ON_BASE, (0.0, 0.0, 0.0), size.hull),
            Part("joint2", ON_LINK1, (0.0, 0.0, l1), size.link),
            Part("end_effector", ON_LINK2, (0.0, 0.0, l2), size.tool),
            Part("rotors", ON_BASE, (0.0, 0.0, 0.0), size.disc, rim=rotors),
            Part("link1", ON_LINK1, (0.0, 0.0, 0.0), size.link, end=(0.0, 0.0, l1)),
            Part("link2", ON_LINK2, (0.0, 0.0, 0.0), size.link, end=(0.0, 0.0, l2)),
            *legs,
        ),
    )


def hull_reach(body: Body, normal: Vec3) -> float:
    """How far the base and what is rigid on it reach against a ``normal`` [1, NED], level [m].

    Whatever the yaw is; 0 for a body of points.
    """
    level = math.hypot(normal[0], normal[1])
    return max(
        part.radius + level * (math.hypot(x, y) + part.rim) - normal[2] * z
        for part in body.parts
        if part.on == ON_BASE
        for x, y, z in (part.begin, part.end or part.begin)
    )
