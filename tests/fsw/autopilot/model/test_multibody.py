"""The recursion against Pinocchio, through the URDF of vehicles that are made up."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from fsw.autopilot.model.multibody import (
    Bodies,
    Multibody,
    base_acceleration,
    bodies_of,
    joint_drift,
    joint_load,
    load_on_base,
    mass_of,
    move_bodies,
    place_of_tip,
    torque_to_turn,
    velocity_of_tip,
)
from fsw.autopilot.signals import StateEstimate
from fsw.record import JOINTS
from tests.fsw.random_states import vec3
from tests.sitl.pinocchio_model import configuration_of, exported_model
from tests.vehicles.random_vehicles import random_vehicle
from vehicles.description import Vehicle
from vehicles.vehicle_file import load_vehicle, vehicle_names

CLOSE = {"rtol": 1e-9, "atol": 1e-11}
FIELD = np.array([0.7, -1.3, 9.4])


class Referee:
    """Pinocchio's model of the exported URDF, free of weight, in a pose and motion."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.model = exported_model(vehicle, gravity=0.0)
        self.data = self.model.createData()

    def place(self, q: Any, qd: Any, w: Any) -> None:
        level = np.array([1.0, 0.0, 0.0, 0.0])
        self.q = configuration_of(self.model, np.zeros(3), level, q)
        self.v = np.concatenate((np.zeros(3), w, qd))
        self.mass = pin.crba(self.model, self.data, self.q)
        self.mass = np.triu(self.mass) + np.triu(self.mass, 1).T
        self.bias = pin.rnea(self.model, self.data, self.q, self.v, np.zeros(self.model.nv))


def estimate(q: Any, qd: Any, w: Any) -> StateEstimate:
    none = (0.0, 0.0, 0.0)
    level = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    return StateEstimate(0, none, none, level, vec3(w), 0.0, tuple(q), tuple(qd), 9.81)


def vehicles() -> list[Vehicle]:
    random = np.random.default_rng(42)
    return [load_vehicle(name) for name in vehicle_names()] + [
        random_vehicle(random, joints) for joints in range(1, JOINTS + 1) for _ in range(5)
    ]


@pytest.mark.parametrize(
    ("ours", "others"), [(40, 8), pytest.param(250, 35, marks=pytest.mark.long)]
)
def test_it_equals_pinocchio_for_any_vehicle_in_any_motion(ours: int, others: int) -> None:
    """440 states, 200 of them of those that come with Pandion, and 2,300; as Python."""
    random = np.random.default_rng(7)
    for vehicle in vehicles():
        referee, b = Referee(vehicle), bodies_of(vehicle)
        m = Multibody()
        for _ in range(ours if vehicle.name in vehicle_names() else others):
            check_motion(referee, m, b, random)
            check_tip(referee, m, b)


@pytest.mark.parametrize("states", [6, pytest.param(20, marks=pytest.mark.long)])
def test_it_equals_pinocchio_with_a_payload_at_the_end_effector(states: int) -> None:
    random, load = np.random.default_rng(8), 0.4
    for vehicle in vehicles():
        referee, b = Referee(vehicle), bodies_of(vehicle)
        at_tip = referee.model.frames[referee.model.getFrameId("end_effector")]
        point = pin.Inertia(load, np.zeros(3), np.zeros((3, 3)))
        referee.model.appendBodyToJoint(at_tip.parentJoint, point, at_tip.placement)
        m = Multibody()
        m.carried = load
        for _ in range(states):
            check_motion(referee, m, b, random)


def test_what_is_carried_is_seen_in_a_pose_that_stays() -> None:
    m, b = Multibody(), bodies_of(load_vehicle("paper"))
    still = estimate((0.3, 0.4), (0.0, 0.0), (0.0, 0.0, 0.0))
    move_bodies(m, b, 0.0, still)
    light = m.qq[0]
    m.carried = 0.3
    move_bodies(m, b, 0.0, still)
    assert m.qq[0] > light


def check_motion(referee: Referee, m: Multibody, b: Bodies, random: np.random.Generator) -> None:
    """All but the tip, in one motion that is drawn."""
    n = b.joints
    q, qd, w = random.uniform(-3, 3, n), random.uniform(-5, 5, n), random.uniform(-4, 4, 3)
    referee.place(q, qd, w)
    move_bodies(m, b, 0.0, estimate(q, qd, w))
    check_terms(referee, m, n)
    check_laws(referee, m, b, random)
    check_momentum(referee, m, qd, w)


def check_terms(referee: Referee, m: Multibody, n: int) -> None:
    mass = referee.mass
    whole = mass[0, 0]
    np.testing.assert_allclose(pin.skew(np.array(m.centre)), mass[3:6, :3] / whole, **CLOSE)
    np.testing.assert_allclose(m.vq.reshape(-1, 3)[:n].T, mass[:3, 6:], **CLOSE)
    np.testing.assert_allclose(m.wq.reshape(-1, 3)[:n].T, mass[3:6, 6:], **CLOSE)
    np.testing.assert_allclose(m.qq.reshape(JOINTS, JOINTS)[:n, :n], mass[6:, 6:], **CLOSE)
    np.testing.assert_allclose(m.bias_v, referee.bias[:3], **CLOSE)
    np.testing.assert_allclose(m.bias_w, referee.bias[3:6], **CLOSE)
    np.testing.assert_allclose(m.bias[:n], referee.bias[6:], **CLOSE)


def check_laws(referee: Referee, m: Multibody, b: Bodies, random: np.random.Generator) -> None:
    """What turns the base, and what the joints need, are the rows of one equation."""
    force, turn = random.uniform(-30, 30, 3), random.uniform(-3, 3, 3)
    torque = random.uniform(-2, 2, int(b.joints))
    free = np.linalg.solve(referee.mass, np.concatenate((force, turn, torque)) - referee.bias)
    got = base_acceleration(m, b, vec3(turn), vec3(force), tuple(torque))
    np.testing.assert_allclose(got, free[3:6], rtol=1e-9, atol=1e-9)
    load = load_on_base(m, b, vec3(force), tuple(torque))
    np.testing.assert_allclose(torque_to_turn(m, b, vec3(free[3:6]), load), turn, atol=1e-9)
    needed = referee.mass @ free + referee.bias
    for k in range(int(b.joints)):
        got = joint_load(m, k, vec3(-free[:3]), vec3(free[3:6]))
        got += m.qq.reshape(JOINTS, JOINTS)[k, : int(b.joints)] @ free[6:]
        np.testing.assert_allclose(got, needed[6 + k], rtol=1e-9, atol=1e-9)
    assert mass_of(m, b) == pytest.approx(referee.mass[0, 0])


def check_momentum(referee: Referee, m: Multibody, qd: Any, w: Any) -> None:
    n = len(qd)
    np.testing.assert_allclose(m.momentum[:n], (referee.mass @ referee.v)[6:], **CLOSE)
    # The drift is M_dot qd + what the rates take up; the first is C^T + C.
    data, model = referee.data, referee.model
    pin.computeCoriolisMatrix(model, data, referee.q, referee.v)
    change = (data.C.T @ referee.v)[6:] + referee.mass[6:, :3] @ FIELD
    got = [joint_drift(m, k, vec3(FIELD)) for k in range(n)]
    np.testing.assert_allclose(got, change, **CLOSE)


def check_tip(referee: Referee, m: Multibody, b: Bodies) -> None:
    model, data = referee.model, referee.data
    frame = model.getFrameId("end_effector")
    pin.forwardKinematics(model, data, referee.q, referee.v)
    place = pin.updateFramePlacement(model, data, frame)
    np.testing.assert_allclose(place_of_tip(m, b), place.translation, **CLOSE)
    v = pin.getFrameVelocity(model, data, frame, pin.LOCAL_WORLD_ALIGNED).linear
    np.testing.assert_allclose(velocity_of_tip(m, b), v, **CLOSE)


def test_the_swing_is_how_the_centre_moves_when_the_base_is_turned_and_drives_are_free() -> None:
    random = np.random.default_rng(3)
    for vehicle in vehicles():
        n = len(vehicle.joints)
        referee, m = Referee(vehicle), Multibody()
        q = random.uniform(-3, 3, n)
        referee.place(q, np.zeros(n), np.zeros(3))
        move_bodies(m, bodies_of(vehicle), 0.0, estimate(q, np.zeros(n), np.zeros(3)))
        turn = random.uniform(-1, 1, 3)
        free = np.linalg.solve(referee.mass, np.concatenate((np.zeros(3), turn, np.zeros(n))))
        # No force acts, so the centre stays: the origin moves against the swing.
        np.testing.assert_allclose(m.swing.reshape(3, 3) @ free[3:6], -free[:3], **CLOSE)


def test_of_paper_it_says_what_four_special_laws_said() -> None:
    """A pendulum across the arm's plane; in it the base is alone, and joint 1 pushes it off."""
    paper = load_vehicle("paper")
    b, m = bodies_of(paper), Multibody()
    for q in ((0.0, 0.0), (0.5, 0.3), (-0.7, 1.4)):
        move_bodies(m, b, 0.0, estimate(q, (0.0, 0.0), (0.0, 0.0, 0.0)))
        z = 0.075 * np.cos(q[0]), 0.15 * np.cos(q[0]) + 0.075 * np.cos(sum(q))
        depth = 0.2 * sum(z) / 3.5
        roll = 0.3 + 0.2 * (z[0] ** 2 + z[1] ** 2) - 3.5 * depth**2
        assert m.inertia[0] == pytest.approx(roll, abs=2e-4), "which knew no inertia of links"
        assert m.inertia[4] == pytest.approx(0.3, abs=1e-12)
        np.testing.assert_allclose(m.reaction[1:6:3], [1.0, 0.0], atol=1e-12)
        np.testing.assert_allclose(m.swing[[1, 4, 7]], 0.0, atol=1e-12)
        assert m.swing[3] == pytest.approx(-depth)
