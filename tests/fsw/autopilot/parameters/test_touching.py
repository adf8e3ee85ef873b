"""What a vehicle can promise at a surface that it may touch, and what it refuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fsw.autopilot.control.press import PressTuning
from fsw.autopilot.parameters.consistency import analyse, loop_tube, refusals
from fsw.autopilot.parameters.flight_config import FlightConfig, flight_config
from fsw.autopilot.parameters.touching import against_touching, grip
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.signals import SafeSet, Touch, Zone
from tests.fsw.autopilot.control.test_press import pressed_upon
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
