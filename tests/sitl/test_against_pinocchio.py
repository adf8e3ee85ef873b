"""The recursion against Pinocchio's articulated-body algorithm."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from sitl.plant.actuators import joint_torque
from sitl.plant.aerial_manipulator import Inputs, place_bodies, placed_acceleration_into
from sitl.plant.integrator import held, places
from sitl.plant.parameters import plant
from sitl.plant.places import row_of, rows_of
from sitl.plant.state import at_rest
from sitl.plant.trim import end_effector
from sitl.plant.vector import Array
from tests.sitl.pinocchio_model import (
    configuration,
    configuration_of,
    exported_model,
    pinocchio_model,
)
from tests.sitl.state_view import StateView
from tests.sitl.vehicles import inputs, random_vehicle, without_stops, workspace
from vehicles.description import CriticalPoint, Vehicle
from vehicles.vehicle_file import load_vehicle, vehicle_names

STATES = 1000
TOLERANCE = 1e-9  # relative to the largest acceleration of the state


def random_state(vehicle: Vehicle, random: np.random.Generator) -> Array:
    """In the air, moving and turning every way."""
    joints = len(vehicle.joints)
    state = at_rest(len(vehicle.rotors), joints)
    view = StateView(state, joints)
    view.p_WB[:] = random.uniform(-12.0, -8.0, 3)
    view.v_WB[:] = random.uniform(-3.0, 3.0, 3)
    quaternion = random.standard_normal(4)
    view.q_WB[:] = quaternion / np.linalg.norm(quaternion)
    view.w_WB_B[:] = random.uniform(-4.0, 4.0, 3)
    view.thrust[:] = random.uniform(0.0, 17.0, len(vehicle.rotors))
    view.q_arm[:] = random.uniform(-3.0, 3.0, joints)
    view.qd_arm[:] = random.uniform(-5.0, 5.0, joints)
    return state


def rotor_wrench(vehicle: Vehicle, thrust: Array) -> Array:
    """Force [N, B] and moment [N·m, B] of all rotors, from PX4's definition of their numbers."""
    wrench = np.zeros(6)
    for rotor, f in zip(vehicle.rotors, thrust, strict=True):
        axis = np.array(rotor.axis)
        km = rotor.torque_per_thrust if rotor.spin == "ccw" else -rotor.torque_per_thrust
        wrench += np.concatenate([f * axis, f * (np.cross(rotor.position, axis) - km * axis)])
    return wrench


def pinocchio_acceleration(
    vehicle: Vehicle, model: pin.Model, data: pin.Data, state: Array, given: Inputs
) -> Array:
    """Acceleration of the base origin [B], angular acceleration [B], joint accelerations."""
    view = StateView(state, len(vehicle.joints))
    q = configuration_of(model, view.p_WB, view.q_WB, view.q_arm)
    rotation = pin.Quaternion(q[3:7]).toRotationMatrix()
    v_B = rotation.T @ view.v_WB
    wrench = rotor_wrench(vehicle, view.thrust)
    wrench += np.concatenate([rotation.T @ given.force_W, given.torque_B])
    torque = [
        joint_torque(given.torque[k], view.qd_arm[k], one.torque_max, one.viscous, one.coulomb)
        for k, one in enumerate(vehicle.joints)
    ]
    velocity = np.concatenate([v_B, view.w_WB_B, view.qd_arm])
    out = np.array(pin.aba(model, data, q, velocity, np.concatenate([wrench, torque])))
    # Pinocchio returns the rate of the velocity's components in B.
    out[:3] += np.cross(view.w_WB_B, v_B)
    return out


def worst_difference(
    vehicle: Vehicle, states: int, random: np.random.Generator, model: pin.Model
) -> float:
    """Largest difference of accelerations, relative to the largest of each state."""
    data, numbers, work = model.createData(), plant(vehicle), workspace()
    worst, joints = 0.0, len(vehicle.joints)
    for _ in range(states):
        state = random_state(vehicle, random)
        force, torque = random.uniform(-5.0, 5.0, 3).tolist(), random.uniform(-1.0, 1.0, 3).tolist()
        given = inputs(torque=random.uniform(-4.0, 4.0, joints), force_W=force, torque_B=torque)
        place_bodies(numbers, state, work)
        placed_acceleration_into(numbers, state, given, work)
        expected = pinocchio_acceleration(vehicle, model, data, state, given)
        error = np.abs(work.load[: 6 + joints] - expected).max() / np.abs(expected).max()
        worst = max(worst, float(error))
    return worst


@pytest.mark.drawn(1)
@pytest.mark.parametrize("joints", range(1, 7))
def test_forward_dynamics_equal_the_articulated_body_algorithm(joints: int) -> None:
    random = np.random.default_rng(joints)
    worst = max(
        worst_difference(vehicle, STATES // 10, random, pinocchio_model(vehicle))
        for vehicle in (random_vehicle(joints, 4 + k % 5, random) for k in range(10))
    )
    print(f"\nj = {joints}: worst relative difference {worst:.1e} over {STATES} states")
    assert worst <= TOLERANCE


@pytest.mark.drawn(2)
@pytest.mark.parametrize("name", vehicle_names())
def test_so_they_do_for_the_urdf_of_every_vehicle_that_comes_with_pandion(name: str) -> None:
    vehicle, random = load_vehicle(name), np.random.default_rng(0)
    model = exported_model(vehicle)
    assert worst_difference(without_stops(vehicle), STATES, random, model) <= TOLERANCE


@pytest.mark.parametrize("joints", range(1, 7))
def test_joints_tool_and_points_are_where_pinocchio_has_them(joints: int) -> None:
    random = np.random.default_rng(joints)
    vehicle = random_vehicle(joints, 4, random)
    points = [
        CriticalPoint(name=f"point{k}", on=one, position=tuple(random.uniform(-0.3, 0.3, 3)))
        for k, one in enumerate(vehicle.places)
    ]
    vehicle = Vehicle(
        **{name: getattr(vehicle, name) for name in vehicle.__slots__ if name != "critical_points"},
        critical_points=tuple(points),
    )
    model = pinocchio_model(vehicle)
    data, out = model.createData(), np.empty((1, rows_of(vehicle), 3))
    for _ in range(20):
        state = random_state(vehicle, random)
        view = StateView(state, joints)
        pin.framesForwardKinematics(model, data, configuration(view.p_WB, view.q_WB, view.q_arm))
        places(plant(vehicle), state, held(), out)
        tool = data.oMf[model.getFrameId("tool")].translation
        assert out[0, 0] == pytest.approx(view.p_WB, abs=1e-12)
        assert out[0, 1 : 1 + joints] == pytest.approx(
            np.array([data.oMi[2 + k].translation for k in range(joints)]), abs=1e-12
        )
        assert out[0, 1 + joints] == pytest.approx(tool, abs=1e-12)
        for k, point in enumerate(points):
            where = data.oMi[1 + k].act(np.array(point.position))
            assert out[0, row_of(vehicle, k, point.position)] == pytest.approx(where, abs=1e-12)
        base = data.oMi[1].actInv(tool)
        assert end_effector(vehicle, tuple(view.q_arm)) == pytest.approx(base, abs=1e-12)
