"""The recursion against Pinocchio's articulated-body algorithm."""

from __future__ import annotations

from functools import partial

import numpy as np
import pinocchio as pin
import pytest

from sitl.plant.actuators import joint_torque, rotor_torque
from sitl.plant.aerial_manipulator import Inputs, acceleration_into, plant
from sitl.plant.parameters import EndStops, Link, Vehicle
from sitl.plant.state import at_rest
from sitl.plant.vector import Array
from tests.sitl.free_motion import record_of, workspace
from tests.sitl.pinocchio_model import configuration, pinocchio_model
from tests.sitl.state_view import StateView

STATES = 1000
_in_long = partial(pytest.param, marks=pytest.mark.long)
TOLERANCE = 1e-9  # relative to the largest acceleration of the state


def random_vehicle(joints: int, random: np.random.Generator) -> Vehicle:
    """A vehicle with no symmetry that could hide a sign: skew axes, offset centres of mass."""

    def three(low: float, high: float) -> tuple[float, float, float]:
        a, b, c = (float(v) for v in random.uniform(low, high, 3))
        return (a, b, c)

    links = tuple(
        Link(
            a=float(random.uniform(0.1, 0.3)),
            alpha=float(random.uniform(-2.0, 2.0)),
            d=float(random.uniform(-0.1, 0.1)),
            theta_offset=float(random.uniform(-1.0, 1.0)),
            mass=float(random.uniform(0.1, 0.5)),
            com=three(-0.1, 0.1),
            inertia=three(2e-4, 3e-4),
        )
        for _ in range(joints)
    )
    return Vehicle(
        base_com=three(-0.05, 0.05), mount=three(-0.1, 0.1), links=links, stops=EndStops(())
    )


def random_state(joints: int, random: np.random.Generator) -> Array:
    """In the air, moving and turning every way."""
    state = at_rest(joints)
    view = StateView(state)
    view.p_WB[:] = random.uniform(-12.0, -8.0, 3)
    view.v_WB[:] = random.uniform(-3.0, 3.0, 3)
    quaternion = random.standard_normal(4)
    view.q_WB[:] = quaternion / np.linalg.norm(quaternion)
    view.w_WB_B[:] = random.uniform(-4.0, 4.0, 3)
    view.thrust[:] = random.uniform(0.0, 17.0, 4)
    view.q_arm[:] = random.uniform(-3.0, 3.0, joints)
    view.qd_arm[:] = random.uniform(-5.0, 5.0, joints)
    return state


def pinocchio_acceleration(
    vehicle: Vehicle, model: pin.Model, data: pin.Data, state: Array, inputs: Inputs
) -> Array:
    """Acceleration of the base origin [B], angular acceleration [B], joint accelerations."""
    view = StateView(state)
    q = configuration(view.p_WB, view.q_WB, view.q_arm)
    rotation = pin.Quaternion(q[3:7]).toRotationMatrix()
    v_B = rotation.T @ view.v_WB
    rotors, drive = vehicle.rotors, vehicle.joints
    lift = np.array([0.0, 0.0, -view.thrust.sum()])
    f1, f2, f3, f4 = view.thrust
    turn = rotor_torque((f1, f2, f3, f4), (f1, f2, f3, f4), rotors.arm, rotors.yaw_ratio)
    force = lift + rotation.T @ inputs.force_W
    moment = np.array(turn) + inputs.torque_B
    torque = [
        joint_torque(t, r, drive.torque_max, drive.viscous, drive.coulomb, drive.coulomb_rate)
        for t, r in zip(inputs.torque, view.qd_arm, strict=True)
    ]
    velocity = np.concatenate([v_B, view.w_WB_B, view.qd_arm])
    out = np.array(pin.aba(model, data, q, velocity, np.concatenate([force, moment, torque])))
    # Pinocchio returns the rate of the velocity's components in B.
    out[:3] += np.cross(view.w_WB_B, v_B)
    return out


# Each number of joints is a recursion compiled anew; two are what flies.
@pytest.mark.parametrize("joints", [_in_long(1), 2, _in_long(3)])
def test_forward_dynamics_equal_the_articulated_body_algorithm(joints: int) -> None:
    random = np.random.default_rng(joints)
    work = workspace(joints)
    worst = 0.0
    for trial in range(STATES):
        if trial % 100 == 0:
            vehicle = random_vehicle(joints, random)
            model = pinocchio_model(vehicle)
            data, numbers = model.createData(), plant(vehicle)
        state = random_state(joints, random)
        inputs = Inputs(
            np.zeros(4),
            random.uniform(-2.0, 2.0, joints),
            random.uniform(-5.0, 5.0, 3),
            random.uniform(-1.0, 1.0, 3),
        )
        acceleration_into(numbers, state, record_of(inputs), work)
        expected = pinocchio_acceleration(vehicle, model, data, state, inputs)
        error = np.abs(work.load - expected).max() / np.abs(expected).max()
        worst = max(worst, float(error))
    print(f"\nj = {joints}: worst relative difference {worst:.1e} over {STATES} states")
    assert worst <= TOLERANCE
