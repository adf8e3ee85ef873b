"""Vehicles that are made up: any axes, any poses of joints, any bodies that can be."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from vehicles.description import (
    V6,
    Base,
    CriticalPoint,
    EndEffector,
    Feet,
    Joint,
    Link,
    Rotor,
    Vehicle,
)
from vehicles.vehicle_file import checked

Random = np.random.Generator
_RING = 0.3  # m


def vector(random: Random, size: float) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in random.uniform(-size, size, 3))
    return x, y, z


def inertia(random: Random, mass: float, size: float) -> V6:
    """Of three pairs of points: a body that can be, in any axes."""
    squares = mass * random.uniform(0.02, 1.0, 3) * size**2
    moments = np.diag(squares.sum() - squares)
    R = Rotation.random(random_state=random).as_matrix()
    m = R @ moments @ R.T
    xx, yy, zz, xy, xz, yz = (float(m[i, j]) for i, j in zip(*_ENTRIES, strict=True))
    return xx, yy, zz, xy, xz, yz


_ENTRIES = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)


def rotor_ring(random: Random, count: int, weight: float, tilt: float = 0.0) -> tuple[Rotor, ...]:
    """Rotors on a circle, each tilted about its own arm by as much, to either side in turn."""
    begin = float(random.uniform(0.0, 2.0 * math.pi))
    found = []
    for k in range(count):
        angle = begin + 2.0 * math.pi * k / count
        side = tilt if k % 2 else -tilt
        c, s = math.cos(angle), math.sin(angle)
        found.append(
            Rotor(
                position=(_RING * c, _RING * s, float(random.uniform(-0.05, 0.05))),
                axis=(-math.sin(side) * s, math.sin(side) * c, -math.cos(side)),
                spin="cw" if k % 2 else "ccw",
                thrust_max=2.0 * weight / count,
            )
        )
    return tuple(found)


def random_vehicle(random: Random, joints: int, rotors: int = 4, tilt: float = 0.0) -> Vehicle:
    """One with an arm of so many joints, of a tenth of the base's mass."""
    mass = float(random.uniform(1.0, 5.0))
    links = [float(value) for value in random.uniform(0.05, 0.3, joints)]
    arm = []
    for k, link in enumerate(links, start=1):
        axis = random.normal(size=3)
        axis /= np.linalg.norm(axis)
        arm.append(
            Joint(
                name=f"joint{k}",
                xyz=vector(random, 0.2),
                rpy=vector(random, math.pi),
                axis=(float(axis[0]), float(axis[1]), float(axis[2])),
                position_min=-2.0,
                position_max=2.0,
                rate_max=5.0,
                torque_max=2.0,
                link=Link(mass=link, com=vector(random, 0.1), inertia=inertia(random, link, 0.05)),
            )
        )
    return checked(
        Vehicle(
            name="made_up",
            base=Base(mass=mass, com=vector(random, 0.05), inertia=inertia(random, mass, 0.15)),
            rotors=rotor_ring(random, rotors, 9.81 * (mass + sum(links)), tilt),
            joints=tuple(arm),
            end_effector=EndEffector(position=vector(random, 0.2)),
            feet=Feet(positions=((0.2, 0.2, 0.3), (0.2, -0.2, 0.3), (-0.2, 0.0, 0.3))),
            critical_points=(CriticalPoint(name="base", on="base"),),
        )
    )


def multirotor_with_arm(random: Random) -> Vehicle:
    """One that could have been built: a ring of rotors, and an arm that hangs below the base."""
    rotors, joints = int(random.integers(4, 9)), int(random.integers(1, 5))
    mass, ring = float(random.uniform(1.0, 6.0)), float(random.uniform(0.18, 0.5))
    spare = float(random.uniform(0.65, 1.8))
    share = float(random.uniform(0.05, 0.2))  # of the base's mass, in the arm
    lengths = [ring * float(random.uniform(0.6, 1.2)) / joints for _ in range(joints)]
    arm, z = [], float(random.uniform(0.0, 0.06))
    for k, length in enumerate(lengths, start=1):
        axis = (0.0, 1.0, 0.0) if k == 1 else _AXES[int(random.integers(3))]
        link = share * mass * length / sum(lengths)
        moments = (link * length**2 / 12.0, link * length**2 / 12.0, link * (0.1 * length) ** 2)
        most = float(random.uniform(0.8, 1.8))
        arm.append(
            Joint(
                name=f"joint{k}",
                xyz=(0.0, 0.0, z),
                axis=axis,
                position_min=-most,
                position_max=most,
                rate_max=float(random.uniform(2.0, 6.0)),
                torque_max=4.0 * 9.81 * share * mass * sum(lengths),
                armature=0.002,
                viscous=0.002,
                coulomb=0.004,
                link=Link(
                    mass=link, com=(0.0, 0.0, length / 2.0), inertia=(*moments, 0.0, 0.0, 0.0)
                ),
            )
        )
        z = length
    whole = mass * (1.0 + share)
    leg = sum(lengths) + 0.1
    xx = mass * (0.4 * ring) ** 2
    return checked(
        Vehicle(
            name="made_up",
            base=Base(
                mass=mass,
                com=(*(float(one) for one in random.uniform(-0.01, 0.01, 2)), 0.0),
                inertia=(xx, xx * float(random.uniform(0.8, 1.2)), 1.6 * xx, 0.0, 0.0, 0.0),
            ),
            rotors=tuple(
                replace(
                    one,
                    position=tuple(ring / _RING * p for p in one.position),
                    thrust_max=one.thrust_max * spare * float(random.uniform(0.9, 1.1)),
                    lag=0.03,
                )
                for one in rotor_ring(random, rotors, 9.81 * whole)
            ),
            joints=tuple(arm),
            end_effector=EndEffector(position=(0.0, 0.0, z)),
            feet=Feet(
                positions=tuple(
                    (x * ring, y * ring, leg) for x in (-0.6, 0.6) for y in (-0.6, 0.6)
                ),
                stiffness=400.0 * whole,
                slip_rate=0.1,
            ),
            critical_points=(CriticalPoint(name="base", on="base"),),
        )
    )


_AXES = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
