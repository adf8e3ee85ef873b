"""What air does, each against its published formula."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from sitl.air.body_drag import body_drag
from sitl.air.ceiling_effect import ceiling_effect
from sitl.air.ground_effect import ground_effect
from sitl.air.load import SURFACES, Air, drag_force, rotor_gain, wall_force
from sitl.air.rotor_drag import rotor_drag
from sitl.air.wall_effect import IDEAL, wall_pull

R, ARM = 0.165, 0.3
HUBS = ARM * np.array([(-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])
RADII = np.full(4, R)
BESIDE = np.linalg.norm(HUBS[:, None] - HUBS, axis=2)
GROUND = ((0.0, 0.0, -1.0), 0.0)
LEVEL = np.eye(3)


def air(*surfaces: tuple[tuple[float, float, float], float], **numbers: Any) -> Air:
    """Numbers of an air in which nothing happens but what is named."""
    planes = np.zeros((SURFACES, 4))
    for k, (normal, offset) in enumerate(surfaces):
        planes[k] = (*normal, offset)
    usual = {"active": 1, "area": 0.0, "density": 1.225, "ground": 0, "ceiling": 0, "suction": 0.0}
    return Air(
        rotors=4,
        radius=RADII,
        beside=BESIDE,
        wind=np.zeros(3),
        drag=np.zeros(3),
        surfaces=planes,
        surface_count=len(surfaces),
        **{**usual, **numbers},
    )


def of_four(z: float) -> float:
    """Gain of a rotor of four at a height [m]."""
    return ground_effect(RADII, z, BESIDE, 0, 4)


def alone(z: float) -> float:
    """Gain of a single rotor at a height [m]."""
    return ground_effect(RADII, z, BESIDE, 0, 1)


def at_hub(
    i: int, p: tuple[float, float, float], rotation: np.ndarray
) -> tuple[float, float, float]:
    """Hub of rotor ``i`` with the base at p [m, NED]."""
    x, y, z = (p + rotation @ HUBS[i]).tolist()
    return (x, y, z)


@pytest.mark.parametrize(
    ("z_over_r", "ratio"),
    # Cheeseman and Bennett: 1 / (1 - (R / 4z)^2).
    [(0.5, 4.0 / 3.0), (1.0, 16.0 / 15.0), (2.0, 64.0 / 63.0), (4.0, 256.0 / 255.0)],
)
def test_a_rotor_alone_gains_what_cheeseman_and_bennett_say(z_over_r: float, ratio: float) -> None:
    assert alone(z_over_r * R) == pytest.approx(ratio, rel=1e-12)


@pytest.mark.parametrize("z_over_r", [0.5, 1.0, 2.0, 3.0])
def test_four_rotors_gain_what_sanchez_cuevas_says(z_over_r: float) -> None:
    z, d = z_over_r * R, math.sqrt(2.0) * ARM
    lost = (
        (R / (4 * z)) ** 2
        + R**2 * z / math.sqrt((d**2 + 4 * z**2) ** 3)
        + R**2 / 2 * z / math.sqrt((2 * d**2 + 4 * z**2) ** 3)
    )
    assert of_four(z) == pytest.approx(1.0 / (1.0 - lost), rel=1e-12)
    assert of_four(z) > alone(z)


def test_on_the_ground_the_gain_is_that_of_half_a_radius() -> None:
    assert of_four(-0.1) == of_four(0.5 * R)


@pytest.mark.parametrize("d_over_r", [0.2, 0.5, 1.0, 3.0])
def test_a_ceiling_gains_what_momentum_theory_says(d_over_r: float) -> None:
    """From the balances themselves: pressure jump, momentum with the ceiling's suction, power."""
    rho, power, area = 1.225, 100.0, math.pi * R * R
    near = 1.0 / d_over_r

    def imbalance(v: float) -> float:
        thrust = power / v
        v_end = math.sqrt(2.0 * thrust / (rho * area))
        suction = 0.5 * rho * area * v * v * near * near / 8.0
        return rho * area * v * v_end - (thrust - suction)

    low, high = 0.1, 100.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if imbalance(middle) < 0.0 else (low, middle)
    free = (power * math.sqrt(2.0 * rho * area)) ** (2.0 / 3.0)
    assert ceiling_effect(R, d_over_r * R) == pytest.approx(power / low / free, rel=1e-9)


def test_far_from_all_surfaces_thrust_is_what_it_was() -> None:
    assert of_four(50.0) == pytest.approx(1.0, abs=1e-5)
    assert ceiling_effect(R, 50.0) == pytest.approx(1.0, abs=1e-5)
    assert wall_pull(0.05, R, 50.0, 8.0) == pytest.approx(0.0, abs=1e-5)


def test_rotor_drag_is_linear_along_each_axis_and_body_drag_quadratic() -> None:
    drag = 3.5 * np.array([0.544, 0.386, 0.0])
    assert rotor_drag(drag, (2.0, -1.0, 3.0)) == pytest.approx((-3.808, 1.351, 0.0))
    assert body_drag(0.05, 1.225, (3.0, 0.0, 4.0)) == pytest.approx(
        (-0.5 * 1.225 * 0.05 * 5.0 * 3.0, 0.0, -0.5 * 1.225 * 0.05 * 5.0 * 4.0)
    )


def test_drag_is_felt_against_the_air_in_the_bodys_axes() -> None:
    numbers = air()
    numbers.drag[:] = (2.0, 1.0, 0.0)
    numbers.wind[:] = (3.0, 0.0, 0.0)
    assert drag_force(numbers, (3.0, 0.0, 0.0), LEVEL) == pytest.approx((0.0, 0.0, 0.0))
    assert drag_force(numbers, (0.0, 0.0, 0.0), LEVEL) == pytest.approx((6.0, 0.0, 0.0))
    turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # yaw of 90 deg
    # Wind from the south blows at the left side of a vehicle that looks east.
    assert drag_force(numbers, (0.0, 0.0, 0.0), turned) == pytest.approx((0.0, -3.0, 0.0))


def test_a_tilted_vehicle_gains_more_at_the_lower_rotor() -> None:
    numbers = air(GROUND, ground=1)
    s, c = math.sin(0.2), math.cos(0.2)
    nose_up = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    rear, left, front, right = (
        rotor_gain(numbers, at_hub(i, (0.0, 0.0, -0.3), nose_up), i) for i in range(4)
    )
    assert rear > left == right > front > 1.0
    assert left == pytest.approx(of_four(0.3))


def test_a_ceiling_is_a_wall_whose_free_side_is_below() -> None:
    roof = ((0.0, 0.0, 1.0), -2.0)  # 2 m above the ground
    numbers = air(GROUND, roof, ground=1, ceiling=1)
    expected = of_four(1.8) * ceiling_effect(R, 0.2)
    assert rotor_gain(numbers, at_hub(0, (0.0, 0.0, -1.8), LEVEL), 0) == pytest.approx(expected)
    off = air(GROUND, roof)
    assert rotor_gain(off, at_hub(0, (0.0, 0.0, -1.8), LEVEL), 0) == 1.0


@pytest.mark.parametrize("d_over_r", [1.0, 1.5, 3.0])
def test_a_wall_pulls_as_the_suction_upon_it_does(d_over_r: float) -> None:
    """From the other side: the pressure on the wall of the rotor's source and its image."""
    rho, v_i, d = 1.225, 6.0, d_over_r * R
    area = math.pi * R * R
    thrust, source = 2.0 * rho * area * v_i**2, area * v_i
    r = np.linspace(0.0, 300.0 * d, 400_000)
    along = 2.0 * source / (4.0 * math.pi) * r / (r * r + d * d) ** 1.5
    suction = 0.5 * rho * along**2 * 2.0 * math.pi * r
    pull = float(np.sum(0.5 * (suction[1:] + suction[:-1]) * np.diff(r)))
    assert wall_pull(IDEAL, R, d, thrust) == pytest.approx(pull, rel=1e-3)


def test_a_wall_pulls_and_pulls_more_at_half_the_distance() -> None:
    numbers = air(GROUND, ((-1.0, 0.0, 0.0), -1.0), suction=0.04)
    forces = [wall_force(numbers, at_hub(i, (0.4, 0.0, -1.2), LEVEL), i, 8.0) for i in range(4)]
    x, y, z = np.sum(forces, axis=0)
    hubs = [1.0 - (0.4 + dx) for dx in (-ARM, 0.0, ARM, 0.0)]
    assert x == pytest.approx(sum(0.04 * 8.0 * (R / d) ** 2 for d in hubs))
    assert (y, z) == (0.0, 0.0)
    assert wall_pull(0.04, R, 2.0 * R, 8.0) == pytest.approx(4.0 * wall_pull(0.04, R, 4.0 * R, 8.0))
    assert wall_pull(0.04, R, 0.0, 8.0) == pytest.approx(0.04 * 8.0)  # no more than that
