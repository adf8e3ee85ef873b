"""Distances of the body's parts to shapes, against Coal and against points of the parts."""

from __future__ import annotations

import math

import coal
import numpy as np
import pytest

from sitl.body import Parts, as_arrays, parts_of
from sitl.distance import along_segment, of_rotor, part_bound, part_distance
from sitl.plant.vector import V3, Array
from sitl.scenario import ScenarioZone
from sitl.shapes import KINDS, kind_of
from sitl.shapes.ball import Ball
from sitl.shapes.box import Box
from sitl.shapes.cylinder import Cylinder
from sitl.shapes.half_space import HalfSpace
from sitl.shapes.kind import NUMBERS
from sitl.shapes.vertical_cylinder import VerticalCylinder
from vehicles.vehicle_file import load_vehicle

VEHICLE = load_vehicle("paper")
AXES = as_arrays(parts_of("full", VEHICLE), VEHICLE).axes
PARTS = parts_of("full", VEHICLE)
COAL_M = 5e-6  # Coal's own accuracy at round shapes
SHAPES = ("half-space", "ball", "vertical cylinder", "cylinder", "box")


def unit(random: np.random.Generator) -> Array:
    v = random.normal(size=3)
    return np.asarray(v / np.linalg.norm(v))


def vector(values: Array) -> V3:
    return (float(values[0]), float(values[1]), float(values[2]))


def turned(axis: Array) -> Array:
    """A rotation whose z axis is the given one."""
    other = np.eye(3)[np.argmin(np.abs(axis))]
    x = np.cross(other, axis)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis], axis=1)


def at(rotation: Array, place: Array) -> coal.Transform3s:
    return coal.Transform3s(rotation, np.asarray(place, dtype=float))


def zone(word: str, random: np.random.Generator) -> tuple[ScenarioZone, coal.ShapeBase, object]:
    """A zone of a shape somewhere, and the same for Coal."""
    p, size = random.uniform(-0.5, 0.5, 3), random.uniform(0.02, 0.4, 3)
    common = {"name": "one", "clearance_m": 0.0}
    if word == "half-space":
        n = unit(random)
        table: ScenarioZone = HalfSpace(normal=vector(n), offset_m=p[0], **common)  # type: ignore[arg-type]
        return table, coal.Halfspace(n, p[0]), at(np.eye(3), np.zeros(3))
    if word == "ball":
        table = Ball(centre_m=vector(p), radius_m=size[0], **common)  # type: ignore[arg-type]
        return table, coal.Sphere(size[0]), at(np.eye(3), p)
    if word == "box":
        roll = float(random.uniform(-180.0, 180.0))
        table = Box(
            centre_m=vector(p),
            half_size_m=vector(size),
            attitude_deg=(roll, 0.0, 90.0),
            **common,  # type: ignore[arg-type]
        )
        c, s = math.cos(math.radians(roll)), math.sin(math.radians(roll))
        about_x = np.array(((1, 0, 0), (0, c, -s), (0, s, c)))
        return (
            table,
            coal.Box(*(2.0 * size)),
            at(np.array(((0, -1, 0), (1, 0, 0), (0, 0, 1))) @ about_x, p),
        )
    axis = np.array((0.0, 0.0, 1.0)) if word == "vertical cylinder" else unit(random)
    if word == "vertical cylinder":
        table = VerticalCylinder(
            north_east_m=(p[0], p[1]),
            top_m=p[2] - size[1],
            bottom_m=p[2] + size[1],
            radius_m=size[0],
            **common,  # type: ignore[arg-type]
        )
    else:
        ends = vector(p - size[1] * axis), vector(p + size[1] * axis)
        table = Cylinder(begin_m=ends[0], end_m=ends[1], radius_m=size[0], **common)  # type: ignore[arg-type]
    return table, coal.Cylinder(size[0], 2.0 * size[1]), at(turned(axis), p)


def numbers(table: ScenarioZone) -> tuple[int, Array]:
    out, own = np.zeros(NUMBERS), table.numbers((0.0, 0.0, 0.0))
    out[: len(own)] = own
    return KINDS.index(kind_of(table)), out


def by_coal(part: object, where: object, other: object, there: object) -> float:
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    return float(coal.distance(part, where, other, there, request, result))


@pytest.mark.parametrize("word", SHAPES)
def test_a_rotor_is_as_far_from_a_shape_as_coal_finds(word: str) -> None:
    random, seen = np.random.default_rng(1), 0
    for _ in range(150):
        table, other, there = zone(word, random)
        kind, values = numbers(table)
        hub, axis = random.uniform(-0.8, 0.8, 3), unit(random)
        expected = by_coal(coal.Cylinder(0.165, 0.04), at(turned(axis), hub), other, there)
        found = of_rotor(kind, values, vector(hub), vector(axis), 0.165, 0.02)
        if expected > 0.0:
            assert found == pytest.approx(expected, abs=COAL_M)
            seen += 1
        else:
            assert found < COAL_M
    assert seen > 50


@pytest.mark.parametrize("word", SHAPES)
def test_a_capsule_is_as_far_from_a_shape_as_coal_finds(word: str) -> None:
    random = np.random.default_rng(2)
    for _ in range(150):
        table, other, there = zone(word, random)
        kind, values = numbers(table)
        begin, end = random.uniform(-0.8, 0.8, (2, 3))
        length = float(np.linalg.norm(end - begin))
        pose = at(turned((end - begin) / length), 0.5 * (begin + end))
        expected = by_coal(coal.Capsule(0.02, length), pose, other, there)
        found = along_segment(kind, values, vector(begin), vector(end)) - 0.02
        if expected > 0.0:
            assert found == pytest.approx(expected, abs=COAL_M)
        else:
            assert found < COAL_M


def posed(random: np.random.Generator) -> Array:
    """Base, joints, end-effector and the base's axes of some attitude and arm."""
    base, rotation = random.uniform(-0.8, 0.8, 3), turned(unit(random))
    joint2 = base + 0.15 * rotation @ unit(random)
    tip = joint2 + 0.15 * rotation @ unit(random)
    return np.array([base, base, joint2, tip, *rotation.T])


def points_of(parts: Parts, b: int, places: Array, random: np.random.Generator) -> Array:
    """Points all over one part."""
    x = places[AXES : AXES + 3].T
    begin, end = (places[parts.row[b, e]] + x @ parts.local[b, e] for e in (0, 1))
    share = random.uniform(0.0, 1.0, (4000, 1))
    if PARTS[b].half_height:
        angle, height = random.uniform(0.0, 2.0 * math.pi, (2, 4000))
        height = np.sign(height - math.pi) * parts.half_height[b]
        flat = parts.radius[b] * np.sqrt(random.choice([share[:, 0], np.ones(4000)]))
        local = np.stack([flat * np.cos(angle), flat * np.sin(angle), height], axis=1)
        return np.asarray(begin + local @ x.T)
    ways = random.normal(size=(4000, 3))
    ways *= parts.radius[b] / np.linalg.norm(ways, axis=1, keepdims=True)
    return np.asarray(begin + share * (end - begin) + ways)


@pytest.mark.drawn(2)
@pytest.mark.parametrize("word", SHAPES)
def test_no_point_of_a_part_is_nearer_and_its_bound_is_below(word: str) -> None:
    random, parts = np.random.default_rng(3), as_arrays(PARTS, VEHICLE)
    shift = (0.1, -0.2, 0.3)
    for _ in range(3):
        table, _, _ = zone(word, random)
        kind, values = numbers(table)
        places = posed(random)
        for b in range(len(PARTS)):
            sampled = points_of(parts, b, places, random) - np.array(shift)
            seen = np.array([KINDS[kind].nearest(values, *p).distance for p in sampled])
            for keep_in in (False, True):
                how = (kind, values, keep_in, shift, parts, b, places)
                distance, bound = part_distance(*how), part_bound(*how)
                assert bound <= distance + 1e-9
                least = float((-seen if keep_in else seen).min())
                if least > 0.0:
                    assert distance <= least + 1e-6
                    assert distance > least - 0.02


def test_no_part_reaches_farther_than_the_bound_of_the_whole_body() -> None:
    random, parts = np.random.default_rng(4), as_arrays(PARTS, VEHICLE)
    assert parts.reach < 0.5
    places = posed(random)
    for b in range(len(PARTS)):
        away = points_of(parts, b, places, random) - places[0]
        assert np.linalg.norm(away, axis=1).max() <= parts.reach
