"""What a vehicle is made of, as frozen data; read from TOML by ``vehicle_file``.

A key is declared once, as a field with its range. All numbers are in SI units, angles in radians.
The body frame B is FRD (x forward, y right, z down), its origin where the vehicle's position is
measured; the frame of a joint's link moves with it and equals the joint's frame at angle zero.
Whoever flies or simulates a vehicle derives its own physics from this; nothing is derived here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Final, Literal, TypeAlias

from command_line.ranges import Range

JOINTS_MAX: Final = 6  # that records of the flight software have room for
ROTORS_MAX: Final = 8

V3: TypeAlias = tuple[float, float, float]
V6: TypeAlias = tuple[float, float, float, float, float, float]

_ANGLE: Final = Range(-4.0 * math.pi, 4.0 * math.pi, unit="rad")
_AXIS: Final = Range(-1.05, 1.05)  # [1]; whoever rounds a unit vector need not do it well
_INERTIA: Final = Range(-1000.0, 1000.0, unit="kg m^2")
_MASS: Final = Range(1e-6, 1000.0, unit="kg")
_PLACE: Final = Range(-10.0, 10.0, unit="m")
_RADIUS: Final = Range(0.0, 10.0, unit="m")


@dataclass(frozen=True, slots=True, kw_only=True)
class Base:
    """The vehicle without its arm."""

    mass: Annotated[float, _MASS]  # kg
    # kg m^2, entries xx, yy, zz, xy, xz, yz of the matrix about the centre of mass, along B's axes
    inertia: Annotated[V6, _INERTIA]
    com: Annotated[V3, _PLACE] = (0.0, 0.0, 0.0)  # m, centre of mass in B


@dataclass(frozen=True, slots=True, kw_only=True)
class Rotor:
    """One rotor, with PX4's meanings of ``CA_ROTORn_*``."""

    position: Annotated[V3, _PLACE]  # m, of the hub in B (PX, PY, PZ)
    spin: Literal["ccw", "cw"]  # seen against its axis (KM > 0 is counter-clockwise)
    thrust_max: Annotated[float, Range(0.001, 10_000.0, unit="N")]
    axis: Annotated[V3, _AXIS] = (0.0, 0.0, -1.0)  # [1], of the thrust, unit (AX, AY, AZ)
    torque_per_thrust: Annotated[float, Range(0.0, 1.0, unit="m")] = 0.016  # |KM|
    lag: Annotated[float, Range(0.001, 0.5, unit="s")] = 0.04  # of the thrust behind its command
    radius: Annotated[float, Range(0.001, 5.0, unit="m")] = 0.165  # of the blades
    # half the height of what the blades sweep, as they flap and the hubs yield
    half_height: Annotated[float, Range(0.0, 1.0, unit="m")] = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """The body that a joint moves, in the joint's frame."""

    mass: Annotated[float, _MASS]  # kg
    com: Annotated[V3, _PLACE]  # m
    inertia: Annotated[V6, _INERTIA]  # kg m^2, about ``com``: xx, yy, zz, xy, xz, yz


@dataclass(frozen=True, slots=True, kw_only=True)
class Joint:
    """A revolute joint on the link before, or on the base, and its drive; as in URDF."""

    name: str
    link: Link
    axis: Annotated[V3, _AXIS]  # [1], unit, in the joint's frame
    xyz: Annotated[V3, _PLACE] = (0.0, 0.0, 0.0)  # m, origin in the frame of the link before
    rpy: Annotated[V3, _ANGLE] = (0.0, 0.0, 0.0)  # rad, of the joint's frame, about fixed axes
    # rad; without them the joint turns freely, or as far as ``coupled_limits`` let it
    position_min: Annotated[float, _ANGLE] = -math.inf
    position_max: Annotated[float, _ANGLE] = math.inf
    rate_max: Annotated[float, Range(0.01, 100.0, unit="rad/s")]  # either way
    torque_max: Annotated[float, Range(0.001, 10_000.0, unit="N m")]  # either way
    viscous: Annotated[float, Range(0.0, 100.0, unit="N m s/rad")] = 0.0
    coulomb: Annotated[float, Range(0.0, 1000.0, unit="N m")] = 0.0
    # of the motor behind its gear
    armature: Annotated[float, Range(0.0, 100.0, unit="kg m^2")] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class CoupledLimit:
    """A limit on a sum of joint angles: ``minimum <= row · q <= maximum``."""

    name: str
    row: tuple[Annotated[float, Range(-100.0, 100.0)], ...]  # (j,) [1]
    minimum: Annotated[float, Range(-1000.0, 1000.0, unit="rad")]
    maximum: Annotated[float, Range(-1000.0, 1000.0, unit="rad")]


@dataclass(frozen=True, slots=True, kw_only=True)
class EndStops:
    """Springs and dampers beyond each limit of a joint or of a sum of them; they never pull."""

    beyond: Annotated[float, Range(0.0, 1.0, unit="rad")] = math.radians(3.0)  # behind the limit
    stiffness: Annotated[float, Range(0.0, 1e6, unit="N m/rad")] = 600.0
    damping: Annotated[float, Range(0.0, 1e4, unit="N m s/rad")] = 0.6


@dataclass(frozen=True, slots=True, kw_only=True)
class EndEffector:
    """The tool at the end of the last link."""

    position: Annotated[V3, _PLACE]  # m, in the frame of the last joint


@dataclass(frozen=True, slots=True, kw_only=True)
class Feet:
    """Where the vehicle stands: points that are rigid on the base."""

    positions: tuple[Annotated[V3, _PLACE], ...]  # m, in B
    stiffness: Annotated[float, Range(10.0, 1e7, unit="N/m")] = 4000.0  # each
    dissipation: Annotated[float, Range(0.0, 1000.0, unit="s/m")] = 4.0  # of Hunt and Crossley
    friction: Annotated[float, Range(0.0, 10.0)] = 0.7  # Coulomb's coefficient
    slip_rate: Annotated[float, Range(0.001, 1.0, unit="m/s")] = 0.03  # of its smoothed change


@dataclass(frozen=True, slots=True, kw_only=True)
class Battery:
    """A straight line of the voltage over the charge, less the drop at the inner resistance."""

    capacity: Annotated[float, Range(0.01, 1000.0, unit="A h")] = 10.0
    full: Annotated[float, Range(1.0, 1000.0, unit="V")] = 16.8
    empty: Annotated[float, Range(1.0, 1000.0, unit="V")] = 13.6
    resistance: Annotated[float, Range(0.0, 10.0, unit="ohm")] = 0.02
    efficiency: Annotated[float, Range(0.05, 1.0)] = 0.55  # figure of merit, motor and controller
    idle_power: Annotated[float, Range(0.0, 10_000.0, unit="W")] = 8.0  # electronics and arm


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What the vehicle keeps to in flight."""

    # of -z_B and the vertical
    tilt: Annotated[float, Range(0.05, 1.5, unit="rad")] = math.radians(25.0)
    roll_pitch_rate: Annotated[float, Range(0.1, 20.0, unit="rad/s")] = 3.0  # of both together
    yaw_rate: Annotated[float, Range(0.05, 20.0, unit="rad/s")] = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class CriticalPoint:
    """A point that keeps clear of what is in the way; ``on`` is "base" or the name of a joint."""

    name: str
    on: str
    position: Annotated[V3, _PLACE] = (0.0, 0.0, 0.0)  # m, in the frame of what it is on


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyPart:
    """A ball, or a capsule where there is an ``end``; ``on`` as of a critical point."""

    name: str
    on: str
    position: Annotated[V3, _PLACE] = (0.0, 0.0, 0.0)  # m, centre of the ball or first end
    end: Annotated[V3, _PLACE] | None = None  # m, other end of a capsule
    radius: Annotated[float, _RADIUS]  # m


@dataclass(frozen=True, slots=True, kw_only=True)
class Vehicle:
    """An aerial manipulator: a base with rotors, and an arm of joints in a row."""

    name: str
    base: Base
    rotors: tuple[Rotor, ...]  # 4 to 8, in the order of the actuators
    joints: tuple[Joint, ...]  # 1 to 6, from the base to the end-effector
    end_effector: EndEffector
    feet: Feet
    critical_points: tuple[CriticalPoint, ...]
    coupled_limits: tuple[CoupledLimit, ...] = ()
    rest_posture: tuple[Annotated[float, _ANGLE], ...] = ()  # (j,) rad, on the ground; none: zeros
    home_posture: tuple[Annotated[float, _ANGLE], ...] = ()  # (j,) rad, to fly in; none: that one
    parts: tuple[BodyPart, ...] = ()  # beside the rotors, which have a size of their own
    end_stops: EndStops = EndStops()
    battery: Battery = Battery()
    limits: Limits = Limits()

    @property
    def mass(self) -> float:
        """Of the whole vehicle [kg]."""
        return self.base.mass + sum(joint.link.mass for joint in self.joints)

    @property
    def places(self) -> dict[str, int]:
        """What a point may be on: 0 for the base, k for the link behind the k-th joint."""
        return {"base": 0} | {joint.name: k for k, joint in enumerate(self.joints, start=1)}
