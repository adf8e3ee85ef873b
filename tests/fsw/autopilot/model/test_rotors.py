"""Acceleration, jerk and snap of the rotor model against a simulated attitude motion."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from fsw.autopilot.model.airframe import AIRFRAME, GRAVITY, airframe_of
from fsw.autopilot.model.multibody import posture
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.model.rotors import (
    estimate_mass,
    lag_rotor,
    rotor_decay,
    rotor_names,
    swing,
)
from fsw.autopilot.signals import Vec3, Vec4
from tests.fsw.random_states import estimate_of, vec3
from tests.fsw.records import measured_motion
from tests.paper_vehicle import ROTOR_ARM, YAW_PER_THRUST
from tests.sitl.pinocchio_model import configuration, pinocchio_model
from vehicles.vehicle_file import load_vehicle, vehicle_names

MOMENT = 1e-3  # s


def torque(rotors: Vec4, joint1: float) -> Array:
    """What the four rotors and the arm's reaction do to the body: rear, left, front, right."""
    rear, left, front, right = rotors
    reach, drag = ROTOR_ARM, YAW_PER_THRUST
    return np.array(
        [
            reach * (left - right),
            reach * (front - rear) - joint1,
            drag * (rear - left + front - right),
        ]
    )


def acceleration_at(t: float, rotation: Rotation, w: Array, rotors: Vec4, joint1: float) -> Array:
    """World acceleration after Euler's equation has turned the body for ``t`` (either sign)."""
    # From rest the arm hangs straight down, and rolls with the body.
    inertia = posture(AIRFRAME.bodies, (0.0, 0.0)).inertia.reshape(3, 3)

    def rates(_: float, y: Array) -> Array:
        turn, spin = y[:9].reshape(3, 3), y[9:]
        cross = np.array(
            [[0.0, -spin[2], spin[1]], [spin[2], 0.0, -spin[0]], [-spin[1], spin[0], 0.0]]
        )
        push = torque(rotors, joint1) - np.cross(spin, inertia @ spin)
        return np.concatenate(((turn @ cross).ravel(), np.linalg.solve(inertia, push)))

    y = np.concatenate((rotation.as_matrix().ravel(), w))
    if t:
        y = solve_ivp(rates, (0.0, t), y, rtol=1e-12, atol=1e-12).y[:, -1]
    lift = np.array([0.0, 0.0, -sum(rotors) / AIRFRAME.mass])
    return np.asarray(np.array([0.0, 0.0, GRAVITY]) + y[:9].reshape(3, 3) @ lift)


def random_rotors(random: np.random.Generator) -> Vec4:
    f = [float(value) for value in random.uniform(4.0, 14.0, 4)]
    return (f[0], f[1], f[2], f[3])


def test_acceleration_and_jerk_are_those_of_the_simulated_motion() -> None:
    random = np.random.default_rng(1)
    for _ in range(20):
        angles = random.uniform([-math.pi, -0.8, -0.8], [math.pi, 0.8, 0.8])
        rotation = Rotation.from_euler("ZYX", angles)
        w, rotors = random.uniform(-2.0, 2.0, 3), random_rotors(random)
        motion = measured_motion(AIRFRAME, estimate_of(rotation, vec3(w)), rotors, (0.1, 0.0))
        now = acceleration_at(0.0, rotation, w, rotors, 0.1)
        after = acceleration_at(MOMENT, rotation, w, rotors, 0.1)
        before = acceleration_at(-MOMENT, rotation, w, rotors, 0.1)
        assert motion.thrust == pytest.approx(sum(rotors))
        np.testing.assert_allclose(motion.a, now, atol=1e-9)
        np.testing.assert_allclose(motion.j, ((after - before) / (2 * MOMENT))[:2], atol=1e-3)


def test_snap_is_that_of_a_motion_that_starts_from_rest() -> None:
    random = np.random.default_rng(2)
    for _ in range(20):
        angles = random.uniform([-math.pi, -0.8, -0.8], [math.pi, 0.8, 0.8])
        rotation = Rotation.from_euler("ZYX", angles)
        rotors, joint1 = random_rotors(random), float(random.uniform(-1.0, 1.0))
        motion = measured_motion(AIRFRAME, estimate_of(rotation), rotors, (joint1, 0.0))
        still = np.zeros(3)
        before, now, after = (
            acceleration_at(t, rotation, still, rotors, joint1) for t in (-MOMENT, 0.0, MOMENT)
        )
        snap = (after - 2.0 * now + before) / MOMENT**2
        np.testing.assert_allclose(motion.s, snap[:2], rtol=1e-3, atol=0.02)


@pytest.mark.parametrize(
    ("rotors", "sign"),
    [((8.0, 8.5, 8.5, 8.5), -1.0), ((8.5, 8.5, 8.0, 8.5), 1.0)],
    ids=["front lifts more: brakes", "rear lifts more: speeds up"],
)
def test_thrust_difference_along_the_body_decides_forward_snap(rotors: Vec4, sign: float) -> None:
    motion = measured_motion(AIRFRAME, estimate_of(Rotation.identity()), rotors)
    assert sign * motion.s[0] > 1.0
    assert motion.s[1] == pytest.approx(0.0)


def test_more_thrust_on_the_left_accelerates_to_the_right() -> None:
    motion = measured_motion(AIRFRAME, estimate_of(Rotation.identity()), (8.5, 8.5, 8.5, 8.0))
    assert motion.s[1] > 1.0


def test_level_hover_has_no_acceleration() -> None:
    each = AIRFRAME.mass * GRAVITY / 4.0
    level = estimate_of(Rotation.from_euler("Z", 2.0))
    still: Vec3 = (0.0, 0.0, 0.0)
    assert measured_motion(AIRFRAME, level, (each,) * 4).a == pytest.approx(still)


def test_rotors_close_63_percent_of_a_step_in_one_time_constant() -> None:
    dt = 0.008  # an odd number of steps: a sign that flips each time must show
    decay, thrust = rotor_decay(AIRFRAME, dt), (0.0, 10.0, 2.0, 5.0)
    for _ in range(round(AIRFRAME.rotor_lag / dt)):
        goals = (10.0, 0.0, 4.0, 6.0)
        thrust = tuple(lag_rotor(f, goal, decay) for f, goal in zip(thrust, goals, strict=True))
    share = 1.0 - math.exp(-1.0)
    assert thrust == pytest.approx(
        (10.0 * share, 10.0 * (1 - share), 2.0 + 2.0 * share, 5.0 + share)
    )


@pytest.mark.parametrize("true_mass", [2.8, 3.5, 4.2])
def test_the_vehicle_is_weighed_within_seconds(true_mass: float) -> None:
    mass, rotors = AIRFRAME.mass, (9.0, 8.0, 8.5, 8.0)
    for _ in range(2500):
        mass = estimate_mass(AIRFRAME, mass, rotors, sum(rotors) / true_mass, 0.002)
    assert mass == pytest.approx(true_mass, rel=0.01)


@pytest.mark.parametrize("specific_force", [0.0, -9.81, math.nan, 1e-3])
def test_what_is_no_flight_is_not_weighed(specific_force: float) -> None:
    assert estimate_mass(AIRFRAME, 3.3, (8.0,) * 4, specific_force, 0.002) == 3.3


def test_the_scales_stay_near_what_is_believed() -> None:
    mass = AIRFRAME.mass
    for _ in range(5000):
        mass = estimate_mass(AIRFRAME, mass, (10.0,) * 4, 100.0, 0.002)
    assert mass == pytest.approx(0.7 * AIRFRAME.mass)


def test_a_rotor_is_named_by_its_side_where_that_tells_it_from_the_others() -> None:
    assert rotor_names(AIRFRAME) == [
        "rotor 1 (rear)", "rotor 2 (left)", "rotor 3 (front)", "rotor 4 (right)"
    ]  # fmt: skip
    assert rotor_names(airframe_of(load_vehicle("x500-2r")))[0] == "rotor 1 (front right)"
    eight = rotor_names(airframe_of(load_vehicle("octo-4r")))
    assert eight == [f"rotor {k}" for k in range(1, 9)], "two are on each side"


@pytest.mark.parametrize("name", vehicle_names())
def test_a_push_at_the_origin_turns_a_vehicle_as_pinocchio_says(name: str) -> None:
    vehicle = load_vehicle(name)
    airframe, model = airframe_of(vehicle), pinocchio_model(vehicle)
    level = np.array([1.0, 0.0, 0.0, 0.0])
    q = configuration(np.zeros(3), level, np.array(vehicle.home_posture))
    mass = pin.crba(model, model.createData(), q)
    mass = np.triu(mass) + np.triu(mass, 1).T
    pushes = np.zeros((model.nv, 3))
    pushes[:3] = airframe.mass * np.eye(3)
    turns = np.linalg.solve(mass, pushes)[3:6]
    assert swing(airframe) == pytest.approx(np.linalg.norm(turns, axis=0).max(), rel=1e-9)
