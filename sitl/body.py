"""What of the vehicle keeps clear: its critical points, or all that it consists of.

A part is placed by two ends, each given from a row of what the plant places (base, joints,
end-effector, ``sitl.plant.places``), in the base's axes.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from sitl.plant.places import row_of, rows_of
from sitl.plant.tool import is_tip, tip_radius
from sitl.plant.vector import V3, Array
from sitl.scenario import Body
from vehicles.description import Vehicle

BASE: Final = 0  # row of what the plant places
BALL, CAPSULE, ROTOR = 0, 1, 2  # forms
# What touches a zone that may be touched: no part of the tool, its tip, or all but a capsule's end.
KEPT, TIP, SHAFT = 0, 1, 2
_TIPS = 2.0  # of its tip's radius, by which a capsule that ends at the tip may touch with it
_HERE: V3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Part:
    """One part: a ball, a capsule, or the cylinder that a rotor's blades sweep."""

    name: str
    form: int
    radius: float  # m, of a ball or capsule, or of a rotor
    begin: tuple[int, V3]  # row, and m from there in the base's axes
    end: tuple[int, V3] | None = None  # of a capsule
    half_height: float = 0.0  # m, of a rotor, along its axis
    axis: V3 = _HERE  # of a rotor, against its thrust, in B
    tool: int = KEPT
    cut: float = 0.0  # share of a shaft's length, from its end on, that may touch


class Parts(NamedTuple):
    """The parts as arrays for kernels."""

    form: npt.NDArray[np.int64]  # (parts,)
    radius: Array  # (parts,) m
    half_height: Array  # (parts,) m
    row: npt.NDArray[np.int64]  # (parts, 2) of begin and end
    local: Array  # (parts, 2, 3) m
    axis: Array  # (parts, 3) [1] of a rotor, in B
    tool: npt.NDArray[np.int64]  # (parts,)
    cut: Array  # (parts,) of a shaft's length
    rigid: npt.NDArray[np.bool_]  # (parts,) whether the base's axes are needed
    ground: npt.NDArray[np.int64]  # (points,) rows of the critical points, which may touch it
    axes: int  # first of three rows with the base's axes
    reach: float  # m, from the base's origin to the farthest place of any part


def parts_of(body: Body, vehicle: Vehicle) -> tuple[Part, ...]:
    """The parts of a body."""
    if body == "points":
        return tuple(
            Part(
                one.name,
                BALL,
                0.0,
                (row_of(vehicle, vehicle.places[one.on], one.position), _HERE),
                tool=TIP if is_tip(vehicle, vehicle.places[one.on], one.position) else KEPT,
            )
            for one in vehicle.critical_points
        )

    def place(on: int, position: V3) -> tuple[int, V3]:
        """What is on the base needs no row of its own."""
        return (row_of(vehicle, on, position), _HERE) if on else (BASE, position)

    parts = []
    for one in vehicle.parts:
        on = vehicle.places[one.on]
        if one.end is None:
            tool = TIP if is_tip(vehicle, on, one.position) else KEPT
            parts.append(Part(one.name, BALL, one.radius, place(on, one.position), tool=tool))
            continue
        ends, length = (one.position, one.end), math.dist(one.position, one.end)
        if is_tip(vehicle, on, ends[0]):
            ends = (ends[1], ends[0])
        begin, end = place(on, ends[0]), place(on, ends[1])
        if is_tip(vehicle, on, ends[1]):
            cut = min(_TIPS * tip_radius(vehicle) / length, 1.0) if length > 0.0 else 1.0
            parts.append(Part(one.name, CAPSULE, one.radius, begin, end, tool=SHAFT, cut=cut))
        else:
            parts.append(Part(one.name, CAPSULE, one.radius, begin, end))
    for number, rotor in enumerate(vehicle.rotors, start=1):
        x, y, z = rotor.axis
        begin, name = (BASE, rotor.position), f"rotor{number}"
        down = (-x, -y, -z)
        parts.append(Part(name, ROTOR, rotor.radius, begin, None, rotor.half_height, down))
    return tuple(parts)


def as_arrays(parts: tuple[Part, ...], vehicle: Vehicle) -> Parts:
    """The parts for kernels."""
    ends = [(part.begin, part.end or part.begin) for part in parts]
    local = np.array([[place for _, place in pair] for pair in ends])
    thick = np.array([part.radius + part.half_height for part in parts])
    in_arm = np.array([any(row != BASE for row, _ in pair) for pair in ends])
    reach = np.linalg.norm(local, axis=2).max(axis=1) + arm_reach(vehicle) * in_arm + thick
    points = [(vehicle.places[one.on], one.position) for one in vehicle.critical_points]
    return Parts(
        form=np.array([part.form for part in parts], dtype=np.int64),
        radius=np.array([part.radius for part in parts]),
        half_height=np.array([part.half_height for part in parts]),
        row=np.array([[row for row, _ in pair] for pair in ends], dtype=np.int64),
        local=local,
        axis=np.array([part.axis for part in parts]),
        tool=np.array([part.tool for part in parts], dtype=np.int64),
        cut=np.array([part.cut for part in parts]),
        rigid=np.array(
            [
                part.form == ROTOR or bool(places.any())
                for part, places in zip(parts, local, strict=True)
            ]
        ),
        ground=np.array([row_of(vehicle, *point) for point in points], dtype=np.int64),
        axes=rows_of(vehicle),
        reach=float(reach.max()),
    )


def arm_reach(vehicle: Vehicle) -> float:
    """Farthest that any point on a link or a critical point is from the base's origin [m]."""
    behind, farthest = [0.0], 0.0
    for joint in vehicle.joints:
        behind.append(behind[-1] + math.hypot(*joint.xyz))
    points = [(one.on, one.position) for one in vehicle.critical_points]
    points += [(one.on, end) for one in vehicle.parts for end in (one.position, one.end or _HERE)]
    points.append((vehicle.joints[-1].name, vehicle.end_effector.position))
    for on, place in points:
        farthest = max(farthest, behind[vehicle.places[on]] + math.hypot(*place))
    return farthest


def spoken(part: str) -> str:
    """A part's name in a sentence."""
    word, number = re.fullmatch(r"(.*?)(\d*)", part, re.DOTALL).groups()  # type: ignore[union-attr]
    return f"{word} {number}" if number else f"the {word.replace('_', '-')}"
