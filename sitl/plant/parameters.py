"""From the description of a vehicle to the numbers that the plant's kernels need."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, cast

import numpy as np

from sitl.air.load import SURFACES, Air
from sitl.plant.aerial_manipulator import Drives, Plant, Rotors, Stops
from sitl.plant.bodies import Chain, Points
from sitl.plant.contact import Balls, Feet, Law, Surfaces
from sitl.plant.gears import gears
from sitl.plant.packing import pack_params
from sitl.plant.places import own_points
from sitl.plant.state import JOINTS_MAX, PARTS_MAX, ROTORS_MAX, SURFACES_MAX
from sitl.plant.tool import balls_of
from sitl.plant.vector import V3, Array
from sitl.shapes.kind import NUMBERS
from vehicles.description import Base, Link, Vehicle
from vehicles.vehicle_file import inertia_matrix

GRAVITY = 9.81  # m/s², along +z of NED


@dataclass(frozen=True, slots=True)
class AirModel:
    """What the vehicle feels of the air beside its rotors' thrust; nothing by default."""

    rotor_drag: V3 = (0.0, 0.0, 0.0)  # 1/s, per mass, along the body's axes
    drag_area: float = 0.0  # m²
    density: float = 1.225  # kg/m³, standard atmosphere at sea level
    ground: bool = False
    ceiling: bool = False
    suction: float = 0.0  # of walls, share of the thrust
    surfaces: tuple[tuple[V3, float], ...] = ()  # planes: normal into the air, NED, and offset, m

    @property
    def active(self) -> bool:
        """Whether there is anything to feel."""
        near = self.ground or self.ceiling or self.suction > 0.0
        return near or any(self.rotor_drag) or self.drag_area > 0.0


@dataclass(frozen=True, slots=True)
class Surface:
    """What can be touched: its shape where it begins, and what it does to what touches it."""

    kind: int  # which of sitl.shapes
    numbers: tuple[float, ...]  # of the shape, m, NED
    stiffness: float  # N/m
    dissipation: float  # s/m
    friction: float


@dataclass(frozen=True, slots=True)
class Effects:
    """What a vehicle meets in a flight and its file does not say; nothing by default."""

    air: AirModel = AirModel()
    motor_inertia: float = 0.0  # kg·m², of each joint's motor, beside its armature
    backlash: float = 0.0  # rad, from one tooth to the other; needs an inertia
    quadratic_thrust: bool = False  # the rotors' speed lags, not their thrust
    gravity: float = GRAVITY
    surfaces: tuple[Surface, ...] = ()
    finer: int = 1  # steps into which one is divided where the tip may touch one


def plant(vehicle: Vehicle, effects: Effects = Effects()) -> Plant:
    """The numbers of a vehicle for the kernels, in one record of their own."""
    copied: Plant = cast(Any, _packed(vehicle, effects)).copy()
    return copied


@lru_cache(maxsize=16)
def _packed(vehicle: Vehicle, effects: Effects) -> Plant:
    # To put it together takes 2 ms, as long as all else that begins a flight.
    joints, feet = vehicle.joints, vehicle.feet
    inertia = np.array([joint.armature for joint in joints]) + effects.motor_inertia
    numbers = Plant(
        chain=chain(vehicle),
        feet=Feet(
            number=len(feet.positions),
            points=_with_room(PARTS_MAX, feet.positions),
            reach=max(math.hypot(*foot) for foot in feet.positions),
            law=Law(feet.stiffness, feet.dissipation, feet.friction, feet.slip_rate),
        ),
        rotors=rotors(vehicle, quadratic=effects.quadratic_thrust),
        drives=Drives(
            torque_max=_with_room(JOINTS_MAX, [joint.torque_max for joint in joints]),
            viscous=_with_room(JOINTS_MAX, [joint.viscous for joint in joints]),
            coulomb=_with_room(JOINTS_MAX, [joint.coulomb for joint in joints]),
        ),
        stops=_stops(vehicle),
        gears=gears(inertia, effects.backlash),
        air=_air(vehicle, effects.air),
        points=_points(vehicle),
        balls=_balls(vehicle),
        surfaces=_surfaces(effects),
        locked=np.zeros(JOINTS_MAX),
        gravity=effects.gravity,
    )
    return pack_params(numbers)


def chain(vehicle: Vehicle) -> Chain:
    """The rigid bodies of a vehicle."""
    frames = joint_axes(vehicle)
    bodies: list[Base | Link] = [vehicle.base, *(joint.link for joint in vehicle.joints)]
    turns, origins = [np.eye(3)], [np.zeros(3)]
    for k, joint in enumerate(vehicle.joints, start=1):
        turns.append(frames[k - 1].T @ _rotation(joint.rpy) @ frames[k])
        origins.append(frames[k - 1].T @ joint.xyz)
    origins.append(frames[-1].T @ vehicle.end_effector.position)
    own = list(zip(frames, bodies, strict=True))
    n = JOINTS_MAX + 1
    return Chain(
        joints=len(vehicle.joints),
        turn=_with_room(n, turns),
        origin=_with_room(n + 1, origins),
        mass=_with_room(n, [body.mass for body in bodies]),
        com=_with_room(n, [frame.T @ body.com for frame, body in own]),
        inertia=_with_room(n, [f.T @ inertia_matrix(body.inertia) @ f for f, body in own]),
    )


def joint_axes(vehicle: Vehicle) -> list[Array]:
    """Axes (3, 3) of the plant's frame of each body, in the frame that its description is in.

    That of the base is the same; of a link it has the joint's axis along z.
    """
    found = [np.eye(3)]
    for joint in vehicle.joints:
        z = np.array(joint.axis)
        helper = np.zeros(3)
        helper[(int(np.argmax(np.abs(z))) + 1) % 3] = 1.0
        x = helper - (helper @ z) * z
        x /= np.linalg.norm(x)
        found.append(np.column_stack([x, np.cross(z, x), z]))
    return found


def _rotation(rpy: V3) -> Array:
    """Of roll, pitch and yaw [rad] about fixed axes, in this order, as in URDF."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    roll = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    pitch = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    yaw = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    turned: Array = yaw @ pitch @ roll
    return turned


def rotors(vehicle: Vehicle, *, quadratic: bool = False) -> Rotors:
    """The rotors of a vehicle; one that turns counter-clockwise turns the base clockwise."""
    place = np.array([rotor.position for rotor in vehicle.rotors])
    axis = np.array([rotor.axis for rotor in vehicle.rotors])
    sign = [-1.0 if rotor.spin == "ccw" else 1.0 for rotor in vehicle.rotors]
    lever = np.array([rotor.torque_per_thrust for rotor in vehicle.rotors]) * sign
    return Rotors(
        number=len(place),
        place=_with_room(ROTORS_MAX, place),
        axis=_with_room(ROTORS_MAX, axis),
        moment=_with_room(ROTORS_MAX, np.cross(place, axis)),
        reaction=_with_room(ROTORS_MAX, lever[:, None] * axis),
        thrust_max=_with_room(ROTORS_MAX, [rotor.thrust_max for rotor in vehicle.rotors]),
        lag=_with_room(ROTORS_MAX, [rotor.lag for rotor in vehicle.rotors]),
        quadratic=int(quadratic),
    )


def effectiveness(vehicle: Vehicle) -> Array:
    """Force [N, B] and moment [N·m, B] of the rotors, (6, r), for 1 N of each in free air."""
    numbers = rotors(vehicle)
    columns = np.hstack([numbers.axis, numbers.moment + numbers.reaction])
    matrix: Array = columns[: numbers.number].T
    return matrix


def _stops(vehicle: Vehicle) -> Stops:
    joints, beyond = vehicle.joints, vehicle.end_stops.beyond
    rows = [
        (tuple(unit), joint.position_min, joint.position_max)
        for unit, joint in zip(np.eye(len(joints)), joints, strict=True)
    ]
    rows += [(limit.row, limit.minimum, limit.maximum) for limit in vehicle.coupled_limits]
    room = JOINTS_MAX + PARTS_MAX
    return Stops(
        number=len(rows),
        share=_with_room(room, [_with_room(JOINTS_MAX, row) for row, _, _ in rows]),
        least=_with_room(room, [least - beyond for _, least, _ in rows]),
        most=_with_room(room, [most + beyond for _, _, most in rows]),
        stiffness=vehicle.end_stops.stiffness,
        damping=vehicle.end_stops.damping,
    )


def _air(vehicle: Vehicle, model: AirModel) -> Air:
    hubs = np.array([rotor.position for rotor in vehicle.rotors])
    beside = np.zeros((ROTORS_MAX, ROTORS_MAX))
    beside[: len(hubs), : len(hubs)] = np.linalg.norm(hubs[:, None] - hubs, axis=2)
    planes = [(*normal, offset) for normal, offset in model.surfaces]
    return Air(
        active=int(model.active),
        wind=np.zeros(3),
        drag=vehicle.mass * np.array(model.rotor_drag),
        area=model.drag_area,
        density=model.density,
        rotors=len(hubs),
        radius=_with_room(ROTORS_MAX, [rotor.radius for rotor in vehicle.rotors]),
        beside=beside,
        ground=int(model.ground),
        ceiling=int(model.ceiling),
        suction=model.suction,
        surfaces=_with_room(SURFACES, np.reshape(planes, (-1, 4))),
        surface_count=len(planes),
    )


def _points(vehicle: Vehicle) -> Points:
    points, frames = own_points(vehicle), joint_axes(vehicle)
    places = [frames[body].T @ place for body, place in points]
    return Points(
        number=len(points),
        body=_with_room(3 * PARTS_MAX, [body for body, _ in points]),
        place=_with_room(3 * PARTS_MAX, np.reshape(places, (-1, 3))),
    )


def _balls(vehicle: Vehicle) -> Balls:
    balls, frames, room = balls_of(vehicle), joint_axes(vehicle), 2 * PARTS_MAX
    behind = [0.0, *itertools.accumulate(math.hypot(*joint.xyz) for joint in vehicle.joints)]
    return Balls(
        number=len(balls),
        body=_with_room(room, [body for body, _, _ in balls]),
        place=_with_room(room, [frames[body].T @ place for body, place, _ in balls]),
        radius=_with_room(room, [radius for _, _, radius in balls]),
        reach=max(behind[body] + math.hypot(*place) + radius for body, place, radius in balls),
    )


def _surfaces(effects: Effects) -> Surfaces:
    given, n = effects.surfaces, SURFACES_MAX
    numbers = np.zeros((n, NUMBERS))
    for place, one in zip(numbers, given, strict=False):
        place[: len(one.numbers)] = one.numbers
    none, nowhere = np.zeros(n), np.zeros((n, 3))
    return Surfaces(
        number=len(given),
        finer=effects.finer,
        kind=_with_room(n, [one.kind for one in given]),
        numbers=numbers,
        velocity=nowhere,
        stiffness=_with_room(n, [one.stiffness for one in given]),
        dissipation=_with_room(n, [one.dissipation for one in given]),
        friction=_with_room(n, [one.friction for one in given]),
        clock=np.zeros(2),
        force=nowhere,
        outward=nowhere,
        normal=none,
        depth=none,
        slip=none,
        touching=none,
        force_max=none,
        when_s=none,
        contacts=none,
        contact_s=none,
        path=none,
    )


def _with_room(room: int, rows: Sequence[object] | Array) -> Array:
    """The rows with zeros behind them, so that a record of every vehicle has one layout."""
    given = np.asarray(rows, dtype=np.float64)
    out = np.zeros((room, *given.shape[1:]))
    out[: len(given)] = given
    return out
