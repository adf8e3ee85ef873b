"""Zones as triangles: their surfaces, and the shells that their clearances make."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from fsw.autopilot.geometry.rotation import matrix_from_quaternion
from fsw.autopilot.signals import Shape, Vec3, Zone

Array = NDArray[Any]

_THIN = 0.02  # m, radius that a point or a line is drawn with
_MIN = 0.002  # m, half a thickness that is drawn; a hull of less may have no volume
_ROUND = 32  # corners of a circle
_TURNS = np.linspace(0.0, 2.0 * math.pi, _ROUND, endpoint=False)


class Mesh(NamedTuple):
    """Triangles."""

    vertices: Array  # (v, 3) m, NED
    faces: Array  # (f, 3) indices


class ZoneMesh(NamedTuple):
    """A zone as it is drawn."""

    surface: Mesh
    shell: Mesh | None  # where the clearance ends; None without one


def zone_mesh(zone: Zone, region: tuple[Vec3, Vec3], target: Vec3 | None) -> ZoneMesh | None:
    """A zone as triangles.

    A plane is drawn within the ``region`` [m, NED], least and largest corner. A zone that rides on
    the ``target`` [m, NED] is not drawn without one, nor is one whose triangles cannot be found.
    """
    try:
        return _zone_mesh(zone, region, target)
    except QhullError:
        return None


def _zone_mesh(zone: Zone, region: tuple[Vec3, Vec3], target: Vec3 | None) -> ZoneMesh | None:
    shape, clearance = zone.shape, zone.clearance
    if shape.kind == "half-space":
        shell = _plane(shape, region, clearance) if clearance > 0.0 else None
        return ZoneMesh(_plane(shape, region, 0.0), shell)
    corners = _corners(shape, region, target)
    if corners is None:
        return None
    points, radius = corners
    inwards = -1.0 if zone.keep_in else 1.0
    surface = _hull(points, radius)
    if clearance <= 0.0:
        return ZoneMesh(surface, None)
    if zone.keep_in and radius <= clearance + _MIN:
        return ZoneMesh(surface, None)
    return ZoneMesh(surface, _hull(points, radius + inwards * clearance))


def moved(zone: Zone, t: float) -> Vec3:
    """How far a zone has moved since its numbers were true, at ``t`` [s, sensor time] [m, NED]."""
    since = t - 1e-6 * zone.t_us if any(zone.velocity) else 0.0
    x, y, z = (since * speed for speed in zone.velocity)
    return x, y, z


def _plane(shape: Shape, region: tuple[Vec3, Vec3], shift: float) -> Mesh:
    """The part of a plane, moved by ``shift`` [m] along its normal, that a region shows."""
    normal, offset = np.array(shape.numbers[:3]), shape.numbers[3] + shift
    low, high = np.array(region[0]), np.array(region[1])
    centre, reach = 0.5 * (low + high), 0.5 * (high - low)
    across = np.cross(normal, (0.0, 0.0, 1.0) if abs(normal[2]) < 0.9 else (1.0, 0.0, 0.0))
    across /= np.linalg.norm(across)
    along = np.cross(normal, across)
    middle = centre + normal * (offset - normal @ centre)
    a, b = across * (np.abs(across) @ reach), along * (np.abs(along) @ reach)
    corners = np.array((middle - a - b, middle + a - b, middle + a + b, middle - a + b))
    return Mesh(corners, np.array(((0, 1, 2), (0, 2, 3))))


def _corners(
    shape: Shape, region: tuple[Vec3, Vec3], target: Vec3 | None
) -> tuple[Array, float] | None:
    """Points, and a radius about each of them, whose hull is the shape [m, NED].

    What is upright and without end is drawn within the region.
    """
    n = np.array(shape.numbers)
    if shape.kind == "ball":
        return n[None, :3], _ball_radius(float(n[3]))
    if shape.kind == "target sphere":
        return None if target is None else ((n[:3] + target)[None], _ball_radius(float(n[3])))
    if shape.kind == "vertical cylinder":
        # Within the region, but no end of its own is moved beyond the other: it may lie outside.
        top, bottom = float(n[2]), float(n[3])
        top = min(max(top, region[0][2]), max(bottom - _THIN, top))
        bottom = max(min(bottom, region[1][2]), top + _THIN)
        radius = max(float(n[4]), _THIN)
        return _cylinder(np.array((*n[:2], top)), np.array((*n[:2], bottom)), radius), 0.0
    if shape.kind == "cylinder":
        return _cylinder(n[:3], n[3:6], max(float(n[6]), _MIN)), 0.0
    if shape.kind == "box":
        w, x, y, z = n[6:10].tolist()
        axes = np.array(matrix_from_quaternion((w, x, y, z))).reshape(3, 3)
        signs = np.array([(i, j, k) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
        return n[:3] + (signs * np.maximum(n[3:6], _MIN)) @ axes.T, 0.0
    return None  # a kind that this build does not know


def _ball_radius(radius: float) -> float:
    """A point is drawn larger than it is, a ball hardly."""
    return max(radius, _MIN) if radius > 0.0 else _THIN


def _cylinder(begin: Array, end: Array, radius: float) -> Array:
    axis = end - begin
    length = float(np.linalg.norm(axis))
    axis = axis / length if length > 1e-9 else np.array((0.0, 0.0, 1.0))
    if length < 2.0 * _MIN:
        begin, end = begin - (_MIN - 0.5 * length) * axis, end + (_MIN - 0.5 * length) * axis
    a = np.cross(axis, (1.0, 0.0, 0.0) if abs(axis[0]) < 0.9 else (0.0, 1.0, 0.0))
    a /= np.linalg.norm(a)
    b = np.cross(axis, a)
    ring = radius * (np.cos(_TURNS)[:, None] * a + np.sin(_TURNS)[:, None] * b)
    return np.concatenate((begin + ring, end + ring))


def _hull(points: Array, radius: float) -> Mesh:
    """The convex hull of balls of one ``radius`` [m] about ``points`` (n, 3) [m, NED]."""
    if radius > 0.0:
        ball = radius * _unit_ball(24 if len(points) == 1 else 10)
        points = (points[:, None, :] + ball[None]).reshape(-1, 3)
    hull = ConvexHull(points)
    faces = hull.simplices.copy()
    corners = hull.points[faces]
    turn = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inwards = np.einsum("ij,ij->i", turn, hull.equations[:, :3]) < 0.0
    faces[inwards] = faces[inwards][:, ::-1]
    kept = np.unique(faces)
    place = np.zeros(len(hull.points), dtype=np.int64)
    place[kept] = np.arange(len(kept))
    return Mesh(hull.points[kept], place[faces])


def _unit_ball(rings: int) -> Array:
    """Points on a sphere of radius 1."""
    heights = np.cos(np.linspace(0.0, math.pi, rings + 1))
    rounds = [
        (
            math.sqrt(max(1.0 - h * h, 0.0)) * math.cos(a),
            math.sqrt(max(1.0 - h * h, 0.0)) * math.sin(a),
            h,
        )
        for h in heights[1:-1]
        for a in np.linspace(0.0, 2.0 * math.pi, 2 * rings, endpoint=False)
    ]
    return np.array([(0.0, 0.0, 1.0), *rounds, (0.0, 0.0, -1.0)])
