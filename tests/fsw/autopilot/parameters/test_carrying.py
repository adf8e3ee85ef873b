"""What a gripper may hold, against the loads of the multibody model."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fsw.autopilot.model.airframe import GRAVITY
from fsw.autopilot.model.multibody import Multibody, bodies_of, joint_load, move_bodies, posture
from fsw.autopilot.parameters.carrying import _across, payload_range
from fsw.autopilot.parameters.consistency import loop_tube
from fsw.autopilot.parameters.flight_config import FlightConfig, of_vehicle
from fsw.autopilot.signals import StateEstimate
from fsw.frozen import replace
from tests.vehicles.random_vehicles import random_vehicle
from vehicles.vehicle_file import load_vehicle

PROBE = of_vehicle(FlightConfig(), load_vehicle("probe-2r"))


def test_the_joint_that_bounds_it_carries_it_stretched_out_with_four_fifths_of_its_torque() -> None:
    loop, airframe, none = loop_tube(PROBE), PROBE.airframe, (0.0, 0.0, 0.0)
    most, by = payload_range(PROBE, loop)
    assert by == "joint 1's torque"
    level = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    stretched = StateEstimate(
        0, none, none, level, none, 0.0, (0.5 * math.pi, 0.0), (0.0, 0.0), 9.8
    )
    m = Multibody()
    m.carried = most
    move_bodies(m, airframe.bodies, 0.0, stretched)
    field = GRAVITY + loop.acceleration * PROBE.surroundings.disturbance
    load = abs(joint_load(m, 0, (0.0, 0.0, field), none))
    assert load == pytest.approx(0.8 * airframe.joint_torque_max[0])


def test_weak_rotors_carry_less_and_a_light_vehicle_bears_no_heavy_loss() -> None:
    loop, airframe = loop_tube(PROBE), PROBE.airframe
    weak = replace(airframe, rotor_thrust_max=tuple(0.6 * t for t in airframe.rotor_thrust_max))
    assert payload_range(replace(PROBE, airframe=weak), loop) == (0.0, "the rotors' thrust")
    strong = replace(airframe, joint_torque_max=(50.0,) * len(airframe.joint_torque_max))
    most, by = payload_range(replace(PROBE, airframe=strong), loop)
    assert by == "the rotors' torque at the arm's full reach"
    farther = replace(strong, rotor_lever=0.5)
    most, by = payload_range(replace(PROBE, airframe=farther), loop)
    assert (most, by) == (pytest.approx(0.2 * airframe.mass), "its loss in flight")


def test_a_payload_on_a_joint_s_own_place_does_not_load_it() -> None:
    bodies = replace(PROBE.airframe.bodies, tip=(0.0, 0.0, 0.0))
    on_joint = replace(PROBE, airframe=replace(PROBE.airframe, bodies=bodies))
    most, by = payload_range(on_joint, loop_tube(PROBE))
    assert most > payload_range(PROBE, loop_tube(PROBE)).most
    assert "joint 2" not in by


def test_gravity_loads_a_joint_by_what_of_its_axis_is_across_it_in_some_posture() -> None:
    random = np.random.default_rng(0)
    for _ in range(5):
        b = bodies_of(random_vehicle(random, 4, 4))
        seen = np.zeros(b.joints)
        for q in random.uniform(-math.pi, math.pi, (200, b.joints)):
            axes = np.reshape(posture(b, tuple(q)).axis, (-1, 3))[: b.joints]
            seen = np.maximum(seen, np.hypot(axes[:, 0], axes[:, 1]))
        most = np.array(_across(b))
        assert (seen <= most + 1e-9).all()
        assert (seen >= most - 0.05).all()


@pytest.mark.parametrize("pushed", [0.0, 0.8])
def test_a_joint_about_the_vertical_does_not_bound_a_payload(pushed: float) -> None:
    config = of_vehicle(FlightConfig(), load_vehicle("hexa-3r"))
    config = replace(config, surroundings=replace(config.surroundings, disturbance=pushed))
    assert _across(config.airframe.bodies) == pytest.approx((0.0, 1.0, 1.0), abs=1e-12)
    assert payload_range(config, loop_tube(config)).by == "joint 2's torque"
