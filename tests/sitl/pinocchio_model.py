"""The same vehicle built in Pinocchio, from the parameters alone (none of our kinematics)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from sitl.plant.parameters import Link, Vehicle
from sitl.plant.vector import Array


def _dh_tail(link: Link) -> Any:
    """From the turned joint frame to the next one: d along z, a along x, alpha about x."""
    return pin.SE3(pin.utils.rotate("x", link.alpha), np.array([link.a, 0.0, link.d]))


def _turned(angle: float) -> Any:
    return pin.SE3(pin.utils.rotate("z", angle), np.zeros(3))


def pinocchio_model(vehicle: Vehicle) -> Any:
    """A free-flyer with one revolute z joint per link; gravity along +z (NED)."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, vehicle.gravity])
    parent = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    base = pin.Inertia(vehicle.base_mass, np.array(vehicle.base_com), np.diag(vehicle.base_inertia))
    model.appendBodyToJoint(parent, base, pin.SE3.Identity())
    # z0 = +y_B and x0 = +z_B: the cyclic permutation of the axes.
    place = pin.SE3(np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]), np.array(vehicle.mount))
    for number, link in enumerate(vehicle.links):
        joint = place * _turned(link.theta_offset)
        parent = model.addJoint(parent, pin.JointModelRZ(), joint, f"joint{number}")
        inertia = pin.Inertia(link.mass, np.array(link.com), np.diag(link.inertia))
        place = _dh_tail(link)
        model.appendBodyToJoint(parent, inertia, place)
    return model


def configuration(state_p: Array, state_q: Array, q_arm: Array) -> Array:
    """Pinocchio's q: position, quaternion [x, y, z, w], joint angles."""
    w, x, y, z = state_q
    return np.concatenate([state_p, [x, y, z, w], q_arm])
