"""A vehicle tumbling freely: no friction, no ground, no command."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sitl.plant.aerial_manipulator import Inputs, Workspace, empty_workspace, plant
from sitl.plant.integrator import held, integrate
from sitl.plant.packing import pack_params
from sitl.plant.parameters import EndStops, Vehicle
from sitl.plant.state import at_rest
from sitl.plant.vector import Array
from tests.sitl.state_view import StateView


def record_of(inputs: Inputs) -> Inputs:
    """Inputs as flights hand them to kernels: as arrays they are compiled once more, for 4 s."""
    return pack_params(inputs)


def workspace(joints: int = 2) -> Workspace:
    """Memory for a vehicle with ``joints`` joints, likewise."""
    return pack_params(empty_workspace(joints))


def frictionless(gravity: float) -> Vehicle:
    """The paper's vehicle without joint friction, its arm free to swing through."""
    vehicle = Vehicle()
    joints = replace(vehicle.joints, viscous=0.0, coulomb=0.0)
    return replace(vehicle, joints=joints, stops=EndStops(()), gravity=gravity)


def tumbling() -> Array:
    """High up, turning about every axis, both joints swinging."""
    state = at_rest(2)
    view = StateView(state)
    view.p_WB[:] = (1.0, -2.0, -100.0)
    view.v_WB[:] = (0.5, -0.3, 0.2)
    view.q_WB[:] = np.array([0.8, 0.2, -0.4, 0.4])
    view.q_WB[:] /= np.linalg.norm(view.q_WB)
    view.w_WB_B[:] = (1.5, -1.0, 0.8)
    view.q_arm[:] = (0.4, -0.9)
    view.qd_arm[:] = (2.0, -3.0)
    return state


def flown(vehicle: Vehicle, start: Array, seconds: float, step: float) -> Array:
    """The state after ``seconds`` without any input."""
    joints = len(vehicle.links)
    state = start.copy()
    inputs = record_of(Inputs(np.zeros(4), np.zeros(joints), np.zeros(3), np.zeros(3)))
    places = np.empty((round(seconds / step), 2 + joints, 3))
    states = np.empty((len(places), len(state)))
    integrate(plant(vehicle), state, inputs, step, places, states, held(joints))
    return state
