"""Which vehicles fly on without a rotor: a linear program for each question is the oracle."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import linprog

from fsw.autopilot.control.rotor_loss import (
    balancing_posture,
    flies_without,
    tilting_authority,
    yaw_authority,
)
from fsw.autopilot.model.airframe import GRAVITY, Airframe, airframe_of
from fsw.autopilot.model.multibody import Multibody, posture
from tests.vehicles.random_vehicles import random_vehicle
from vehicles.vehicle_file import load_vehicle, vehicle_names

SHIPPED = {name: airframe_of(load_vehicle(name)) for name in vehicle_names()}


def home(airframe: Airframe) -> tuple[float, ...]:
    return airframe.home_posture[: airframe.bodies.joints]


def program(airframe: Airframe, without: int, m: Multibody) -> tuple[np.ndarray, np.ndarray, list]:
    """Torque about the body's origin and lift (4, r), what hover takes of them (4,), bounds."""
    n, weight = airframe.rotors, airframe.mass * GRAVITY
    w = np.array(airframe.wrench[: 6 * n]).reshape(n, 6)
    effect = np.array([w[:, 3], w[:, 4], w[:, 5], -w[:, 2]])
    level = np.array([-m.centre[1] * weight, m.centre[0] * weight, 0.0, weight])
    most = np.array(airframe.rotor_thrust_max[:n])
    most[without] = 0.0
    return effect, level, [(0.0, one) for one in most]


@pytest.mark.drawn(2)
@pytest.mark.parametrize("rotors", [4, 5, 6, 8])
def test_what_is_left_to_tilt_with_is_the_optimum_of_a_linear_program(rotors: int) -> None:
    random = np.random.default_rng(rotors)
    for _ in range(5):
        airframe = airframe_of(random_vehicle(random, 2, rotors, 0.1))
        lost = int(random.integers(rotors))
        m = posture(airframe.bodies, airframe.home_posture)
        effect, level, bounds = program(airframe, lost, m)
        inertia = np.array([m.inertia[0], m.inertia[4]])
        found = []
        for angle in np.linspace(0.0, 2.0 * math.pi, 32, endpoint=False):
            u = np.array([math.cos(angle), math.sin(angle)]) / inertia
            best = linprog(-u @ effect[:2], A_eq=effect[3:], b_eq=level[3:], bounds=bounds)
            found.append(-best.fun - u @ level[:2] if best.success else -math.inf)
        assert tilting_authority(airframe, (lost,)) == pytest.approx(min(found), rel=1e-6)


def test_quadrotors_do_not_fly_without_a_rotor_and_others_do() -> None:
    for airframe in SHIPPED.values():
        fly = [flies_without(airframe, k) for k in range(airframe.rotors)]
        assert fly == [airframe.rotors > 4] * airframe.rotors


def test_what_is_left_to_turn_with_is_between_the_optima_of_linear_programs() -> None:
    """Allocation has one yaw for each of the other wishes; a program may have more, never less."""
    for airframe in (SHIPPED["hexa-3r"], SHIPPED["octo-4r"]):
        q = home(airframe)
        m = posture(airframe.bodies, q)
        for lost in range(airframe.rotors):
            effect, level, bounds = program(airframe, lost, m)
            kept = [0, 1, 3]
            sides = [
                -linprog(-sign * effect[2], A_eq=effect[kept], b_eq=level[kept], bounds=bounds).fun
                for sign in (1.0, -1.0)
            ]
            most = min(sides) / m.inertia[8]
            left = yaw_authority(airframe, q, (lost,))
            assert left <= most + 1e-9
            assert left == pytest.approx(most, abs=0.5 * abs(most))


def test_a_hexarotor_holds_its_heading_with_its_arm_on_the_far_side_of_the_lost_rotor() -> None:
    airframe = SHIPPED["hexa-3r"]
    for lost in range(6):
        balance = balancing_posture(airframe, lost)
        assert balance is not None
        assert yaw_authority(airframe, balance, (lost,)) > 2.0
        x, y, _ = posture(airframe.bodies, balance).centre
        w = airframe.wrench[6 * lost : 6 * lost + 6]
        assert x * w[4] + y * -w[3] < 0.0, "its thrust turns the vehicle by where it acts"


def test_an_octorotor_holds_its_heading_in_any_posture() -> None:
    assert {balancing_posture(SHIPPED["octo-4r"], k) for k in range(8)} == {None}
