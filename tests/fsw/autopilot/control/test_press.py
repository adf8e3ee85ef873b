"""What the tool is pressed upon by, against Pinocchio's arm; and that it presses no harder."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from fsw.autopilot.control.gains import LoopGains
from fsw.autopilot.control.joints import accelerate_joints, joint_torques, observe_contact
from fsw.autopilot.control.press import PressTuning, look_for_surface, press, weigh_tool
from fsw.autopilot.model.airframe import Airframe, airframe_of
from fsw.autopilot.model.arm_coordinates import arm_coordinates
from fsw.autopilot.model.multibody import move_bodies
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.zones import moving_zones
from fsw.autopilot.signals import SafeSet, StateEstimate, Touch, Vec3
from fsw.autopilot.tick_record import Tick, new_tick
from fsw.record import JOINTS
from tests.fsw.autopilot.model.test_multibody import Referee, estimate
from tests.fsw.random_states import vec3
from tests.vehicles.random_vehicles import random_vehicle
from vehicles.description import Vehicle
from vehicles.vehicle_file import load_vehicle

TUNING = PressTuning()
DT = 0.002
G = np.array([0.0, 0.0, 9.81])
TOUCH = Touch(10.0, 1e3, 1e4)
AHEAD: Vec3 = (-1.0, 0.0, 0.0)


class Arm:
    """Pinocchio's arm under a base that is swung about, held by springs in its joints."""

    def __init__(self, vehicle: Vehicle, q: np.ndarray) -> None:
        self.vehicle, self.referee, self.n = vehicle, Referee(vehicle), len(q)
        self.hold, self.q, self.qd = q.copy(), q.copy(), np.zeros(self.n)
        self.torque = np.zeros(self.n)

    def jacobian(self) -> np.ndarray:
        """Of the end-effector, (3, j), by differences."""
        tips = []
        for k in range(self.n):
            for sign in (1.0, -1.0):
                q = self.q.copy()
                q[k] += sign * 1e-6
                tips.append(self.tip(q))
        rows = [(tips[2 * k] - tips[2 * k + 1]) / 2e-6 for k in range(self.n)]
        return np.array(rows).T

    def tip(self, q: np.ndarray) -> np.ndarray:
        self.referee.place(q, np.zeros(self.n), np.zeros(3))
        pin.forwardKinematics(self.referee.model, self.referee.data, self.referee.q)
        last = self.referee.data.oMi[-1]
        return np.array(last.translation + last.rotation @ self.vehicle.end_effector.position)

    def move(self, swing: np.ndarray, force: np.ndarray, stiff: np.ndarray, parts: int = 4) -> None:
        """A tick; the base accelerates by ``swing``, ``force`` is on the tool."""
        by_force = self.jacobian().T @ force
        for _ in range(parts):
            self.referee.place(self.q, self.qd, np.zeros(3))
            mass, bias = self.referee.mass, self.referee.bias
            free = self.torque + by_force - bias[6:] - mass[6:, :3] @ (swing - G)
            qdd = np.linalg.solve(mass[6:, 6:], free)
            self.qd = self.qd + DT / parts * qdd
            self.q = self.q + DT / parts * self.qd
        self.torque = stiff @ (1e4 * (self.hold - self.q) - 150.0 * self.qd)


def stiffnesses(arm: Arm) -> np.ndarray:
    arm.referee.place(arm.q, arm.qd, np.zeros(3))
    return arm.referee.mass[6:, 6:].copy()


def at_surface(airframe: Airframe, seen: StateEstimate, normal: Vec3) -> Tick:
    """A record whose tool is just in front of a surface with a ``normal``."""
    r = new_tick(airframe.mass, airframe.rotors, airframe.bodies.joints)
    r.state_estimate = seen
    move_bodies(r.bodies, airframe.bodies, 0.0, seen)
    zones = moving_zones(SafeSet((replace(wall(normal, -9.0, 0.0), touch=TOUCH),)), None)
    r.pressing.near = 0
    look_for_surface(r, airframe.bodies, replace(TUNING, near=20.0), 0.0, zones, 0.002)
    assert r.pressing.near == 1
    return r


def pressed_upon(
    vehicle: Vehicle, q: np.ndarray, force: np.ndarray, normal: Vec3, seed: int = 1
) -> tuple[Tick, Airframe]:
    """The record after 0.4 s under a ``force`` on the tool, the base being swung about."""
    airframe = airframe_of(vehicle)
    airframe = replace(airframe, joint_torque_max=(1e3,) * JOINTS)
    arm, random = Arm(vehicle, q), np.random.default_rng(seed)
    stiff, phase = stiffnesses(arm), random.uniform(0.0, 6.0, 3)
    r = at_surface(airframe, estimate(arm.q, arm.qd, np.zeros(3)), normal)
    for step in range(200):
        swing = np.cos(phase + np.array([9.0, 7.0, 5.0]) * step * DT)
        sent = np.zeros(JOINTS)
        sent[: arm.n] = arm.torque
        arm.move(swing, force, stiff)
        r.state_estimate = estimate(arm.q, arm.qd, np.zeros(3))
        move_bodies(r.bodies, airframe.bodies, 0.0, r.state_estimate)
        observe_contact(r, airframe, sent, vec3(G - swing), DT)
        weigh_tool(r, airframe, TUNING)
    return r, airframe


def cases() -> list[tuple[Vehicle, np.ndarray, np.ndarray]]:
    random = np.random.default_rng(5)
    found = []
    for joints in (2, 3, 4, 5, 6):
        for _ in range(3):
            vehicle = random_vehicle(random, joints)
            q = random.uniform(-1.0, 1.0, joints)
            u, s, _ = np.linalg.svd(Arm(vehicle, q).jacobian())
            within = [u[:, k] for k in range(min(3, joints)) if s[k] > 0.08]
            way = sum(random.normal() * one for one in within)
            if within:
                found.append((vehicle, q, 5.0 * way / np.linalg.norm(way)))
    return found


@pytest.mark.long
@pytest.mark.requirement("REQ-SAFE-13")
def test_the_force_on_the_tool_is_observed_of_any_vehicle_in_any_direction() -> None:
    """That of the joints' reach, along the surface's normal and as a vector."""
    assert len(cases()) >= 10
    for vehicle, q, force in cases():
        normal = force / np.linalg.norm(force)
        r, _ = pressed_upon(vehicle, q, force, vec3(normal))
        assert r.pressing.pressed == pytest.approx(5.0, abs=max(0.25, r.pressing.unsure))
        np.testing.assert_allclose(r.pressing.force, force, atol=0.7)


def test_no_force_is_observed_where_there_is_none() -> None:
    vehicle, q, force = cases()[0]
    r, _ = pressed_upon(vehicle, q, 0.0 * force, vec3(force / np.linalg.norm(force)))
    assert abs(r.pressing.pressed) < 0.25


def test_a_normal_that_the_arm_does_not_move_along_is_not_pressed_on() -> None:
    vehicle = load_vehicle("probe-2r")  # its arm is in the body's x-z plane
    q = np.array(vehicle.home_posture)
    r, airframe = pressed_upon(vehicle, q, np.zeros(3), (0.0, -1.0, 0.0))
    assert r.pressing.stroke == 0.0
    r.u.force, r.pressing.contact, r.pressing.pressed = 5.0, 1, 5.0
    press(r, airframe, TUNING, vec3(G), (0.0, 0.0, 0.0), DT)
    assert r.pressing.commanded == 0.0


@pytest.mark.requirement("REQ-SAFE-13")
@pytest.mark.parametrize("asked", [2.0, 9.5, 50.0])
def test_no_more_is_commanded_than_the_bound_less_what_is_unknown(asked: float) -> None:
    vehicle = load_vehicle("probe-2r")
    q, normal = np.array(vehicle.home_posture), (-1.0, 0.0, 0.0)
    r, airframe = pressed_upon(vehicle, q, np.array([-1.0, 0.0, 0.0]), normal)
    r.u.force, r.pressing.distance = asked, 0.0
    most = 0.0
    for _ in range(2000):
        press(r, airframe, TUNING, vec3(G), (0.0, 0.0, 0.0), DT)
        most = max(most, r.pressing.commanded)
    assert r.pressing.contact
    assert 0.0 < r.pressing.unsure < 1.0
    assert most <= TOUCH.force_max - r.pressing.unsure
    wanted = min(asked, TOUCH.force_max - r.pressing.unsure - TUNING.damping)
    assert r.pressing.commanded == pytest.approx(wanted, abs=TUNING.damping)


@pytest.mark.requirement("REQ-SAFE-13")
def test_a_surface_is_looked_for_no_faster_than_the_hardest_can_stop_the_tool() -> None:
    vehicle = load_vehicle("probe-2r")
    r, airframe = pressed_upon(
        vehicle, np.array(vehicle.home_posture), np.zeros(3), (-1.0, 0.0, 0.0)
    )
    k = r.pressing
    k.stiffness, k.distance, r.u.force = 1e5, 0.02, 5.0
    k.speed = TUNING.share * (k.most - k.unsure) / math.sqrt(k.stiffness * k.mass)
    assert k.speed < TUNING.speed
    level = (r, airframe, TUNING, vec3(G), (0.0, 0.0, 0.0), DT)
    assert press(*level) == pytest.approx(0.0, abs=1e-9)
    k.speed *= 1.5
    assert k.mass * press(*level) < -0.1  # N
    assert k.commanded == 0.0


@pytest.mark.requirement("REQ-SAFE-13")
def test_a_vehicle_turned_aside_presses_and_an_arm_that_is_straight_does_not() -> None:
    vehicle = load_vehicle("probe-2r")
    home, none, aside = np.array(vehicle.home_posture), np.zeros(3), math.radians(15.0)
    r, airframe = pressed_upon(vehicle, home, none, (-math.cos(aside), -math.sin(aside), 0.0))
    assert r.pressing.stroke == 1.0
    tool = Arm(vehicle, np.array([1.5, 0.1]))
    r = at_surface(airframe, estimate(tool.q, none[:2], none), (-1.0, 0.0, 0.0))
    weigh_tool(r, airframe, TUNING)
    assert r.pressing.stroke == 0.0


@pytest.mark.requirement("REQ-SAFE-13")
def test_of_a_vehicle_turned_aside_the_whole_normal_force_is_known() -> None:
    """The joints feel what is in the arm's plane; the rest turns the vehicle farther aside."""
    vehicle, aside = load_vehicle("probe-2r"), math.radians(20.0)
    normal = np.array([-math.cos(aside), -math.sin(aside), 0.0])
    home = np.array(vehicle.home_posture)
    r, airframe = pressed_upon(vehicle, home, 5.0 * normal, vec3(normal))
    assert r.pressing.pressed == pytest.approx(5.0, abs=0.1)
    assert r.pressing.force[1] == pytest.approx(0.0, abs=1e-6)
    r.pressing.contact = 1
    weigh_tool(r, airframe, TUNING)
    np.testing.assert_allclose(r.pressing.force, 5.0 * normal, atol=0.2)


@pytest.mark.requirement("REQ-SAFE-13")
def test_what_presses_on_nothing_drives_no_joint_beyond_its_rate() -> None:
    """The surface is gone, and the observer has not seen it yet."""
    vehicle = load_vehicle("probe-2r")
    airframe, rates = airframe_of(vehicle), np.array([vehicle.joints[0].rate_max - 0.01, 0.0])
    state = estimate(np.array(vehicle.home_posture), rates, np.zeros(3))
    r = at_surface(airframe, state, AHEAD)
    weigh_tool(r, airframe, TUNING)
    k = r.pressing
    r.joints.reference[:2] = r.estimate.q_arm[:2]
    k.contact, k.distance, k.pressed, k.ramped, r.u.force = 1, 0.0, 8.0, 8.0, 8.0
    level = vec3(G), (0.0, 0.0, 0.0)
    gains = LoopGains().joint
    joint_torques(r, airframe, arm_coordinates(airframe), gains, TUNING, *level, DT)
    r.sent.joint_torque[:] = r.wanted.joint_torque
    accelerate_joints(r, airframe.bodies, *level)
    assert r.bodies.work[0] < 1.0  # rad/s^2; 49 without


@pytest.mark.requirement("REQ-SAFE-13")
@pytest.mark.parametrize("contact", [0, 1])
def test_an_arm_that_is_nearly_straight_is_bent(contact: int) -> None:
    """As if its reference were the home posture: what its vanishing levers made swung it."""
    airframe = airframe_of(load_vehicle("probe-2r"))
    r = at_surface(airframe, estimate(np.array([1.5, 0.1]), np.zeros(2), np.zeros(3)), AHEAD)
    weigh_tool(r, airframe, TUNING)
    k, torques = r.pressing, []
    k.contact, k.distance, k.pressed, r.u.force = contact, 0.0, 4.0, 5.0
    for near, reference in ((1, (1.4, 0.4)), (0, airframe.home)):
        k.near = near
        r.joints.reference[:2] = reference
        joint_torques(
            *(r, airframe, arm_coordinates(airframe), LoopGains().joint, TUNING, vec3(G)),
            *((0.0, 0.0, 0.0), DT),
        )
        torques.append(r.wanted.joint_torque[:2].copy())
    np.testing.assert_allclose(torques[0], torques[1], atol=1e-9)


@pytest.mark.requirement("REQ-SAFE-13")
@pytest.mark.parametrize("degrees", [0.0, 4.0, 15.0])
def test_no_harder_is_pressed_than_rotors_keep_a_vehicle_from_turning_aside(degrees: float) -> None:
    """By statics: half of what rotors carry, as torque about yaw, balances the force."""
    vehicle, aside = load_vehicle("probe-2r"), math.radians(degrees)
    normal = np.array([-math.cos(aside), -math.sin(aside), 0.0])
    home = np.array(vehicle.home_posture)
    r, airframe = pressed_upon(vehicle, home, normal, vec3(normal))
    r.u.force, r.pressing.distance = 8.0, 0.0
    for _ in range(2000):
        press(r, airframe, TUNING, vec3(G), (0.0, 0.0, 0.0), DT)
    ahead = Arm(vehicle, home).tip(home)[0]  # of the origin; the centre of mass is 4 mm behind it
    carried = airframe.mass * 9.81 / len(vehicle.rotors)
    torque = 0.5 * carried * sum(rotor.torque_per_thrust for rotor in vehicle.rotors)
    most = min(8.0, torque / max((ahead + 0.004) * math.sin(aside), 1e-9))
    assert r.pressing.asked == pytest.approx(most, rel=0.01)
    assert r.pressing.commanded == pytest.approx(most, abs=TUNING.damping)


def peak_of(arm: Arm, speed: float, touch: Touch, dt: float = 2e-5) -> float:
    """The largest normal force of a tool that meets a wall ahead, by Hunt and Crossley, rough."""
    J = arm.jacobian()[[0, 2]]
    arm.qd = np.linalg.lstsq(J, np.array([speed, 0.0]), rcond=None)[0]
    arm.referee.place(arm.q, np.zeros(arm.n), np.zeros(3))
    mobility = J @ np.linalg.solve(arm.referee.mass[6:, 6:], J.T)
    (v, side), depth, most = J @ arm.qd, 0.0, 0.0
    while depth >= 0.0 and v > -speed:
        force = touch.stiffness_high * depth * max(1.0 + touch.dissipation * v, 0.0)
        pull = -touch.friction * force * math.tanh(side / 1e-3)
        v, side = np.array([v, side]) + dt * mobility @ np.array([-force, pull])
        depth, most = depth + dt * v, max(most, force)
    return most


@pytest.mark.requirement("REQ-SAFE-14")
def test_a_tool_that_comes_too_fast_knows_how_hard_it_may_have_struck() -> None:
    """Never less than the blow was, of any posture and speed; and not many times as much."""
    vehicle, random, over = load_vehicle("probe-2r"), np.random.default_rng(8), []
    airframe = airframe_of(vehicle)
    for _ in range(60):
        q = np.array(vehicle.home_posture) + random.uniform(-0.4, 0.4, 2)
        touch = TOUCH._replace(
            dissipation=random.uniform(0.0, 4.0), friction=random.uniform(0.0, 0.6)
        )
        speed, arm = random.uniform(0.05, 1.0), Arm(vehicle, q)
        peak = peak_of(arm, speed, touch)
        r = at_surface(airframe, estimate(q, np.zeros(2), np.zeros(3)), AHEAD)
        k = r.pressing
        k.friction, k.dissipation = touch.friction, touch.dissipation
        k.coming, k.distance = speed, 0.1
        k.external[:2] = arm.jacobian().T @ (6.0 * np.array(AHEAD))  # it is felt by now
        weigh_tool(r, airframe, TUNING)
        press(r, airframe, TUNING, vec3(G), (0.0, 0.0, 0.0), DT)
        assert k.contact == 1
        assert k.blow >= 0.99 * peak
        over.append(k.blow / peak)
    assert np.median(over) < 2.0


@pytest.mark.requirement("REQ-SAFE-14")
def test_a_surface_is_not_believed_to_be_anywhere() -> None:
    """Contact farther off than a surface may be is none: something else moves the joints."""
    airframe = airframe_of(load_vehicle("probe-2r"))
    home = np.array(airframe.home)
    for far, near in ((0.25, 1), (0.35, 0)):
        r = at_surface(airframe, estimate(home, np.zeros(2), np.zeros(3)), AHEAD)
        r.pressing.contact, offset = 1, -9.0 + r.pressing.distance - far
        beyond = SafeSet((replace(wall(AHEAD, offset, 0.0), touch=TOUCH),))
        zones, wide = moving_zones(beyond, None), replace(TUNING, near=20.0)
        look_for_surface(r, airframe.bodies, wide, 0.0, zones, DT)
        assert r.pressing.near == near


@pytest.mark.requirement("REQ-SAFE-13")
def test_a_tool_that_comes_back_too_fast_is_not_pressed_on() -> None:
    """It has come off for an instant, and the observer of the force is too slow to see it."""
    vehicle = load_vehicle("probe-2r")
    r, airframe = pressed_upon(
        vehicle, np.array(vehicle.home_posture), 5.0 * np.array(AHEAD), AHEAD
    )
    k, level = r.pressing, (vec3(G), (0.0, 0.0, 0.0), DT)
    r.u.force, k.distance = 5.0, 0.0
    for _ in range(1000):
        press(r, airframe, TUNING, *level)
    assert k.commanded > 4.0
    k.speed = k.mean_speed = 0.04
    press(r, airframe, TUNING, *level)
    assert k.commanded > 4.0, "it follows a surface that yields"
    k.speed = k.mean_speed = 0.4
    press(r, airframe, TUNING, *level)
    assert k.commanded < 1.0
