"""What the simulated vehicle is made of, and where each number comes from."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from sitl.plant.bodies import Chain
from sitl.plant.vector import V3

GRAVITY = 9.81  # m/s², along +z of NED


@dataclass(frozen=True, slots=True)
class Link:
    """One link of the arm, its joint at the near end (standard DH convention)."""

    a: float  # m, along x of the link frame
    mass: float  # kg
    com: V3  # m, in the link frame, whose origin is the far end
    inertia: V3  # kg·m², principal values about the centre of mass along the link frame's axes
    alpha: float = 0.0  # rad
    d: float = 0.0  # m
    theta_offset: float = 0.0  # rad


def slender_link(length: float, mass: float, inertia: float) -> Link:
    """A planar link of a ``length`` [m] and ``mass`` [kg], its centre of mass half-way.

    ``inertia`` [kg·m²] is about either axis across the link, through the centre of mass; the paper
    gives one per link. About the long axis we take a solid cylinder of 10 mm radius, m r²/2: small
    beside the rest, but a body without it would not be physical.
    """
    along = 0.5 * mass * 0.01**2
    return Link(
        a=length, mass=mass, com=(-0.5 * length, 0.0, 0.0), inertia=(along, inertia, inertia)
    )


@dataclass(frozen=True, slots=True)
class Rotors:
    """Four rotors in '+': 1 rear, 2 left, 3 front, 4 right."""

    arm: float = 0.3  # m, Table I
    yaw_ratio: float = 0.016  # m, reaction torque per thrust (same laboratory's public model)
    thrust_max: float = 2.0 * 3.5 * GRAVITY / 4.0  # N each: thrust-to-weight 2:1, our choice
    lag: float = 0.04  # s, first order, our choice
    quadratic: bool = False  # the speed lags, not the thrust


@dataclass(frozen=True, slots=True)
class Joints:
    """Joint drives: a torque source behind friction."""

    torque_max: float = 2.0  # N·m, our choice: ten times the arm's static load
    viscous: float = 0.005  # N·m·s/rad
    coulomb: float = 0.01  # N·m
    coulomb_rate: float = 0.05  # rad/s, width of the smoothed sign change


@dataclass(frozen=True, slots=True)
class Motors:
    """Of the joints, behind their gears; without inertia or gap by default."""

    inertia: float = 0.0  # kg·m², as the joint feels it
    backlash: float = 0.0  # rad, from one tooth to the other; needs an inertia


@dataclass(frozen=True, slots=True)
class EndStops:
    """Springs and dampers that push a link back and never pull it.

    Each is between a link and the base, as Table I's limits are: a parallelogram drives the second
    link. An arm that reaches them at 5 rad/s with full torque behind it goes less than 4 deg
    beyond, one that full torque has thrown across less than 8. On the lightest motion of the arm
    spring and damper have poles at 1.4 / ms; RK4 is stable to 2.8.
    """

    # rad, either way, 3 deg beyond Table I; a link without an entry has none.
    angle: tuple[float, ...] = (math.radians(63.0), math.radians(93.0))
    stiffness: float = 600.0  # N·m/rad
    damping: float = 0.6  # N·m·s/rad


@dataclass(frozen=True, slots=True)
class Legs:
    """Four feet of a landing gear.

    They reach 20 mm below the straight arm (0.30 m), so that a limp arm hangs free while the
    vehicle stands, whatever its joints do.
    """

    spread: float = 0.2  # m, feet at (±spread, ±spread) in B
    length: float = 0.32  # m, below the base origin
    stiffness: float = 4000.0  # N/m each: 2 mm deep at rest
    dissipation: float = 4.0  # s/m, Hunt–Crossley: normal force = k d (1 + c ḋ)
    friction: float = 0.7  # Coulomb coefficient
    slip_rate: float = 0.03  # m/s, width of the smoothed sign change


@dataclass(frozen=True, slots=True)
class Size:
    """How far the vehicle reaches beyond its joints, feet and rotor hubs: our choice."""

    hull: float = 0.08  # m, radius of a ball about the base origin: frame and battery
    link: float = 0.02  # m, radius of an arm's link and of the joints between
    tool: float = 0.025  # m, radius of a ball about the end-effector
    leg: float = 0.01  # m, radius of a leg, from the base origin to a foot
    blade: float = 0.165  # m, radius of a rotor: the blades' tips are 0.465 m from the base origin
    disc: float = (
        0.02  # m, half the height of what the blades sweep, as they flap and the hubs yield
    )


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
class Vehicle:
    """The aerial manipulator; the defaults are the paper's Table I."""

    base_mass: float = 3.1  # kg, 3.5 in all
    base_com: V3 = (0.0, 0.0, 0.0)  # m, in B
    base_inertia: V3 = (0.3, 0.3, 0.6)  # kg·m², about the base's centre of mass
    links: tuple[Link, ...] = (
        slender_link(0.15, 0.2, 4.256e-5),
        slender_link(0.15, 0.2, 8.321e-5),
    )
    mount: V3 = (0.0, 0.0, 0.0)  # m, joint 1 in B
    rotors: Rotors = Rotors()
    joints: Joints = Joints()
    motors: Motors = Motors()
    stops: EndStops = EndStops()
    legs: Legs = Legs()
    size: Size = Size()
    air: AirModel = AirModel()
    gravity: float = GRAVITY

    @property
    def mass(self) -> float:
        """Total mass [kg]."""
        return self.base_mass + sum(link.mass for link in self.links)

    def scaled(self, mass: float, inertia: float) -> Vehicle:
        """The same vehicle, masses times ``mass`` [1] and inertias times ``inertia`` [1]."""
        return replace(
            self,
            base_mass=mass * self.base_mass,
            base_inertia=_times(inertia, self.base_inertia),
            links=tuple(
                replace(link, mass=mass * link.mass, inertia=_times(inertia, link.inertia))
                for link in self.links
            ),
        )


def _times(factor: float, v: V3) -> V3:
    return (factor * v[0], factor * v[1], factor * v[2])


def chain(vehicle: Vehicle) -> Chain:
    """The rigid bodies of a vehicle as arrays for the kernels.

    DH frame 0 has z0 = +y_B (the joint axes) and x0 = +z_B (the arm hangs down at zero).
    """
    links = vehicle.links
    diagonals = [vehicle.base_inertia, *(link.inertia for link in links)]
    return Chain(
        mount_R=np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
        mount_p=np.array(vehicle.mount),
        dh=np.array(
            [(k.a, math.cos(k.alpha), math.sin(k.alpha), k.d, k.theta_offset) for k in links]
        ).reshape(-1, 5),
        mass=np.array([vehicle.base_mass, *(link.mass for link in links)]),
        com=np.array([vehicle.base_com, *(link.com for link in links)]),
        inertia=np.array([np.diag(diagonal) for diagonal in diagonals]),
    )


def level_reach(vehicle: Vehicle, angles: tuple[float, ...]) -> V3:
    """End-effector in B of a planar arm at the given joint angles [m]."""
    x, y, z = vehicle.mount
    total = 0.0
    for link, angle in zip(vehicle.links, angles, strict=True):
        total += angle + link.theta_offset
        x += link.a * math.sin(total)
        z += link.a * math.cos(total)
    return (x, y, z)
