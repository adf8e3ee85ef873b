"""The watch over the actuators finds a rotor of any layout by the columns of the effectiveness."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fsw.autopilot.control.actuator_watch import watch, watch_law
from fsw.autopilot.model.airframe import GRAVITY, Airframe, airframe_of
from fsw.autopilot.model.multibody import base_acceleration, move_bodies
from fsw.autopilot.model.rotors import rotor_decay, rotor_wrench
from fsw.autopilot.tick_record import NO_ROTOR, Tick
from tests.fsw.random_states import estimate_of, vec3
from tests.fsw.records import allocated, placed
from tests.vehicles.random_vehicles import rotor_ring
from vehicles.vehicle_file import load_vehicle

DT = 0.004
WATCH: Any = getattr(watch, "py_func", watch)


def ring(rotors: int) -> Airframe:
    random = np.random.default_rng(rotors)
    paper = load_vehicle("paper")
    return airframe_of(replace(paper, rotors=rotor_ring(random, rotors, GRAVITY * paper.mass)))


def watched(airframe: Airframe, share: Any, seconds: float) -> Tick:
    """A vehicle that hovers, of whose rotors each gives a share of its command from 1.2 s on."""
    n, hover = airframe.rotors, airframe.mass * GRAVITY
    r = placed(airframe, estimate_of(Rotation.identity())._replace(specific_force=GRAVITY))
    r.sent.rotor_thrust[:n] = allocated(airframe, (0.0, 0.0, 0.0), hover, 1.0)
    thrust, rate = np.array(r.sent.rotor_thrust[:n]), np.zeros(3)
    decay, law = rotor_decay(airframe, DT), watch_law(airframe)
    for k in range(round(seconds / DT)):
        given = np.array(r.sent.rotor_thrust[:n]) * (share if k * DT > 1.2 else 1.0)
        thrust = given + (thrust - given) * decay
        force, turn = rotor_wrench(airframe, thrust)
        move_bodies(r.bodies, airframe.bodies, 0.0, r.estimate)
        rate = rate + DT * np.array(
            base_acceleration(r.bodies, airframe.bodies, turn, force, r.sent.joint_torque)
        )
        r.estimate.w_WB_B[:] = vec3(rate)
        r.estimate.specific_force = -force[2] / airframe.mass
        WATCH([r], [r], [law], decay, DT, False)
        if r.watch.failed != NO_ROTOR:
            break
    return r


@pytest.mark.parametrize("rotors", [4, 5, 6, 8])
def test_a_weak_rotor_is_found_and_no_other_one(rotors: int) -> None:
    airframe = ring(rotors)
    for weak in (0, rotors - 2):
        share = np.where(np.arange(rotors) == weak, 0.4, 1.0)
        assert watched(airframe, share, 1.7).watch.failed == weak


def test_of_a_vehicle_that_is_heavier_than_believed_no_rotor_is_found() -> None:
    assert watched(ring(6), np.full(6, 0.8), 1.7).watch.failed == NO_ROTOR
