"""Position servos of the joints."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sitl.plant.parameters import Effects
from sitl.scenario_file import load_scenario
from sitl.servos import PositionServos, ranges, targets
from sitl.simulation import STEP_US, Controls, Simulation
from sitl.start import on_the_ground
from tests.sitl.vehicles import PAPER

STEP_S = 1e-6 * STEP_US
REST = (0.0, 0.0, 0.0, 0.0)
RANGES = [most for _, most in ranges(PAPER)]


def moved(*commands: tuple[float, float], seconds: float = 2.0) -> np.ndarray:
    """Angles and rates (n, 4) of an arm on its legs, a command after the other."""
    simulation = Simulation(on_the_ground(load_scenario("ground")), 0)
    servos = PositionServos(simulation.vehicle, Effects(), simulation.healthy().q_arm, STEP_S)
    rows = []
    for command in commands:
        for _ in range(round(seconds / STEP_S)):
            now = simulation.healthy()
            torques = servos.torques(command, now.q_arm, now.qd_arm, powered=True)
            simulation.advance(Controls(REST, torques, armed=True))
            rows.append((*now.q_arm, *now.qd_arm))
    return np.array(rows)


@pytest.mark.parametrize("command", [(0.5, -0.5), (-1.0, 1.0), (0.0, 0.7), (0.3, 0.3)])
def test_a_command_is_a_share_of_the_joints_range_and_is_held(
    command: tuple[float, float],
) -> None:
    wanted = np.array([RANGES[0] * command[0], RANGES[1] * command[1]])
    rows = moved(command)
    assert rows[-50:, :2] == pytest.approx(np.tile(wanted, (50, 1)), abs=math.radians(0.3))
    assert np.abs(rows[:, 2:]).max() < 5.0  # rad/s, the limit of the joints


def test_it_turns_at_the_speed_of_a_servo_and_does_not_overshoot() -> None:
    rows = moved((1.0, -1.0), (-1.0, 1.0))
    assert np.abs(rows[:, 2:]).max() < 5.0
    assert rows[:, 0].max() < RANGES[0] + math.radians(1.5)
    assert rows[:, 0].min() > -RANGES[0] - math.radians(1.5)


def test_commands_beyond_the_range_or_against_the_end_stops_stop_at_the_limit() -> None:
    rows = moved((1.0, 1.0), (5.0, 5.0))
    angles = rows[-1, :2]
    assert angles[0] == pytest.approx(RANGES[0], abs=math.radians(0.3))
    assert angles.sum() == pytest.approx(math.radians(90.0), abs=math.radians(0.3))


def test_without_power_it_is_limp_and_begins_where_the_arm_is() -> None:
    simulation = Simulation(on_the_ground(load_scenario("ground")), 0)
    servos = PositionServos(simulation.vehicle, Effects(), (0.0, 0.0), STEP_S)
    for _ in range(100):
        servos.torques((1.0, 1.0), (0.0, 0.0), (0.0, 0.0), powered=True)
    assert servos.torques((1.0, 1.0), (0.2, -0.1), (0.0, 0.0), powered=False) == (0.0, 0.0)
    first = servos.torques((1.0, 1.0), (0.2, -0.1), (0.0, 0.0), powered=True)
    assert all(abs(one) < 0.05 for one in first)


def test_a_joint_whose_range_does_not_have_zero_in_its_middle() -> None:
    first, second = PAPER.joints
    askew = replace(first, position_min=-0.5, position_max=1.0)
    vehicle = replace(PAPER, joints=(askew, second))
    assert targets(vehicle, (1.0, 0.0)) == [1.0, 0.0]
    assert targets(vehicle, (-1.0, 0.0)) == [-0.5, 0.0]
    assert targets(vehicle, (0.5, 0.5)) == [0.5, math.pi / 4.0]
