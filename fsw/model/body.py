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
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fsw.compiled import compiled
from fsw.model.airframe import Airframe
from fsw.signals import Vec3

BodyName = Literal["points", "full"]

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


class Probes(NamedTuple):
    """All probes of a body, for kernels."""

    part: NDArray[np.int64]  # (probes,) index of the part
    form: NDArray[np.int64]  # (probes,) SPHERE, CAPSULE or DISC
    on: NDArray[np.int64]  # (probes,)
    begin: NDArray[np.float64]  # (probes, 3) m
    end: NDArray[np.float64]  # (probes, 3) m
    radius: NDArray[np.float64]  # (probes,) m
    rim: NDArray[np.float64]  # (probes,) m
    turn: NDArray[np.float64]  # (probes,) rad, along the rim from its nearest place


@dataclass(frozen=True, slots=True)
class Body:
    """Parts, of which the first is at the body's origin."""

    name: BodyName
    parts: tuple[Part, ...]

    @property
    def probes(self) -> Probes:
        """One entry a row of the planner's program, in the order of the parts."""
        listed = [
            (k, part, turn)
            for k, part in enumerate(self.parts)
            for turn in range(_RIM_PLACES if part.rim > 0.0 else 1)
        ]
        parts = [part for _, part, _ in listed]
        forms = [DISC if p.rim > 0.0 else SPHERE if p.end is None else CAPSULE for p in parts]
        return Probes(
            part=np.array([k for k, _, _ in listed], dtype=np.int64),
            form=np.array(forms, dtype=np.int64),
            on=np.array([part.on for part in parts], dtype=np.int64),
            begin=np.array([part.begin for part in parts]),
            end=np.array([part.end or part.begin for part in parts]),
            radius=np.array([part.radius for part in parts]),
            rim=np.array([part.rim for part in parts]),
            turn=np.array([0.5 * math.pi * turn for _, _, turn in listed]),
        )


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


@compiled
def nearest_on_segment(begin: Vec3, end: Vec3, p: Vec3) -> Vec3:
    """The place between ``begin`` [m] and ``end`` [m] nearest to ``p`` [m], in one frame."""
    ax, ay, az = end[0] - begin[0], end[1] - begin[1], end[2] - begin[2]
    square = ax * ax + ay * ay + az * az
    if square == 0.0:
        return begin
    share = ((p[0] - begin[0]) * ax + (p[1] - begin[1]) * ay + (p[2] - begin[2]) * az) / square
    share = min(max(share, 0.0), 1.0)
    return begin[0] + share * ax, begin[1] + share * ay, begin[2] + share * az


@compiled
def nearest_on_disc(centre: Vec3, rim: float, p: Vec3) -> Vec3:
    """The place of a level disc, ``rim`` [m] about ``centre`` [m], nearest to ``p`` [m] (body)."""
    x, y = p[0] - centre[0], p[1] - centre[1]
    length = math.sqrt(x * x + y * y)
    scale = 1.0 if length <= rim else rim / length
    return centre[0] + scale * x, centre[1] + scale * y, centre[2]
