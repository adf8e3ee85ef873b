"""The vehicle's parts: where they are, how they move, and how their places feel the inputs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fsw.autopilot.model.airframe import AIRFRAME, airframe_of
from fsw.autopilot.model.body import Body, body_of, hull_reach, reaches
from fsw.autopilot.model.kinematics import (
    FRAME,
    fill_frame,
    frame_of,
    position,
    velocity,
)
from fsw.autopilot.model.linearisation import TURNED, Linearisation, chain, fill_slopes, fill_turned
from fsw.autopilot.model.parts import ON_BASE, Part
from fsw.autopilot.model.prediction import Array, condense
from fsw.autopilot.signals import Vec3
from tests.fsw.autopilot.model.geometry_by_rotation import attitude, moved_on
from tests.fsw.paper_arm import INPUTS, LENGTHS, STATES
from tests.fsw.random_states import any_estimate, prediction_vector, vec3
from tests.paper_vehicle import ROTOR_ARM
from tests.vehicles.random_vehicles import random_vehicle

FULL, POINTS = body_of("full", AIRFRAME), body_of("points", AIRFRAME)
NODES = 3
MODEL = condense(AIRFRAME, 0.1, NODES)
PLACES = [(part.on, end) for part in FULL.parts for end in (part.begin, part.end) if end]
PLACES += [(ON_BASE, (0.3, -0.2, 0.1)), (ON_BASE, (0.0, 0.4, 0.0))]


def by_rotation(x: Array, on: int, local: Vec3) -> Array:
    """A place in the world by chained rotations."""
    R_WB, p = attitude(x[6:9], x[13]), x[0:3]
    if on == ON_BASE:
        return np.asarray(p + R_WB.apply(local))
    link = R_WB * Rotation.from_euler("Y", x[15])
    if on == 2:
        p = p + link.apply([0.0, 0.0, LENGTHS[0]])
        link = link * Rotation.from_euler("Y", x[17])
    return np.asarray(p + link.apply(local))


def frame_at(x: Array) -> Array:
    frame = np.zeros(FRAME)
    fill_frame(x, AIRFRAME.bodies, frame)
    return frame


def test_every_place_is_where_chained_rotations_put_it_and_moves_as_they_do() -> None:
    random, moment = np.random.default_rng(1), 1e-5
    for _ in range(20):
        x = prediction_vector(random)
        frame = frame_at(x)
        for on, local in PLACES:
            np.testing.assert_allclose(
                position(frame, on, local), by_rotation(x, on, local), atol=1e-12
            )
            after, before = (by_rotation(moved_on(x, t), on, local) for t in (moment, -moment))
            np.testing.assert_allclose(
                velocity(frame, on, local), (after - before) / (2.0 * moment), atol=1e-6
            )


def test_no_place_is_further_off_than_the_body_reaches() -> None:
    """From the base and from every joint that moves it, in any posture."""
    random = np.random.default_rng(2)
    for joints in range(1, 7):
        vehicle = random_vehicle(random, joints)
        parts = [
            Part(f"part{k}", on, vec3(random.uniform(-0.3, 0.3, 3)), 0.1)
            for k, on in enumerate(random.integers(0, joints + 1, 8).tolist())
        ]
        airframe = replace(airframe_of(vehicle), parts=tuple(parts))
        reach = reaches(body_of("full", airframe), airframe.bodies)
        assert len(reach) == 1 + joints
        for _ in range(50):
            frame = frame_of(airframe.bodies, any_estimate(random, joints))
            for part in parts:
                at = np.array(position(frame, part.on, part.begin))
                for origin in range(part.on + 1):
                    away = np.linalg.norm(at - position(frame, origin, (0.0, 0.0, 0.0)))
                    assert away <= reach[origin] + 1e-12
        straight = max(np.linalg.norm(part.begin) for part in parts if part.on == 0)
        assert reach[0] >= straight


def test_slopes_in_the_inputs_are_finite_differences() -> None:
    random, step, node = np.random.default_rng(3), 1e-5, NODES
    turned, slopes = np.zeros((TURNED, 3)), np.zeros((2, STATES))
    for _ in range(3):
        start, inputs = prediction_vector(random), random.uniform(-2.0, 2.0, INPUTS * NODES)
        n = vec3(random.standard_normal(3))
        frames = {}
        for column in range(INPUTS * NODES):
            for sign in (1.0, -1.0):
                moved = inputs.copy()
                moved[column] += sign * step
                frames[column, sign] = linearised(start, moved).horizon.frames[node]
        horizon = linearised(start, inputs).horizon
        fill_turned(horizon.frames[node], n, turned)
        for on, local in PLACES:
            fill_slopes(horizon.frames[node], on, local, n, turned, slopes)
            for row, seen in enumerate((position, velocity)):
                gradient = np.zeros(INPUTS * NODES)
                chain(horizon.impulse, node, slopes[row], gradient)
                expected = [
                    np.dot(
                        n,
                        np.subtract(
                            seen(frames[column, 1.0], on, local),
                            seen(frames[column, -1.0], on, local),
                        ),
                    )
                    / (2.0 * step)
                    for column in range(INPUTS * NODES)
                ]
                np.testing.assert_allclose(gradient, expected, atol=1e-7, rtol=1e-6)


def linearised(start: Array, inputs: Array) -> Linearisation:
    horizon = Linearisation(MODEL)
    horizon.refill(start, inputs)
    return horizon


def test_both_bodies_begin_with_the_papers_three_points() -> None:
    names = ["base", "joint2", "end_effector"]
    assert [part.name for part in POINTS.parts] == names
    assert [part.name for part in FULL.parts][:3] == names
    assert all(part.radius == 0.0 and part.end is None for part in POINTS.parts)
    assert len({part.name for part in FULL.parts}) == len(FULL.parts)


def test_the_ends_of_every_capsule_are_in_spheres_of_other_parts() -> None:
    """A capsule's own row is for the places between its ends only."""
    x = prediction_vector(np.random.default_rng(4))
    frame = frame_at(x)
    spheres = [
        (np.array(position(frame, part.on, part.begin)), part.radius)
        for part in FULL.parts
        if part.end is None and part.rim == 0.0
    ]
    capsules = [part for part in FULL.parts if part.end is not None]
    assert len(capsules) == 6
    for part in capsules:
        for local in (part.begin, part.end):
            assert local is not None
            end = np.array(position(frame, part.on, local))
            room = max(radius - np.linalg.norm(end - centre) for centre, radius in spheres)
            assert room >= part.radius - 1e-12


def test_the_rotors_reach_as_far_as_their_blades_and_the_feet_as_far_as_the_legs() -> None:
    parts = {part.name: part for part in FULL.parts}
    assert parts["rotors"].rim == ROTOR_ARM + 0.165
    for k in range(1, 5):
        foot = parts[f"leg{k}_end"]
        assert foot.begin[2] + foot.radius == AIRFRAME.leg_length
        assert parts[f"leg{k}"].end == foot.begin


@pytest.mark.drawn(2)
@pytest.mark.parametrize(
    "normal",
    [(1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 0.0, 1.0), (0.6, 0.0, -0.8), (0.48, -0.6, 0.64)],
)
def test_a_hull_reaches_as_far_as_its_farthest_place_at_the_worst_yaw(normal: Vec3) -> None:
    farthest = max(
        part.radius + extent(part, Rotation.from_euler("z", yaw), np.array(normal))
        for part in FULL.parts
        if part.on == ON_BASE
        for yaw in np.linspace(-math.pi, math.pi, 721)
    )
    assert hull_reach(FULL, normal) == pytest.approx(farthest, abs=1e-4)
    assert hull_reach(POINTS, normal) == 0.0


def extent(part: Part, turned: Rotation, n: Array) -> float:
    """How far the middle line of a part, or its rim, is against a normal."""
    ends = [-float(n @ turned.apply(end)) for end in (part.begin, part.end) if end is not None]
    return max(ends) + part.rim * float(np.hypot(n[0], n[1]))


@pytest.mark.parametrize(("body", "rows"), [(POINTS, 3), (FULL, 17)])
def test_a_probe_is_a_row_and_the_rotors_have_four(body: Body, rows: int) -> None:
    probes = body.probes
    assert len(probes) == rows
    assert probes[:, 0].tolist() == sorted(probes[:, 0].tolist())
    of_rotors = [row for row in probes if row[10] > 0.0]
    assert [row[11] for row in of_rotors] == pytest.approx(
        [0.0, math.pi / 2, math.pi, 1.5 * math.pi] if rows > 3 else []
    )
