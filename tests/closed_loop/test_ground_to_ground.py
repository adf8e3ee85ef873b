"""From standing to standing: arm, take off, hold, land, disarm."""

from __future__ import annotations

import math

import pytest

from fsw.autopilot.signals import Mode
from tests.closed_loop.harness import ARM, LAND, TAKEOFF, Flight, command, on_the_ground


def test_one_hop_goes_through_its_modes_and_ends_standing() -> None:
    flight = Flight(on_the_ground())
    flight.run(0.2)
    stood = flight.sim.truth().p_WB
    assert flight.mode is Mode.DISARMED
    flight.step(command(ARM, 1.0))
    flight.run(0.5)
    assert math.dist(flight.sim.truth().p_WB, stood) < 0.005, "armed, it stands and idles"
    flight.step(command(TAKEOFF))
    flight.run(4.5)
    assert flight.modes == [Mode.HOLD, Mode.TAKEOFF, Mode.HOLD]
    x, y, z = flight.sim.truth().p_WB
    climbed = flight.config.limits.takeoff_climb
    assert math.isclose(stood[2] - z, climbed, abs_tol=0.05)
    assert math.hypot(x - stood[0], y - stood[1]) < 0.1
    flight.step(command(LAND))
    flight.run(climbed / flight.config.limits.land_speed + 2.0)
    assert flight.modes[3:] == [Mode.LAND, Mode.DISARMED]
    assert flight.sent[-1].rotor_thrust == (0.0, 0.0, 0.0, 0.0)
    x, y, z = flight.sim.truth().p_WB
    assert math.isclose(z, stood[2], abs_tol=0.01)
    assert math.hypot(x - stood[0], y - stood[1]) < 0.1
    assert [result for _, result in flight.results] == [0, 0, 0]
    assert flight.snapshot.failures == ()


def test_on_the_ground_it_refuses_to_follow_and_says_why() -> None:
    flight = Flight(on_the_ground())
    flight.step(command(ARM, 1.0))
    flight.step(command(176, 1.0, 4.0, 11.0))
    assert flight.mode is Mode.HOLD
    assert flight.results[-1] == (176, 1)
    assert any("ground" in text for text in flight.texts)


@pytest.mark.long
def test_the_second_hop_is_like_the_first() -> None:
    flight = Flight(on_the_ground())
    heights = []
    for _ in range(2):
        flight.step(command(ARM, 1.0))
        flight.step(command(TAKEOFF))
        flight.run(3.5)
        heights.append(flight.sim.truth().p_WB[2])
        flight.step(command(LAND))
        flight.run(1.0 / flight.config.limits.land_speed + 2.0)
        assert flight.mode is Mode.DISARMED
    assert math.isclose(heights[0], heights[1], abs_tol=0.02)
