"""A vehicle as letters: from above, and from its right side."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import Final

import numpy as np

from fsw.autopilot.model.multibody import bodies_of, place_of_tip, posture
from vehicles.description import V3, Vehicle

_WIDTH, _HEIGHT = 49, 17  # characters, of which one is twice as high as wide
_ROTORS: Final = "12345678"


def drawing(vehicle: Vehicle) -> str:
    """Two views in the body's axes; rotors are numbered, joints are o, the end-effector is *."""
    marks = list(_marks(vehicle))
    size = max(max(abs(value) for value in place) for place, _ in marks) or 1.0
    above = _view(((y, -x, mark) for (x, y, _), mark in marks), size)
    aside = _view(((x, z, mark) for (x, _, z), mark in marks), size)
    return f"from above, x up:\n{above}\nfrom the right, x to the right:\n{aside}"


def _marks(vehicle: Vehicle) -> Iterable[tuple[V3, str]]:
    bodies = bodies_of(vehicle)
    m = posture(bodies, vehicle.rest_posture)
    origins = np.array(m.origin).reshape(-1, 3)[: bodies.joints]
    tip = np.array(place_of_tip(m, bodies))
    chain = [*origins, tip]
    for foot in vehicle.feet.positions:
        yield foot, "'"
    for begin, end in itertools.pairwise(chain):
        for share in np.linspace(0.0, 1.0, 24):
            yield _v3(begin + share * (end - begin)), "."
    yield (0.0, 0.0, 0.0), "+"
    for place in origins:
        yield _v3(place), "o"
    yield _v3(tip), "*"
    for mark, rotor in zip(_ROTORS, vehicle.rotors, strict=False):
        yield rotor.position, mark


def _v3(values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> V3:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _view(marks: Iterable[tuple[float, float, str]], size: float) -> str:
    """Marks at places (to the right, down) [m] of a square of twice the ``size`` [m]."""
    rows = [[" "] * _WIDTH for _ in range(_HEIGHT)]
    for right, down, mark in marks:
        column = round((_WIDTH - 1) * 0.5 * (1.0 + right / size))
        row = round((_HEIGHT - 1) * 0.5 * (1.0 + down / size))
        rows[row][column] = mark
    lines = ["".join(row).rstrip() for row in rows]
    while lines and not lines[0]:
        lines.pop(0)
    while lines and not lines[-1]:
        lines.pop()
    return "\n".join(f"  {line}" for line in lines)
