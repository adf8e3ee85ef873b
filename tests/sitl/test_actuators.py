"""Rotors, joint drives and trim."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.plant.actuators import joint_torque, thrust_rate
from sitl.plant.aerial_manipulator import Inputs, acceleration_into, plant
from sitl.plant.integrator import held, integrate
from sitl.plant.parameters import EndStops, Vehicle
from sitl.plant.state import at_rest
from sitl.plant.trim import NoTrimError, level_hover
from tests.sitl.free_motion import record_of, workspace
from tests.sitl.state_view import StateView


def test_a_rotor_reaches_63_percent_of_a_step_after_its_lag() -> None:
    vehicle, state = Vehicle(), at_rest(2)
    view = StateView(state)
    view.p_WB[2] = -50.0
    thrust = np.array([5.0, 0.0, 99.0, -3.0])
    inputs = record_of(Inputs(thrust, np.zeros(2), np.zeros(3), np.zeros(3)))
    room = (np.empty((40, 4, 3)), np.empty((40, 21)), held(2))
    integrate(plant(vehicle), state, inputs, 0.001, *room)
    grown = 1.0 - math.exp(-1.0)
    # Commands beyond the rotor's range act like the limit they exceed.
    expected = [5.0 * grown, 0.0, vehicle.rotors.thrust_max * grown, 0.0]
    assert view.thrust == pytest.approx(expected, rel=1e-6, abs=1e-12)


@given(st.floats(0.0, 17.0), st.floats(-50.0, 50.0))
def test_thrust_never_leaves_its_range(thrust: float, command: float) -> None:
    rate = thrust_rate(thrust, command, 17.0, 0.04)
    assert rate <= (17.0 - thrust) / 0.04
    assert rate >= -thrust / 0.04


@given(st.floats(-20.0, 20.0))
def test_friction_opposes_motion_and_is_odd(rate: float) -> None:
    friction = joint_torque(0.0, rate, 2.0, 0.005, 0.01, 0.05)
    assert friction * rate <= 0.0
    assert friction == -joint_torque(0.0, -rate, 2.0, 0.005, 0.01, 0.05)
    assert abs(friction) <= 0.01 + 0.005 * abs(rate) + 1e-15


def test_a_joint_drive_saturates() -> None:
    assert joint_torque(7.0, 0.0, 2.0, 0.005, 0.01, 0.05) == 2.0
    assert joint_torque(-7.0, 0.0, 2.0, 0.005, 0.01, 0.05) == -2.0


@given(st.floats(-1.0, 1.0), st.floats(-2.0, 2.0))
def test_trim_is_an_equilibrium_at_any_arm_posture(first: float, second: float) -> None:
    vehicle, state, work = Vehicle(stops=EndStops(())), at_rest(2), workspace()
    trim = level_hover(vehicle, (first, second))
    view = StateView(state)
    view.p_WB[2] = -5.0
    view.q_arm[:] = (first, second)
    view.thrust[:] = trim.thrust
    torque = np.array(trim.torque)
    inputs = record_of(Inputs(view.thrust.copy(), torque, np.zeros(3), np.zeros(3)))
    acceleration_into(plant(vehicle), state, inputs, work)
    assert np.abs(work.load).max() <= 1e-10


def test_what_cannot_be_held_has_no_trim() -> None:
    vehicle = Vehicle()
    weak = replace(vehicle, joints=replace(vehicle.joints, torque_max=0.1))
    with pytest.raises(NoTrimError, match="joint 1 would need"):
        level_hover(weak, (1.0, 0.0))
    heavy = replace(vehicle, base_mass=8.0)
    with pytest.raises(NoTrimError, match="rotor 1 would need"):
        level_hover(heavy, (0.0, 0.0))
