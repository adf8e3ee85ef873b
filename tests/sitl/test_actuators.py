"""Rotors, joint drives and trim."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.plant.actuators import joint_torque, thrust_rate
from sitl.plant.aerial_manipulator import place_bodies, placed_acceleration_into
from sitl.plant.integrator import held, integrate
from sitl.plant.parameters import plant
from sitl.plant.state import at_rest
from sitl.plant.trim import NoTrimError, level_hover
from tests.sitl.state_view import StateView
from tests.sitl.vehicles import PAPER, inputs, without_stops, workspace


def test_a_rotor_reaches_63_percent_of_a_step_after_its_lag() -> None:
    state = at_rest(4, 2)
    view = StateView(state)
    view.p_WB[2] = -50.0
    room = (np.empty((40, 4, 3)), np.empty((40, 21)), held())
    integrate(plant(PAPER), state, inputs((5.0, 0.0, 99.0, -3.0)), 0.001, *room)
    grown = 1.0 - math.exp(-1.0)
    # Commands beyond the rotor's range act like the limit they exceed.
    expected = [5.0 * grown, 0.0, PAPER.rotors[2].thrust_max * grown, 0.0]
    assert view.thrust == pytest.approx(expected, rel=1e-6, abs=1e-12)


@given(st.floats(0.0, 17.0), st.floats(-50.0, 50.0))
def test_thrust_never_leaves_its_range(thrust: float, command: float) -> None:
    rate = thrust_rate(thrust, command, 17.0, 0.04)
    assert rate <= (17.0 - thrust) / 0.04
    assert rate >= -thrust / 0.04


@given(st.floats(-20.0, 20.0))
def test_friction_opposes_motion_and_is_odd(rate: float) -> None:
    friction = joint_torque(0.0, rate, 2.0, 0.005, 0.01)
    assert friction * rate <= 0.0
    assert friction == -joint_torque(0.0, -rate, 2.0, 0.005, 0.01)
    assert abs(friction) <= 0.01 + 0.005 * abs(rate) + 1e-15


def test_a_joint_drive_saturates() -> None:
    assert joint_torque(7.0, 0.0, 2.0, 0.005, 0.01) == 2.0
    assert joint_torque(-7.0, 0.0, 2.0, 0.005, 0.01) == -2.0


@given(st.floats(-1.0, 1.0), st.floats(-2.0, 2.0))
def test_trim_is_an_equilibrium_at_any_arm_posture(first: float, second: float) -> None:
    vehicle, state, work = without_stops(PAPER), at_rest(4, 2), workspace()
    trim = level_hover(vehicle, (first, second))
    view = StateView(state)
    view.p_WB[2] = -5.0
    view.q_arm[:] = (first, second)
    view.thrust[:] = trim.thrust
    place_bodies(plant(vehicle), state, work)
    placed_acceleration_into(plant(vehicle), state, inputs(trim.thrust, trim.torque), work)
    assert np.abs(work.load[:8]).max() <= 1e-10


def test_what_cannot_be_held_has_no_trim() -> None:
    weak = replace(PAPER, joints=tuple(replace(one, torque_max=0.1) for one in PAPER.joints))
    with pytest.raises(NoTrimError, match=r"joint joint1 would need .*; choose a posture"):
        level_hover(weak, (1.0, 0.0))
    heavy = replace(PAPER, base=replace(PAPER.base, mass=8.0))
    with pytest.raises(NoTrimError, match="rotor 1 would need"):
        level_hover(heavy, (0.0, 0.0))
