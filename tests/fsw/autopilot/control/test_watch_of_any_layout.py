"""The watch over the actuators of any vehicle: rotors by their columns, joints by their drives."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fsw.autopilot.control.actuator_watch import pattern_of, watch, watch_law
from fsw.autopilot.model.actuator_health import SOUND, STUCK
from fsw.autopilot.model.airframe import GRAVITY, Airframe, airframe_of
from fsw.autopilot.model.multibody import base_acceleration, move_bodies
from fsw.autopilot.model.rotors import rotor_decay, rotor_wrench
from fsw.autopilot.tick_record import NO_ROTOR, Tick
from fsw.record import JOINTS
from tests.fsw.random_states import estimate_of, vec3
from tests.fsw.records import allocated, placed
from tests.vehicles.random_vehicles import rotor_ring
from vehicles.description import Vehicle
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


@pytest.mark.drawn(2)
@pytest.mark.parametrize("rotors", [4, 5, 6, 8])
def test_a_weak_rotor_is_found_and_no_other_one(rotors: int) -> None:
    airframe = ring(rotors)
    for weak in (0, rotors - 2):
        share = np.where(np.arange(rotors) == weak, 0.4, 1.0)
        assert watched(airframe, share, 1.7).watch.failed == weak


def test_of_a_vehicle_that_is_heavier_than_believed_no_rotor_is_found() -> None:
    assert watched(ring(6), np.full(6, 0.8), 1.7).watch.failed == NO_ROTOR


@pytest.mark.drawn(1)
@pytest.mark.parametrize("rotors", [4, 6, 8])
def test_rotors_that_are_all_slow_are_no_failed_one_whatever_lifts_meanwhile(rotors: int) -> None:
    """hexa-3r landed for a sound rotor: pushes along z came when it turned."""
    airframe = ring(rotors)
    n, hover = airframe.rotors, airframe.mass * GRAVITY / airframe.rotors
    r = placed(airframe, estimate_of(Rotation.identity())._replace(specific_force=GRAVITY))
    pattern = np.array([pattern_of(airframe, k) for k in range(n)])
    about = pattern[:, :2] @ pattern[0, :2]
    decay, law, rate = rotor_decay(airframe, DT), watch_law(airframe), np.zeros(3)
    believed = slow = np.full(n, hover)
    for k in range(round(3.0 / DT)):
        r.sent.rotor_thrust[:n] = asked = hover + 0.9 * hover * about * np.sin(15.0 * k * DT)
        believed = asked + (believed - asked) * decay
        slow = asked + (slow - asked) * np.sqrt(decay)
        force, turn = rotor_wrench(airframe, slow)
        move_bodies(r.bodies, airframe.bodies, 0.0, r.estimate)
        push = float(about @ (slow - believed)) / about[0]
        rate = rate + DT * np.array(
            base_acceleration(r.bodies, airframe.bodies, turn, force, r.sent.joint_torque)
        )
        r.estimate.w_WB_B[:] = vec3(rate)
        r.estimate.specific_force = (push - force[2]) / airframe.mass
        WATCH([r], [r], [law], decay, DT, False)
    assert r.watch.slow2 > (1.5 * law.thrusts) ** 2, "enough to name a rotor"
    assert r.watch.failed == NO_ROTOR


def held_still(vehicle: Vehicle, seconds: float) -> Tick:
    """A vehicle whose first joint is asked for torque, and does not move."""
    airframe = airframe_of(vehicle)
    hover = airframe.mass * GRAVITY / airframe.rotors
    r = placed(airframe, estimate_of(Rotation.identity())._replace(specific_force=GRAVITY))
    r.sent.rotor_thrust[: airframe.rotors] = hover
    r.sent.joint_torque[0], r.joints.reference[0] = 0.25, 0.1
    law = watch_law(airframe)
    for _ in range(round(seconds / DT)):
        WATCH([r], [r], [law], rotor_decay(airframe, DT), DT, True)
    return r


def test_what_a_drives_own_friction_holds_is_no_joint_that_failed() -> None:
    paper = load_vehicle("paper")
    assert watch_law(airframe_of(paper)).torques == (1.0,) * JOINTS
    assert held_still(paper, 2.0).watch.joint[0] == STUCK
    # As in public files of small drives.
    rough = tuple(replace(one, coulomb=0.1, viscous=0.1) for one in paper.joints)
    assert held_still(replace(paper, joints=rough), 2.0).watch.joint[0] == SOUND
