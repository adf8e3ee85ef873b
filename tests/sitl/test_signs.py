"""Which way things go: every sign of the plant that a controller depends on."""

from __future__ import annotations

import numpy as np
import pytest

from sitl.plant.aerial_manipulator import place_bodies, placed_acceleration_into
from sitl.plant.parameters import GRAVITY, plant
from sitl.plant.state import at_rest
from sitl.plant.trim import end_effector, level_hover
from sitl.plant.vector import Array
from tests.sitl.state_view import StateView
from tests.sitl.vehicles import PAPER, inputs, workspace

HOVER = PAPER.mass * GRAVITY / 4.0


def _acceleration(
    thrust: tuple[float, float, float, float] = (HOVER, HOVER, HOVER, HOVER),
    torque: tuple[float, float] = (0.0, 0.0),
    force_W: tuple[float, float, float] = (0.0, 0.0, 0.0),
    torque_B: tuple[float, float, float] = (0.0, 0.0, 0.0),
    q_WB: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0),
) -> Array:
    """Accelerations (8,) of a vehicle at rest in the air, arm straight down."""
    state = at_rest(4, 2)
    view = StateView(state)
    view.p_WB[2] = -5.0
    view.q_WB[:] = q_WB
    view.thrust[:] = thrust
    work = workspace()
    given = inputs(torque=torque, force_W=force_W, torque_B=torque_B)
    place_bodies(plant(PAPER), state, work)
    placed_acceleration_into(plant(PAPER), state, given, work)
    return work.load[:8].copy()


def test_hover_thrust_holds_the_vehicle_against_gravity() -> None:
    assert np.abs(_acceleration()).max() <= 1e-12


@pytest.mark.parametrize(
    ("rotor", "axis", "sign"),
    [(1, 3, 1.0), (3, 3, -1.0), (2, 4, 1.0), (0, 4, -1.0)],
    ids=["left rolls right", "right rolls left", "front pitches up", "rear pitches down"],
)
def test_a_stronger_rotor_turns_the_base(rotor: int, axis: int, sign: float) -> None:
    thrust = [HOVER] * 4
    thrust[rotor] += 1.0
    acceleration = _acceleration(thrust=(thrust[0], thrust[1], thrust[2], thrust[3]))
    assert sign * acceleration[axis] > 0.5
    # The first and third rotors turn the base to the right, the others to the left.
    assert (1.0 if rotor in (0, 2) else -1.0) * acceleration[5] > 0.0


def test_more_thrust_lifts() -> None:
    assert _acceleration(thrust=(HOVER + 1, HOVER + 1, HOVER + 1, HOVER + 1))[2] < -0.5


def test_a_nose_down_base_accelerates_forward() -> None:
    half = -0.1
    rotation_about_y = (np.cos(half), 0.0, np.sin(half), 0.0)
    in_body = _acceleration(q_WB=rotation_about_y)
    assert np.cos(2 * half) * in_body[0] + np.sin(2 * half) * in_body[2] > 1.0


def test_a_joint_torque_swings_the_arm_forward_and_kicks_the_base_back() -> None:
    acceleration = _acceleration(torque=(0.1, 0.0))
    assert acceleration[6] > 1.0
    assert acceleration[4] < 0.0


def test_the_second_joint_kicks_the_first_link_back() -> None:
    acceleration = _acceleration(torque=(0.0, 0.01))
    assert acceleration[7] > 1.0
    assert acceleration[6] < 0.0


def test_a_push_in_the_world_moves_the_base_that_way() -> None:
    turned_left = (np.cos(-np.pi / 4), 0.0, 0.0, np.sin(-np.pi / 4))  # nose west
    acceleration = _acceleration(force_W=(1.0, 0.0, 0.0), q_WB=turned_left)
    assert acceleration[1] > 0.2  # north is to the right
    assert abs(acceleration[0]) < 1e-12


def test_an_outer_torque_turns_the_base_that_way() -> None:
    assert _acceleration(torque_B=(0.0, 0.0, 0.1))[5] > 0.1


def test_positive_angles_swing_the_arm_forward() -> None:
    assert end_effector(PAPER, (0.3, 0.2))[0] > 0.1


def test_holding_the_arm_forward_loads_the_front_rotor() -> None:
    trim = level_hover(PAPER, (1.0, 0.0))
    assert trim.thrust[2] > trim.thrust[0]
    assert trim.torque[0] > 0.1  # gravity pulls the arm back to straight down
