"""Shapes as the collision library Coal has them, and how far they reach, both written anew."""

from __future__ import annotations

from typing import Any, NamedTuple

import coal
import numpy as np
from scipy.spatial.transform import Rotation

from fsw.autopilot.model.prediction import Array
from fsw.autopilot.signals import Shape, Vec3
from tests.fsw.random_states import vec3

_REQUEST = coal.DistanceRequest()
_POINT = coal.Sphere(0.0)


class Solid(NamedTuple):
    """A convex body of Coal in the world."""

    geometry: Any
    place: Any


def solid(shape: Shape) -> Solid:
    """A shape of the flight software."""
    numbers = np.array(shape.numbers)
    match shape.kind:
        case "half-space":
            return Solid(coal.Halfspace(numbers[:3], numbers[3]), coal.Transform3s.Identity())
        case "ball" | "target sphere":
            return _placed(coal.Sphere(numbers[3]), numbers[:3])
        case "box":
            turned = Rotation.from_quat(numbers[[7, 8, 9, 6]])
            return _placed(coal.Box(*(2.0 * numbers[3:6])), numbers[:3], turned)
        case "cylinder":
            return _cylinder(numbers[0:3], numbers[3:6], numbers[6])
        case "vertical cylinder":
            ends = np.array([[*numbers[:2], numbers[2]], [*numbers[:2], numbers[3]]])
            return _cylinder(*ends, numbers[4])
    raise ValueError(f"how does Coal call a {shape.kind}?")


def along(begin: Array, end: Array) -> Rotation:
    """A rotation that turns z into the direction from one place to another."""
    axis = (end - begin) / np.linalg.norm(end - begin)
    return Rotation.align_vectors([axis], [[0.0, 0.0, 1.0]])[0]


def _placed(geometry: Any, at: Array, turned: Rotation | None = None) -> Solid:
    matrix = np.eye(3) if turned is None else turned.as_matrix()
    return Solid(geometry, coal.Transform3s(matrix, np.array(at)))


def _cylinder(begin: Array, end: Array, radius: float) -> Solid:
    length = float(np.linalg.norm(end - begin))
    return _placed(coal.Cylinder(radius, length), 0.5 * (begin + end), along(begin, end))


def ball_at(p: Array, radius: float) -> Solid:
    """A ball of the vehicle."""
    return _placed(coal.Sphere(radius), p)


def capsule(begin: Array, end: Array, radius: float) -> Solid:
    """A capsule of the vehicle."""
    length = float(np.linalg.norm(end - begin))
    return _placed(coal.Capsule(radius, length), 0.5 * (begin + end), along(begin, end))


def disc(centre: Array, turned: Rotation, rim: float) -> Solid:
    """A flat disc of the vehicle, as good as without thickness."""
    return _placed(coal.Cylinder(rim, 1e-6), centre, turned)


def between(one: Solid, other: Solid) -> float:
    """Distance, or minus the depth of penetration."""
    result = coal.DistanceResult()
    return float(coal.distance(*one, *other, _REQUEST, result))


def distance(shape: Shape, p: Vec3) -> float:
    """From the surface of a shape to a point, negative inside."""
    return between(solid(shape), Solid(_POINT, coal.Transform3s(np.eye(3), np.array(p))))


def reach(shape: Shape, n: Array) -> float:
    """The largest n . p of a shape's places p."""
    numbers = np.array(shape.numbers)
    match shape.kind:
        case "half-space":
            return float(numbers[3]) if np.allclose(n, numbers[:3], atol=1e-12) else np.inf
        case "ball" | "target sphere":
            return float(n @ numbers[:3]) + float(numbers[3])
        case "box":
            axes = Rotation.from_quat(numbers[[7, 8, 9, 6]]).as_matrix()
            return float(n @ numbers[:3] + np.abs(n @ axes) @ numbers[3:6])
        case "cylinder":
            return _reach_of_cylinder(numbers[0:3], numbers[3:6], numbers[6], n)
        case "vertical cylinder":
            ends = np.array([[*numbers[:2], numbers[2]], [*numbers[:2], numbers[3]]])
            return _reach_of_cylinder(ends[0], ends[1], numbers[4], n)
    raise ValueError(f"how far does a {shape.kind} reach?")


def _reach_of_cylinder(begin: Array, end: Array, radius: float, n: Array) -> float:
    axis = (end - begin) / np.linalg.norm(end - begin)
    across = float(np.linalg.norm(n - (n @ axis) * axis))
    return max(float(n @ begin), float(n @ end)) + radius * across


def random_shape(kind: str, random: np.random.Generator, larger: float = 1.0) -> Shape:
    """Of the size of what a vehicle meets, or so many times larger, near the origin."""
    at = random.uniform(-0.5, 0.5, 3)
    direction = random.standard_normal(3)
    direction /= np.linalg.norm(direction)
    size = larger * random.uniform(0.1, 1.0, 3)
    match kind:
        case "half-space":
            numbers = [*direction, random.uniform(-0.5, 0.5)]
        case "ball" | "target sphere":
            numbers = [*at, size[0]]
        case "box":
            x, y, z, w = Rotation.random(rng=random).as_quat()
            numbers = [*at, *size, w, x, y, z]
        case "cylinder":
            numbers = [*(at - size[0] * direction), *(at + size[0] * direction), size[1]]
        case "vertical cylinder":
            numbers = [*at[:2], at[2] - size[0], at[2] + size[0], size[1]]
        case _:
            raise ValueError(f"draw a {kind} here, so that its laws are held against Coal")
    return Shape(kind, tuple(float(number) for number in numbers))


def random_point(random: np.random.Generator) -> Vec3:
    """Inside about as often as outside."""
    return vec3(random.uniform(-1.3, 1.3, 3))
