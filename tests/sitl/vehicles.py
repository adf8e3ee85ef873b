"""Vehicles that tests of the plant fly, and inputs of any size for its kernels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sitl.plant.aerial_manipulator import Inputs, Workspace, empty_workspace
from sitl.plant.packing import pack_params
from sitl.plant.state import JOINTS_MAX, ROTORS_MAX
from vehicles.description import V3, V6, Base, EndEffector, Joint, Link, Rotor, Vehicle
from vehicles.vehicle_file import checked, load_vehicle

PAPER = load_vehicle("paper")
NONE = (0.0, 0.0, 0.0)


def inputs(
    thrust: Sequence[float] = (),
    torque: Sequence[float] = (),
    force_W: V3 = NONE,
    torque_B: V3 = NONE,
) -> Inputs:
    """Commands [N, N·m] and pushes on the base; what is not given is zero."""
    found = Inputs(
        np.zeros(ROTORS_MAX), np.zeros(JOINTS_MAX), np.array(force_W), np.array(torque_B)
    )
    found.thrust[: len(thrust)] = thrust
    found.torque[: len(torque)] = torque
    # As flights hand them to kernels: as arrays these are compiled once more, for 4 s.
    return pack_params(found)


def workspace() -> Workspace:
    """Memory for any vehicle, likewise."""
    return pack_params(empty_workspace())


def without_stops(vehicle: Vehicle) -> Vehicle:
    """Joints that turn as far as they like."""
    free = [replace(one, position_min=-math.inf, position_max=math.inf) for one in vehicle.joints]
    return replace(vehicle, joints=tuple(free), coupled_limits=())


def frictionless(vehicle: Vehicle = PAPER) -> Vehicle:
    """The vehicle with joints that nothing brakes or stops."""
    vehicle = without_stops(vehicle)
    smooth = [replace(one, viscous=0.0, coulomb=0.0) for one in vehicle.joints]
    return replace(vehicle, joints=tuple(smooth))


def random_vehicle(joints: int, rotors: int, random: np.random.Generator) -> Vehicle:
    """A vehicle with no symmetry that could hide a sign: skew axes, frames and inertias."""

    def three(low: float, high: float) -> V3:
        a, b, c = (float(v) for v in random.uniform(low, high, 3))
        return (a, b, c)

    def unit() -> V3:
        a, b, c = random.standard_normal(3)
        length = math.sqrt(a * a + b * b + c * c)
        return (float(a) / length, float(b) / length, float(c) / length)

    def inertia(low: float, high: float) -> V6:
        turn, _ = np.linalg.qr(random.standard_normal((3, 3)))
        matrix = turn @ np.diag(random.uniform(low, high, 3)) @ turn.T
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = matrix.tolist()
        return (xx, yy, zz, xy, xz, yz)

    def rotor(k: int) -> Rotor:
        angle = 2.0 * math.pi * (k + random.uniform(-0.2, 0.2)) / rotors
        x, y, z = random.uniform(-0.2, 0.2, 2).tolist() + [-1.0]
        length = math.sqrt(x * x + y * y + z * z)
        return Rotor(
            position=(
                0.3 * math.cos(angle),
                0.3 * math.sin(angle),
                float(random.uniform(-0.1, 0.1)),
            ),
            axis=(x / length, y / length, z / length),
            spin="ccw" if k % 2 == 0 else "cw",
            thrust_max=float(random.uniform(10.0, 20.0)),
            torque_per_thrust=float(random.uniform(0.01, 0.03)),
            lag=float(random.uniform(0.02, 0.06)),
        )

    return checked(
        Vehicle(
            name="random",
            base=Base(mass=3.1, inertia=inertia(0.2, 0.3), com=three(-0.05, 0.05)),
            rotors=tuple(rotor(k) for k in range(rotors)),
            joints=tuple(
                Joint(
                    name=f"joint{k + 1}",
                    axis=unit(),
                    xyz=three(-0.2, 0.2),
                    rpy=three(-3.0, 3.0),
                    rate_max=5.0,
                    torque_max=float(random.uniform(1.0, 3.0)),
                    viscous=float(random.uniform(0.0, 0.01)),
                    coulomb=float(random.uniform(0.0, 0.02)),
                    armature=float(random.uniform(0.0, 1e-3)),
                    link=Link(
                        mass=float(random.uniform(0.1, 0.5)),
                        com=three(-0.1, 0.1),
                        inertia=inertia(2e-4, 3e-4),
                    ),
                )
                for k in range(joints)
            ),
            end_effector=EndEffector(position=three(-0.2, 0.2)),
            feet=PAPER.feet,
            critical_points=PAPER.critical_points[:1],
        )
    )
