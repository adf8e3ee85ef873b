"""Motors behind gears: inertia of the joints, gaps, and what teeth that meet keep."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sitl.plant.aerial_manipulator import Inputs, Plant, plant
from sitl.plant.integrator import held, integrate
from sitl.plant.parameters import Motors, Vehicle
from sitl.plant.state import ARM, at_rest
from sitl.plant.vector import Array
from sitl.scenario import ActuatorKeys
from sitl.scenario_file import ScenarioError, load_scenario
from sitl.scenario_validation import check
from tests.sitl.free_motion import frictionless, record_of, tumbling
from tests.sitl.test_conservation import weigh

STEP_S = 0.001
RATES = slice(ARM + 2, ARM + 4)
LOOSE = Motors(inertia=0.0025, backlash=math.radians(0.5))


def loose(gravity: float = 0.0) -> Vehicle:
    return replace(frictionless(gravity), motors=LOOSE)


class Arm:
    """A vehicle that is advanced step by step."""

    def __init__(self, vehicle: Vehicle, start: Array) -> None:
        self.plants = np.array([plant(vehicle)])
        self.state = start.copy()
        self.judged = np.empty((1, len(start)))

    @property
    def plant(self) -> Plant:
        now: Plant = self.plants[0]
        return now

    def step(self, torque: tuple[float, float] = (0.0, 0.0)) -> None:
        inputs = record_of(Inputs(np.zeros(4), np.array(torque), np.zeros(3), np.zeros(3)))
        room = np.empty((1, 4, 3)), self.judged
        integrate(self.plant, self.state, inputs, STEP_S, *room, held(2))

    def speeds(self) -> Array:
        """Of the motors [rad/s], whether free or not."""
        gears = self.plant.gears
        return np.where(gears.side == 0.0, gears.speed, self.state[RATES])


def test_a_motor_crosses_the_gap_alone_in_the_time_that_its_inertia_takes() -> None:
    arm = Arm(loose(), at_rest(2))
    # Half of 0.5 deg from the middle: sqrt(2 * 4.36 mrad * 0.0025 kg m² / 0.2 N m) = 10.4 ms.
    for _ in range(10):
        arm.step((0.2, 0.0))
    assert not arm.state[RATES].any()
    assert arm.speeds()[0] == pytest.approx(0.2 / 0.0025 * 0.01)
    assert arm.judged[0, RATES] == pytest.approx(arm.speeds())  # a servo's limit is its own
    before = arm.speeds()[0]
    arm.step((0.2, 0.0))
    assert arm.plant.gears.side[0] == 1.0
    assert 0.0 < arm.state[RATES][0] < before  # they share what the motor had


def test_teeth_keep_the_vehicles_momentum_and_give_no_energy() -> None:
    vehicle = loose()
    arm = Arm(vehicle, tumbling())

    def energy() -> float:
        return weigh(vehicle, arm.state)[0] + 0.5 * LOOSE.inertia * float(sum(arm.speeds() ** 2))

    _, momentum = weigh(vehicle, arm.state)
    last, meetings = energy(), 0
    for _ in range(200):
        sides = arm.plant.gears.side.copy()
        arm.step()
        meetings += int(np.count_nonzero((sides == 0.0) & (arm.plant.gears.side != 0.0)))
        now = energy()
        assert now <= last + 1e-9
        last = now
    assert meetings >= 2
    assert np.abs(weigh(vehicle, arm.state)[1] - momentum).max() <= 1e-7


def test_teeth_push_and_never_pull() -> None:
    arm = Arm(loose(), at_rest(2))
    for _ in range(40):
        arm.step((0.2, 0.0))
    gears = arm.plant.gears
    assert gears.side[0] == 1.0
    rate = arm.state[RATES][0]
    arm.step((-0.2, 0.0))
    assert gears.side[0] == 0.0
    # The motor is slowed, the link is not.
    assert arm.state[RATES][0] == pytest.approx(rate, rel=0.02)
    assert arm.speeds()[0] == pytest.approx(rate - 0.2 / 0.0025 * STEP_S, rel=0.02)


def test_a_gap_that_is_crossed_hardly_jerks_the_other_joint() -> None:
    """A joint that is driven while the other's motor is free turns no faster than with it."""
    rates = []
    for backlash in (0.0, LOOSE.backlash):
        vehicle = replace(frictionless(0.0), motors=replace(LOOSE, backlash=backlash))
        arm = Arm(vehicle, at_rest(2))
        for k in range(60):
            arm.step((-0.05 if k < 45 else 0.05, 0.05))
        rates.append(arm.state[RATES])
    assert abs(rates[1] - rates[0]).max() < 1.0


def test_backlash_needs_a_motor() -> None:
    with pytest.raises(ScenarioError, match=r"needs the inertia .* of at least 0\.0001"):
        check(replace(load_scenario("walls"), actuators=ActuatorKeys(backlash_deg=0.1)))
