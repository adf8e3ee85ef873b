"""Where the parts of a vehicle are: the flight software's own model, asked for pictures."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from command_line.bounded_json import json_numbers
from fsw.autopilot.geometry.rotation import matrix_from_quaternion, rotate
from fsw.autopilot.geometry.vectors import add
from fsw.autopilot.model.airframe import AIRFRAME, Airframe
from fsw.autopilot.model.airframe import airframe_of as model_of
from fsw.autopilot.model.kinematics import (
    predicted_end_effector,
)
from fsw.autopilot.model.multibody import place_links, place_of_tip
from fsw.autopilot.model.parts import ON_BASE
from fsw.autopilot.model.prediction import P, condense, to_vector
from fsw.autopilot.signals import PlanInput, PredictionState, Vec3
from fsw.autopilot.tick_record import Multibody
from vehicles.vehicle_file import VehicleError, parse_vehicle
from view.scene import Horizon, Posture, vec3


def chain(posture: Posture, airframe: Airframe) -> list[Vec3]:
    """Each joint's origin and the end-effector [m, NED] of a ``posture`` [m, rad, NED]."""
    R, b, m = matrix_from_quaternion(posture.q), airframe.bodies, Multibody()
    place_links(m, b, posture.q_arm)
    origins = m.origin.reshape(-1, 3)[: b.joints].tolist()
    tip = place_of_tip(m, b)
    return [add(posture.p, rotate(R, (x, y, z))) for x, y, z in (*origins, tip)]


def tip_of(posture: Posture, airframe: Airframe) -> Vec3:
    """The end-effector of a ``posture`` [m, NED]."""
    return chain(posture, airframe)[-1]


def rotor_hubs(airframe: Airframe) -> tuple[Vec3, ...]:
    """The hubs in the body frame [m, FRD], as far as the torques of the rotors tell."""
    rows = [airframe.wrench[6 * i : 6 * i + 6] for i in range(airframe.rotors)]
    return tuple((row[4] / -row[2], -row[3] / -row[2], 0.0) for row in rows)


class Sizes(NamedTuple):
    """How thick the parts of a vehicle are drawn."""

    hull: float  # m, radius of the sphere that holds frame and battery
    blade: float  # m, radius of a rotor
    disc: float  # m, half the thickness of the space that the blades sweep
    link: float  # m, radius
    tool: float  # m, radius about the end-effector


def sizes_of(airframe: Airframe) -> Sizes:
    """The sizes of a vehicle's parts; where it has none they are thin."""
    rotors = next(part for part in airframe.parts if part.rim > 0.0)
    arm, hubs = [part for part in airframe.parts if part.on != ON_BASE], rotor_hubs(airframe)
    return Sizes(
        hull=airframe.parts[0].radius,
        blade=rotors.rim - max(math.dist(hub[:2], rotors.begin[:2]) for hub in hubs),
        disc=rotors.radius,
        link=max([part.radius for part in arm if part.end is not None], default=0.0),
        tool=max([part.radius for part in arm if part.on == airframe.bodies.joints], default=0.0),
    )


def legs(airframe: Airframe) -> tuple[tuple[Vec3, Vec3], ...]:
    """Both ends of what is long on the base [m, FRD]."""
    return tuple(
        (part.begin, part.end)
        for part in airframe.parts
        if part.on == ON_BASE and part.end is not None
    )


def tilt(posture: Posture) -> float:
    """Between the body's z axis and the vertical [rad]."""
    R = matrix_from_quaternion(posture.q)
    return float(np.arccos(np.clip(R[8], -1.0, 1.0)))


def tilts(q: NDArray[Any]) -> NDArray[np.float64]:
    """The same [deg] of unit quaternions ``q`` (n, 4) [1]."""
    x, y = np.asarray(q[:, 1], "f8"), np.asarray(q[:, 2], "f8")
    return np.asarray(np.degrees(np.arccos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0))))


def horizon(
    start: PredictionState,
    inputs: tuple[PlanInput, ...],
    period: float,
    airframe: Airframe,
) -> Horizon:
    """Where a plan leads: the base and the end-effector at each node [m, NED].

    It begins at ``start`` [SI, NED] and has ``inputs`` [SI, NED] for a ``period`` [s] each.
    """
    model = condense_once(airframe, len(inputs), period)
    u = np.array([(*one.a, one.yaw_acc, *one.qdd_arm) for one in inputs]).ravel()
    nodes = model.phi @ to_vector(start) + model.gamma @ u
    base = tuple(vec3(node[P : P + 3]) for node in nodes)
    return Horizon(base, tuple(predicted_end_effector(airframe.bodies, node)[0] for node in nodes))


@lru_cache(maxsize=4)
def condense_once(airframe: Airframe, nodes: int, period: float) -> Any:
    """The prediction over ``nodes`` steps of a ``period`` [s] each."""
    return condense(airframe, period, nodes)


def airframe_of(information: Mapping[str, str | int]) -> Airframe:
    """The airframe of a log, of its vehicle's file and its numbers; else the paper's."""
    try:
        text = str(information["vehicle_file"])
        airframe = model_of(parse_vehicle(text, str(information.get("vehicle", "vehicle"))))
    except (KeyError, VehicleError):
        airframe = AIRFRAME
    try:
        filled: Airframe = _filled(
            airframe, "airframe", json_numbers(str(information.get("numbers")))
        )
    except (ValueError, TypeError, AttributeError):
        return airframe
    return filled


def _filled(value: Any, name: str, known: Mapping[str, Any]) -> Any:
    """A dataclass with the numbers that are known of it."""
    if is_dataclass(value) and not isinstance(value, type):
        parts = {f.name: getattr(value, f.name) for f in fields(value)}
        return replace(value, **{k: _filled(v, f"{name}.{k}", known) for k, v in parts.items()})
    if isinstance(value, tuple):
        # An older log may have one number for all of them.
        return tuple(
            _filled(known.get(name, one), f"{name}.{k}", known) for k, one in enumerate(value)
        )
    return value if value is None else type(value)(known.get(name, value))
