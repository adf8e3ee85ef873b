"""A vehicle tumbling freely: no friction, no ground, no command."""

from __future__ import annotations

import numpy as np

from sitl.plant.integrator import held, integrate
from sitl.plant.parameters import Effects, plant
from sitl.plant.places import rows_of
from sitl.plant.state import at_rest
from sitl.plant.vector import Array
from tests.sitl.state_view import StateView
from tests.sitl.vehicles import inputs
from vehicles.description import Vehicle

_NONE = Effects()


def tumbling(vehicle: Vehicle) -> Array:
    """High up, turning about every axis, all joints swinging."""
    joints = len(vehicle.joints)
    state = at_rest(len(vehicle.rotors), joints)
    view = StateView(state, joints)
    view.p_WB[:] = (1.0, -2.0, -100.0)
    view.v_WB[:] = (0.5, -0.3, 0.2)
    view.q_WB[:] = np.array([0.8, 0.2, -0.4, 0.4])
    view.q_WB[:] /= np.linalg.norm(view.q_WB)
    view.w_WB_B[:] = (1.5, -1.0, 0.8)
    view.q_arm[:] = (0.4, -0.9, 0.7, -0.3, 0.2, 0.5)[:joints]
    view.qd_arm[:] = (2.0, -3.0, 1.0, 2.5, -1.5, -2.0)[:joints]
    return state


def flown(
    vehicle: Vehicle, start: Array, seconds: float, step: float, effects: Effects = _NONE
) -> Array:
    """The state after ``seconds`` without any input."""
    state = start.copy()
    places = np.empty((round(seconds / step), rows_of(vehicle), 3))
    states = np.empty((len(places), len(state)))
    integrate(plant(vehicle, effects), state, inputs(), step, places, states, held())
    return state
