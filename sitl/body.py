"""What of the vehicle keeps clear: the paper's three points, or all that it consists of.

The sizes are Table I's and those of ``sitl.plant.parameters.Size``. A part is placed by two ends,
each given from a place that the plant integrates (base, joints, end-effector), in the base's axes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from sitl.plant.parameters import Vehicle
from sitl.plant.vector import V3, Array
from sitl.scenario import Body

CRITICAL_POINTS: Final = ("base", "joint2", "end_effector")  # in the order of the paper
BASE, JOINT1, JOINT2, END_EFFECTOR = 0, 1, 2, 3  # rows of what the plant places
AXES: Final = 4  # its first row of three with the base's axes
BALL, CAPSULE, ROTOR = 0, 1, 2  # forms
_HERE: V3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Part:
    """One part: a ball, a capsule, or the cylinder that a rotor's blades sweep."""

    name: str
    form: int
    radius: float  # m, of a ball or capsule, or of a rotor
    begin: tuple[int, V3]  # row, and m from there in the base's axes
    end: tuple[int, V3] | None = None  # of a capsule
    half_height: float = 0.0  # m, of a rotor, along the base's z axis


class Parts(NamedTuple):
    """The parts as arrays for kernels."""

    form: npt.NDArray[np.int64]  # (parts,)
    radius: Array  # (parts,) m
    half_height: Array  # (parts,) m
    row: npt.NDArray[np.int64]  # (parts, 2) of begin and end
    local: Array  # (parts, 2, 3) m
    rigid: npt.NDArray[np.bool_]  # (parts,) whether the base's axes are needed
    reach: float  # m, from the base's origin to the farthest place of any part


def parts_of(body: Body, vehicle: Vehicle) -> tuple[Part, ...]:
    """The parts of a body."""
    if body == "points":
        rows = (BASE, JOINT2, END_EFFECTOR)
        return tuple(
            Part(name, BALL, 0.0, (row, _HERE))
            for name, row in zip(CRITICAL_POINTS, rows, strict=True)
        )
    size, rotors, legs = vehicle.size, vehicle.rotors, vehicle.legs
    hubs = ((-rotors.arm, 0.0), (0.0, -rotors.arm), (rotors.arm, 0.0), (0.0, rotors.arm))
    down = legs.length - size.leg
    feet = [(north * legs.spread, east * legs.spread) for north in (1, -1) for east in (1, -1)]
    return (
        Part("base", BALL, size.hull, (BASE, _HERE)),
        Part("joint2", BALL, size.link, (JOINT2, _HERE)),
        Part("end_effector", BALL, size.tool, (END_EFFECTOR, _HERE)),
        Part("link1", CAPSULE, size.link, (JOINT1, _HERE), (JOINT2, _HERE)),
        Part("link2", CAPSULE, size.link, (JOINT2, _HERE), (END_EFFECTOR, _HERE)),
        *(
            Part(f"leg{k}", CAPSULE, size.leg, (BASE, _HERE), (BASE, (x, y, down)))
            for k, (x, y) in enumerate(feet, start=1)
        ),
        *(
            Part(f"rotor{k}", ROTOR, size.blade, (BASE, (x, y, 0.0)), half_height=size.disc)
            for k, (x, y) in enumerate(hubs, start=1)
        ),
    )


def as_arrays(parts: tuple[Part, ...], vehicle: Vehicle) -> Parts:
    """The parts for kernels."""
    ends = [(part.begin, part.end or part.begin) for part in parts]
    local = np.array([[place for _, place in pair] for pair in ends])
    arm = sum(link.a for link in vehicle.links)
    thick = np.array([part.radius + part.half_height for part in parts])
    in_arm = np.array([any(row != BASE for row, _ in pair) for pair in ends])
    reach = np.linalg.norm(local, axis=2).max(axis=1) + arm * in_arm + thick
    return Parts(
        form=np.array([part.form for part in parts], dtype=np.int64),
        radius=np.array([part.radius for part in parts]),
        half_height=np.array([part.half_height for part in parts]),
        row=np.array([[row for row, _ in pair] for pair in ends], dtype=np.int64),
        local=local,
        rigid=np.array(
            [
                part.form == ROTOR or bool(places.any())
                for part, places in zip(parts, local, strict=True)
            ]
        ),
        reach=float(reach.max()),
    )


def spoken(part: str) -> str:
    """A part's name in a sentence."""
    words = {"base": "the base", "joint2": "joint 2", "end_effector": "the end-effector"}
    return (
        words.get(part)
        or f"{part.rstrip('0123456789')} {part.lstrip('abcdefghijklmnopqrstuvwxyz')}"
    )
