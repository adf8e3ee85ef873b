"""The arm's plane turns to the wall that is worked at."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sitl.heading import facing
from sitl.mission_clock import MissionClock
from sitl.scenario import ScenarioWall
from sitl.scenario_file import load_scenario

FRONT = ScenarioWall("front", (-1.0, 0.0, 0.0), -1.0, 0.1)
LEFT = ScenarioWall("left", (0.0, 1.0, 0.0), -1.0, 0.1)
CEILING = ScenarioWall("ceiling", (0.0, 0.0, 1.0), -3.0, 0.1)


@pytest.mark.parametrize("degrees", [0.0, 30.0, 90.0, 135.0, 200.0, 300.0])
def test_beside_one_wall_its_normal_lies_in_the_arms_plane(degrees: float) -> None:
    normal = (math.cos(math.radians(degrees)), math.sin(math.radians(degrees)), 0.0)
    yaw = facing((ScenarioWall("any", normal, -1.0, 0.1),), (0.0, 0.0, 0.0))
    across = -math.sin(yaw) * normal[0] + math.cos(yaw) * normal[1]
    assert across == pytest.approx(0.0, abs=1e-12)
    assert 0.0 <= yaw < math.pi


def test_the_nearer_wall_decides_and_a_corner_is_faced_between() -> None:
    walls = (FRONT, LEFT)
    assert facing(walls, (0.9, 0.5, 0.0)) == pytest.approx(0.0, abs=1e-3)
    assert facing(walls, (0.0, -0.9, 0.0)) == pytest.approx(0.5 * math.pi, abs=1e-3)
    assert facing(walls, (0.9, -0.9, 0.0)) == pytest.approx(0.25 * math.pi)


def test_on_the_way_round_the_niche_yaw_is_continuous() -> None:
    clock = MissionClock(load_scenario("walls"))
    yaws = np.array([clock.yaw_at(0.1 * k) for k in range(1200)])
    assert np.abs(np.diff(yaws)).max() < 0.1
    assert yaws.min() < 0.1
    assert yaws.max() > 1.4


def test_without_upright_walls_or_without_being_asked_the_yaw_of_the_start_stays() -> None:
    walls = load_scenario("walls")
    turned = replace(walls, start=replace(walls.start, yaw_deg=30.0))
    assert turned.trajectory.kind == "lissajous"
    for same in (
        replace(turned, walls=(CEILING,)),
        replace(turned, trajectory=replace(turned.trajectory, heading="start")),
    ):
        clock = MissionClock(same)
        assert {clock.yaw_at(float(k)) for k in range(20)} == {math.radians(30.0)}
