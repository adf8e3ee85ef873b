"""Energy and momentum of free motion, computed by Pinocchio."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from sitl.plant.parameters import GRAVITY, Effects
from sitl.plant.vector import Array
from tests.sitl.free_motion import flown, tumbling
from tests.sitl.pinocchio_model import configuration, pinocchio_model
from tests.sitl.state_view import StateView
from tests.sitl.vehicles import PAPER, frictionless, random_vehicle, without_stops
from vehicles.description import Vehicle

_SPATIAL = random_vehicle(4, 6, np.random.default_rng(5))
# Pinocchio's energy leaves out what turns behind a gear.
SPATIAL = replace(_SPATIAL, joints=tuple(replace(one, armature=0.0) for one in _SPATIAL.joints))


def weigh(vehicle: Vehicle, state: Array, gravity: float) -> tuple[float, Array]:
    """Total energy [J] and momentum (6,): linear, and angular about the centre of mass, in W."""
    model = pinocchio_model(vehicle, gravity)
    data = model.createData()
    view = StateView(state, len(vehicle.joints))
    q = configuration(view.p_WB, view.q_WB, view.q_arm)
    v_B = pin.Quaternion(q[3:7]).toRotationMatrix().T @ view.v_WB
    v = np.concatenate([v_B, view.w_WB_B, view.qd_arm])
    energy = pin.computeKineticEnergy(model, data, q, v) + pin.computePotentialEnergy(
        model, data, q
    )
    momentum = np.array(pin.computeCentroidalMomentum(model, data, q, v).vector)
    return float(energy), momentum


@pytest.mark.parametrize("gravity", [0.0, GRAVITY])
@pytest.mark.parametrize("vehicle", [PAPER, SPATIAL], ids=["paper", "spatial"])
def test_free_motion_keeps_energy_and_angular_momentum(vehicle: Vehicle, gravity: float) -> None:
    vehicle = frictionless(vehicle)
    before = tumbling(vehicle)
    after = flown(vehicle, before, 2.0, 0.001, Effects(gravity=gravity))
    energy, momentum = weigh(vehicle, before, gravity)
    energy_after, momentum_after = weigh(vehicle, after, gravity)
    kinetic, _ = weigh(vehicle, before, 0.0)
    # 1e-7: the global error of RK4 at 1 ms, see the test of its order below.
    assert abs(energy_after - energy) <= 1e-7 * kinetic
    assert np.abs(momentum_after[3:] - momentum[3:]).max() <= 1e-7 * np.linalg.norm(momentum[3:])


@pytest.mark.parametrize("gravity", [0.0, GRAVITY])
def test_linear_momentum_grows_by_weight_times_time(gravity: float) -> None:
    vehicle = frictionless()
    _, before = weigh(vehicle, tumbling(vehicle), gravity)
    state = flown(vehicle, tumbling(vehicle), 2.0, 0.001, Effects(gravity=gravity))
    _, after = weigh(vehicle, state, gravity)
    gained = np.array([0.0, 0.0, 2.0 * vehicle.mass * gravity])
    assert np.abs(after[:3] - before[:3] - gained).max() <= 1e-6


def test_halving_the_step_divides_the_error_by_sixteen() -> None:
    vehicle = frictionless()
    reference = flown(vehicle, tumbling(vehicle), 1.0, 1 / 8192)
    errors = [
        float(np.abs(flown(vehicle, tumbling(vehicle), 1.0, step) - reference).max())
        for step in (1 / 512, 1 / 1024, 1 / 2048)
    ]
    print("\nerror after 1 s at 2, 1, 0.5 ms:", *(f"{error:.1e}" for error in errors))
    for coarse, fine in itertools.pairwise(errors):
        assert 12.0 <= coarse / fine <= 20.0


def test_joint_friction_only_takes_energy_away() -> None:
    vehicle = without_stops(PAPER)
    state = tumbling(vehicle)
    last, momentum = weigh(vehicle, state, 0.0)
    for _ in range(20):
        state = flown(vehicle, state, 0.02, 0.001, Effects(gravity=0.0))
        energy, now = weigh(vehicle, state, 0.0)
        assert energy < last
        # An internal torque: whatever it takes from the joints it gives to the base.
        assert np.abs(now - momentum).max() <= 1e-6
        last = energy
