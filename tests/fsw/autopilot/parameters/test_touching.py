"""What a vehicle can promise at a surface that it may touch, and what it refuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from fsw.autopilot.barriers.safe_approach import stand_off
from fsw.autopilot.control.press import PressTuning
from fsw.autopilot.control.tube import base_reach, of_contact
from fsw.autopilot.parameters.consistency import analyse, loop_tube, refusals
from fsw.autopilot.parameters.flight_config import FlightConfig, flight_config
from fsw.autopilot.parameters.touching import (
    Pressed,
    against_pressing,
    against_touching,
    balanced_force,
    grip,
    max_force,
)
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.signals import SafeSet, Touch, Zone
from sitl.plant.trim import end_effector
from tests.fsw.autopilot.control.test_press import pressed_upon
from tests.sitl.pinocchio_model import configuration, pinocchio_model
from vehicles.vehicle_file import load_vehicle

AHEAD = (-1.0, 0.0, 0.0)
TOUCH = Touch(10.0, 1e3, 1e4)


def config_of(vehicle: str) -> FlightConfig:
    return flight_config(body="full", vehicle=load_vehicle(vehicle))


PROBE = config_of("probe-2r")


def touched(**changes: float) -> Zone:
    return replace(wall(AHEAD, -2.0, 0.05), touch=TOUCH._replace(**changes))


def test_the_grip_before_flight_is_that_of_the_fast_loop() -> None:
    vehicle = load_vehicle("probe-2r")
    r, _ = pressed_upon(vehicle, np.array(vehicle.home_posture), np.zeros(3), AHEAD)
    found = grip(PROBE.airframe, PressTuning(), AHEAD, 0.8)
    assert found.unsure == pytest.approx(r.pressing.unsure, rel=0.02)
    assert found.mass == pytest.approx(r.pressing.mass, rel=0.02)


@pytest.mark.requirement("REQ-SAFE-13")
@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({}, ""),
        ({"force_max": 1.5}, "its force bound of 1.5 N is too small: friction and pushes leave"),
        ({"stiffness_high": 1e9}, "a stiffness of 1000000000 N/m is too much for a tool of"),
    ],
)
def test_a_surface_that_cannot_be_kept_is_refused(changes: dict[str, float], why: str) -> None:
    zone, loop = touched(**changes), loop_tube(PROBE)
    against = against_touching(PROBE, zone, loop)
    assert against.startswith(why)
    assert bool(against) == bool(why)
    said = [one for one in refusals(analyse(PROBE, SafeSet((zone,)), loop)) if "touched" in one]
    assert said == ([f"zone 1 cannot be touched: {against}"] if why else [])


def test_what_is_said_to_be_enough_is_enough() -> None:
    loop = loop_tube(PROBE)
    against = against_touching(PROBE, touched(force_max=1.5), loop)
    enough = float(against.split("; ")[1].split(" N")[0])
    assert not against_touching(PROBE, touched(force_max=enough), loop)
    assert against_touching(PROBE, touched(force_max=enough - 0.2), loop)


def test_disturbances_take_from_what_the_tilt_can_press_with() -> None:
    loop, zone = loop_tube(PROBE), touched(force_max=100.0)
    assert not against_touching(PROBE, zone, loop)
    wild = replace(PROBE, surroundings=replace(PROBE.surroundings, disturbance=2.5))
    assert against_touching(wild, zone, loop)


def test_an_arm_in_a_plane_presses_on_nothing_beside_it() -> None:
    assert grip(PROBE.airframe, PressTuning(), (0.0, 1.0, 0.0), 0.8).mass == float("inf")


def test_sliding_sideways_is_bounded_by_what_rotors_spend_on_yaw() -> None:
    """By statics on Pinocchio's model: the friction's lever about the centre of mass."""
    vehicle = load_vehicle("probe-2r")
    model = pinocchio_model(vehicle)
    data, home = model.createData(), np.array(vehicle.home_posture)
    q = configuration(np.zeros(3), np.array((1.0, 0.0, 0.0, 0.0)), home)
    centre = pin.centerOfMass(model, data, q)
    lever = end_effector(vehicle, vehicle.home_posture)[0] - centre[0]
    friction, loop = 0.3, loop_tube(PROBE)
    yaw = 0.8 * 3.0 * sum(rotor.torque_per_thrust for rotor in vehicle.rotors)  # of 3 N each
    zone = touched(friction=friction)
    aside = Pressed(AHEAD, 3.0, (0.0, 0.5, 0.0))
    most = balanced_force(PROBE, zone, loop, aside)
    assert most == pytest.approx(yaw / (friction * lever), rel=1e-3)
    assert against_pressing(PROBE, zone, loop, aside).startswith("pressing with 3.0 N and sliding")
    up = aside._replace(slide=(0.0, 0.0, -0.5))
    assert against_pressing(PROBE, zone, loop, up) == ""
    # What counts is how the surface lies to the slide, wherever both are turned to.
    turned = Pressed((0.0, -1.0, 0.0), 3.0, (0.5, 0.0, 0.0))
    assert balanced_force(PROBE, zone, loop, turned) == pytest.approx(most)
    hard = against_pressing(PROBE, zone, loop, up._replace(force=9.5))
    assert hard.startswith("9.5 N are asked for; at most 5.2 N")


def test_weak_rotors_leave_less_to_press_with() -> None:
    airframe, loop, zone = PROBE.airframe, loop_tube(PROBE), touched(force_max=100.0)
    up = Pressed(AHEAD, 3.0, (0.0, 0.0, -0.5))
    hover = airframe.mass * 9.81 / airframe.rotors
    weak = tuple(1.05 * hover for _ in airframe.rotor_thrust_max)
    before = balanced_force(PROBE, zone, loop, up)
    config = replace(PROBE, airframe=replace(airframe, rotor_thrust_max=weak))
    assert balanced_force(config, zone, loop, up) < 0.1 * before


@pytest.mark.requirement("REQ-SAFE-13")
def test_no_force_is_promised_whose_loss_pushes_the_base_out_of_what_the_plan_keeps() -> None:
    loop, zone = loop_tube(PROBE), touched(force_max=100.0)
    unsure = grip(PROBE.airframe, PressTuning(), AHEAD, 0.8).unsure
    most, walls = max_force(PROBE, zone, loop), PROBE.planner.walls
    assert 5.0 < most < 6.0  # probe asks for 5 N
    reach = base_reach(loop, 0.8) + of_contact(loop, most, unsure, PROBE.airframe.mass)
    assert reach == pytest.approx(stand_off(walls))
    less = replace(walls, lambda_=0.9 * walls.lambda_)
    nearer = replace(PROBE, planner=replace(PROBE.planner, walls=less))
    assert max_force(nearer, zone, loop) < most - 1.0
    nearest = replace(walls, lambda_=0.6 * walls.lambda_)
    nearest_of_all = replace(PROBE, planner=replace(PROBE.planner, walls=nearest))
    against = against_touching(nearest_of_all, zone, loop)
    assert against.startswith("the base can be pushed 59 mm off its plan where 0.5 N are lost"), (
        against
    )
