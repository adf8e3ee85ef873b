"""Where the parts of a vehicle are: the flight software's own model, asked for pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from command_line.bounded_json import json_numbers
from fsw.autopilot.geometry.rotation import euler_zyx, matrix_from_quaternion
from fsw.autopilot.model.airframe import AIRFRAME, Airframe
from fsw.autopilot.model.kinematics import (
    frame_of,
    position,
    predicted_end_effector,
)
from fsw.autopilot.model.prediction import P, condense, to_vector
from fsw.autopilot.signals import PlanInput, PredictionState, StateEstimate, Vec3
from view.scene import Horizon, Posture

_STILL: Vec3 = (0.0, 0.0, 0.0)
ROTORS = ("1 (rear)", "2 (left)", "3 (front)", "4 (right)")  # as the vehicle's texts name them


class Places(NamedTuple):
    """The arm's points in space [m, NED]."""

    base: Vec3
    joint2: Vec3
    tip: Vec3


def places(posture: Posture, airframe: Airframe = AIRFRAME) -> Places:
    """Base, joint 2 and end-effector of a ``posture`` [m, rad, NED]."""
    R = matrix_from_quaternion(posture.q)
    estimate = StateEstimate(
        0, posture.p, _STILL, R, _STILL, euler_zyx(R)[2], posture.q_arm, (0.0, 0.0)
    )
    frame = frame_of(airframe.bodies, estimate)
    return Places(*(position(frame, point.on, point.begin) for point in airframe.points))


def rotor_hubs(airframe: Airframe = AIRFRAME) -> tuple[Vec3, ...]:
    """The hubs in the body frame [m, FRD]: rear, left, front, right."""
    reach = airframe.rotor_arm
    return ((-reach, 0.0, 0.0), (0.0, -reach, 0.0), (reach, 0.0, 0.0), (0.0, reach, 0.0))


def tilt(posture: Posture) -> float:
    """Between the body's z axis and the vertical [rad]."""
    R = matrix_from_quaternion(posture.q)
    return float(np.arccos(np.clip(R[8], -1.0, 1.0)))


def horizon(
    start: PredictionState,
    inputs: tuple[PlanInput, ...],
    period: float,
    airframe: Airframe = AIRFRAME,
) -> Horizon:
    """Where a plan leads: the base and the end-effector at each node [m, NED].

    It begins at ``start`` [SI, NED] and has ``inputs`` [SI, NED] for a ``period`` [s] each.
    """
    model = condense_once(airframe, len(inputs), period)
    u = np.array([(*one.a, one.yaw_acc, *one.qdd_arm) for one in inputs]).ravel()
    nodes = model.phi @ to_vector(start, airframe.bodies.joints) + model.gamma @ u
    base = tuple(_vec3(node[P : P + 3]) for node in nodes)
    return Horizon(base, tuple(predicted_end_effector(airframe.bodies, node)[0] for node in nodes))


@lru_cache(maxsize=4)
def condense_once(airframe: Airframe, nodes: int, period: float) -> Any:
    """The prediction over ``nodes`` steps of a ``period`` [s] each."""
    return condense(airframe, period, nodes)


def airframe_of(numbers: str | int | None) -> Airframe:
    """The airframe that a log was flown with, from its information ``numbers``; else the usual."""
    try:
        airframe: Airframe = _filled(AIRFRAME, "airframe", json_numbers(str(numbers)))
    except (ValueError, TypeError, AttributeError):
        return AIRFRAME
    return airframe


def _filled(value: Any, name: str, known: Mapping[str, Any]) -> Any:
    """A dataclass with the numbers that are known of it."""
    if is_dataclass(value) and not isinstance(value, type):
        parts = {f.name: getattr(value, f.name) for f in fields(value)}
        return replace(value, **{k: _filled(v, f"{name}.{k}", known) for k, v in parts.items()})
    if isinstance(value, tuple):
        return tuple(_filled(one, f"{name}.{k}", known) for k, one in enumerate(value))
    return value if value is None else type(value)(known.get(name, value))


def _vec3(row: NDArray[np.float64]) -> Vec3:
    x, y, z = row.tolist()
    return x, y, z
