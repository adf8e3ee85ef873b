"""A foot on the ground pushes, never pulls, and rubs against its slip."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sitl.plant.contact import contact_force, ground_wrench
from sitl.plant.parameters import plant
from sitl.plant.vector import Array
from tests.sitl.vehicles import PAPER

FEET = plant(PAPER).feet
LENGTH = PAPER.feet.positions[0][2]  # m, of the legs
SPEED = st.floats(-3.0, 3.0)
LEVEL: Array = np.eye(3)
UP = (0.0, 0.0, -1.0)


@given(st.floats(1e-6, 0.05), SPEED, SPEED, SPEED)
def test_the_reaction_lies_in_the_friction_cone_and_opposes_slip(
    depth: float, vx: float, vy: float, vz: float
) -> None:
    fx, fy, fz = contact_force(FEET.law, depth, UP, (vx, vy, vz))
    assert fz <= 0.0  # up, in NED
    assert math.hypot(fx, fy) <= FEET.law.friction * -fz * (1.0 + 1e-12)
    assert fx * vx + fy * vy <= 0.0


def test_the_reaction_begins_without_a_jump() -> None:
    assert abs(contact_force(FEET.law, 1e-9, UP, (0.0, 0.0, 2.0))[2]) < 1e-3


def test_a_vehicle_in_the_air_feels_no_ground() -> None:
    still = (0.0, 0.0, 0.0)
    above = (0.0, 0.0, -LENGTH - 1e-6)
    assert ground_wrench(FEET, above, still, still, LEVEL) == (still, still)


def test_a_level_vehicle_is_carried_by_all_feet_alike() -> None:
    still = (0.0, 0.0, 0.0)
    force, moment = ground_wrench(FEET, (0.0, 0.0, 0.002 - LENGTH), still, still, LEVEL)
    assert abs(force[2] + 4 * 0.002 * PAPER.feet.stiffness) < 1e-9
    assert max(map(abs, (*force[:2], *moment))) < 1e-9


def test_a_foot_that_is_deeper_lifts_its_side() -> None:
    small = 0.02  # rad about +x: the right feet go down
    c, s = math.cos(small), math.sin(small)
    rolled: Array = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    still = (0.0, 0.0, 0.0)
    _, moment = ground_wrench(FEET, (0.0, 0.0, -LENGTH), still, still, rolled)
    assert moment[0] < 0.0
