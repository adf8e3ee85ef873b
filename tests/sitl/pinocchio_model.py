"""The same vehicle built in Pinocchio, from its description alone (none of our kinematics)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from sitl.plant.parameters import GRAVITY
from sitl.plant.vector import Array
from vehicles.description import Base, Link, Vehicle
from vehicles.urdf import urdf_text


def _inertia(body: Base | Link) -> Any:
    xx, yy, zz, xy, xz, yz = body.inertia
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return pin.Inertia(body.mass, np.array(body.com), matrix)


def pinocchio_model(vehicle: Vehicle, gravity: float = GRAVITY, motor: float = 0.0) -> Any:
    """A free-flyer with one unaligned revolute joint per link; gravity along +z (NED).

    Each joint carries its armature and a ``motor`` [kg·m²].
    """
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, gravity])
    parent = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    model.appendBodyToJoint(parent, _inertia(vehicle.base), pin.SE3.Identity())
    for joint in vehicle.joints:
        place = pin.SE3(pin.rpy.rpyToMatrix(*joint.rpy), np.array(joint.xyz))
        turn = pin.JointModelRevoluteUnaligned(np.array(joint.axis))
        parent = model.addJoint(parent, turn, place, joint.name)
        model.appendBodyToJoint(parent, _inertia(joint.link), pin.SE3.Identity())
    model.armature[6:] = [joint.armature + motor for joint in vehicle.joints]
    tool = pin.SE3(np.eye(3), np.array(vehicle.end_effector.position))
    model.addFrame(pin.Frame("tool", parent, tool, pin.FrameType.OP_FRAME))
    return model


def exported_model(vehicle: Vehicle, gravity: float = GRAVITY) -> Any:
    """As Pinocchio reads the URDF of the vehicle, which knows no armature."""
    model = pin.buildModelFromXML(urdf_text(vehicle), pin.JointModelFreeFlyer())
    model.gravity.linear = np.array([0.0, 0.0, gravity])
    for joint, one in zip(list(model.joints)[2:], vehicle.joints, strict=True):
        model.armature[joint.idx_v] = one.armature
    return model


def configuration_of(model: Any, state_p: Array, state_q: Array, q_arm: Array) -> Array:
    """``configuration``; of a joint without limits an exported model has cosine and sine."""
    q = np.zeros(model.nq)
    q[:7] = configuration(state_p, state_q, np.zeros(0))
    for joint, angle in zip(list(model.joints)[2:], q_arm, strict=True):
        turn = (angle,) if joint.nq == 1 else (np.cos(angle), np.sin(angle))
        q[joint.idx_q : joint.idx_q + joint.nq] = turn
    return q


def configuration(state_p: Array, state_q: Array, q_arm: Array) -> Array:
    """Pinocchio's q: position, quaternion [x, y, z, w], joint angles."""
    w, x, y, z = state_q
    return np.concatenate([state_p, [x, y, z, w], q_arm])
