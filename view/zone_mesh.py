"""The surface of a zone as triangles, for whatever draws in three dimensions."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fsw.signals import TARGET_SPHERE, Shape, Vec3

Array = NDArray[np.float64]
_ROUND: Final = 24  # sides of what is round
_THINNEST: Final = 0.004  # m, the radius at which a line or a point is drawn
_ENDLESS: Final = 1e3  # m, a height beyond which a cylinder is cut to the scene


class Mesh(NamedTuple):
    """Triangles."""

    vertices: Array  # (n, 3) m, NED
    triangles: NDArray[np.int64]  # (m, 3) rows of ``vertices``


class Scene(NamedTuple):
    """What endless shapes are cut to."""

    low: Vec3  # m, NED
    high: Vec3  # m, NED


def mesh(shape: Shape, scene: Scene, grown: float = 0.0, target: Vec3 = (0.0, 0.0, 0.0)) -> Mesh:
    """The surface of a shape, ``grown`` [m] by a clearance.

    Endless ones are cut to the ``scene``; ``target`` [m, NED] carries a shape that follows it.
    """
    n = shape.numbers
    if shape.kind == "half-space":
        return _plane(np.array(n[:3]), n[3] + grown, scene)
    if shape.kind in ("ball", TARGET_SPHERE):
        middle = np.array(n[:3]) + (np.array(target) if shape.kind == TARGET_SPHERE else 0.0)
        return _ball(middle, n[3] + grown)
    if shape.kind == "box":
        return _box(np.array(n[:3]), np.array(n[3:6]) + grown, np.array(n[6:10]))
    if shape.kind == "cylinder":
        return _cylinder(np.array(n[:3]), np.array(n[3:6]), n[6] + grown, grown)
    if shape.kind == "vertical cylinder":
        top = n[2] if n[2] > -_ENDLESS else scene.low[2]
        bottom = n[3] if n[3] < _ENDLESS else scene.high[2]
        ends = np.array((n[0], n[1], top)), np.array((n[0], n[1], bottom))
        return _cylinder(*ends, n[4] + grown, grown)
    raise ValueError(f"no mesh for a {shape.kind!r}")


def _plane(normal: Array, offset: float, scene: Scene) -> Mesh:
    """The part of the plane that lies in a square about the middle of the scene."""
    low, high = np.array(scene.low), np.array(scene.high)
    middle = 0.5 * (low + high)
    foot = middle + (offset - normal @ middle) * normal
    across = np.cross(normal, (0.0, 0.0, 1.0) if abs(normal[2]) < 0.9 else (1.0, 0.0, 0.0))
    across /= np.linalg.norm(across)
    along = np.cross(normal, across)
    half = 0.5 * (high - low)
    a, b = (np.abs(axis) @ half * axis for axis in (across, along))
    corners = np.array((foot - a - b, foot + a - b, foot + a + b, foot - a + b))
    return Mesh(corners, np.array(((0, 1, 2), (0, 2, 3))))


def _ball(middle: Array, radius: float) -> Mesh:
    rings = _ROUND // 2
    polar = np.linspace(0.0, math.pi, rings + 1)
    around = np.linspace(0.0, 2.0 * math.pi, _ROUND, endpoint=False)
    unit = np.stack(
        (
            np.outer(np.sin(polar), np.cos(around)),
            np.outer(np.sin(polar), np.sin(around)),
            np.outer(np.cos(polar), np.ones(_ROUND)),
        ),
        axis=-1,
    ).reshape(-1, 3)
    return Mesh(middle + max(radius, _THINNEST) * unit, _between_rings(rings + 1))


def _cylinder(begin: Array, end: Array, radius: float, longer: float) -> Mesh:
    """With its ends, each moved out by ``longer`` [m]."""
    axis = (end - begin) / np.linalg.norm(end - begin)
    side = np.cross(axis, (1.0, 0.0, 0.0) if abs(axis[0]) < 0.9 else (0.0, 1.0, 0.0))
    side /= np.linalg.norm(side)
    up = np.cross(axis, side)
    around = np.linspace(0.0, 2.0 * math.pi, _ROUND, endpoint=False)[:, None]
    ring = max(radius, _THINNEST) * (np.cos(around) * side + np.sin(around) * up)
    first, last = begin - longer * axis, end + longer * axis
    rows = (0.0 * ring + first, first + ring, last + ring, 0.0 * ring + last)
    return Mesh(np.concatenate(rows), _between_rings(len(rows)))


def _between_rings(rings: int) -> NDArray[np.int64]:
    k = np.arange(_ROUND)
    after = (k + 1) % _ROUND
    bands = []
    for ring in range(rings - 1):
        a, b = ring * _ROUND, (ring + 1) * _ROUND
        bands += [
            np.stack((a + k, a + after, b + k), 1),
            np.stack((a + after, b + after, b + k), 1),
        ]
    return np.concatenate(bands)


def _box(middle: Array, half: Array, attitude: Array) -> Mesh:
    w, v = attitude[0], attitude[1:]
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    corners = signs * half
    turned = corners + 2.0 * np.cross(v, np.cross(v, corners) + w * corners)
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [part for a, b, c, d in faces for part in ((a, b, c), (a, c, d))]
    return Mesh(middle + turned, np.array(triangles))
