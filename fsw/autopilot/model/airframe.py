"""The vehicle as the controllers believe it to be."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from operator import truediv

import numpy as np

from fsw.autopilot.model.multibody import Bodies, Several, bodies_of
from fsw.autopilot.model.parts import Part, parts_of, points_of
from fsw.autopilot.signals import ActuatorCommand, JointVector, Vec2
from fsw.record import JOINTS, ROTORS, padded, padded_rows
from vehicles.description import Battery, Rotor, Vehicle
from vehicles.vehicle_file import load_vehicle

GRAVITY = 9.81  # m/s^2, along +z of the world
_MAV_TYPES = {4: 2, 6: 13, 8: 14}
_MULTIROTOR = 43  # MAV_TYPE of any number of rotors


@dataclass(frozen=True, slots=True)
class AttitudeLag:
    """How fast the attitude loop turns a commanded acceleration into a real one."""

    kp: float = 50.0  # 1/s^2, the paper's PID
    kd: float = 15.0  # 1/s
    # Eq 16 as printed: u is the acceleration. The states a, j and s then keep their start values,
    # and a start with zeros in them has no tilt in the arm's kinematics either.
    at_once: bool = False


@dataclass(frozen=True, slots=True)
class AngleLimit:
    """A limit of joints' angles, ``low <= row · q <= high``: of one joint, or of a sum."""

    row: JointVector  # (j,) [1]
    low: float  # rad
    high: float  # rad

    @property
    def name(self) -> str:
        """What it limits: "joint 1", or "joints 1 and 2 together"."""
        joints = [str(k) for k, share in enumerate(self.row, start=1) if share]
        if len(joints) == 1:
            return f"joint {joints[0]}"
        return f"joints {', '.join(joints[:-1])} and {joints[-1]} together"


@dataclass(frozen=True, slots=True)
class Airframe:
    """What the controllers know of a vehicle; rotors and joints in the order of its file."""

    mass: float  # kg, the whole vehicle
    bodies: Bodies  # that it consists of
    rotors: int
    wrench: Several  # (6,) each: force [1] and torque [m] in B about its origin, per thrust
    share: Several  # (4,) each: of roll, pitch, thrust and yaw, the pseudoinverse of those
    rotor_lever: float  # m, of roll and pitch, the root of the mean square over rotors
    rotor_thrust_max: Several  # (ROTORS,) N
    rotor_lag: float  # s, of the slowest
    rotor_radius: Several  # (ROTORS,) m
    joint_torque_max: Several  # (JOINTS,) N m
    joint_rate_max: Several  # (JOINTS,) rad/s
    joint_friction: Several  # (JOINTS,) N m, of a drive that turns slowly
    joint_drag: Several  # (JOINTS,) N m, more of one that turns at its largest rate
    angle_limits: tuple[AngleLimit, ...]
    home_posture: Several  # (JOINTS,) rad, to fly in
    points: tuple[Part, ...]  # the critical points
    parts: tuple[Part, ...]  # what takes up space
    tilt_max: float  # rad, of the body's z axis against the vertical
    body_rate_max: Vec2  # rad/s, of roll and pitch together, and of yaw
    leg_length: float  # m, body origin above ground when standing
    battery: Battery
    # kg m^2 of each joint's motor, times the square of its gear's ratio; beside the vehicle's own.
    joint_armature: float = 0.0
    attitude_lag: AttitudeLag = field(default_factory=AttitudeLag)

    @property
    def home(self) -> JointVector:
        """Angles to fly in (j,) [rad]."""
        return self.home_posture[: self.bodies.joints]

    @property
    def weakest_thrust(self) -> float:
        """What every rotor can give [N]."""
        return min(self.rotor_thrust_max[: self.rotors])

    @property
    def strongest_thrust(self) -> float:
        """What no rotor gives more than [N]."""
        return max(self.rotor_thrust_max[: self.rotors])

    @property
    def full_thrust(self) -> float:
        """What all rotors give together [N]."""
        return sum(self.rotor_thrust_max[: self.rotors])

    @property
    def mav_type(self) -> int:
        """Its MAV_TYPE: by the number of rotors, where there is one."""
        return _MAV_TYPES.get(self.rotors, _MULTIROTOR)

    def shares(self, command: ActuatorCommand) -> ActuatorCommand:
        """The command with each thrust and torque as a share [1] of the largest."""
        return ActuatorCommand(
            tuple(map(truediv, command.rotor_thrust, self.rotor_thrust_max)),
            tuple(map(truediv, command.joint_torque, self.joint_torque_max)),
        )


def airframe_of(vehicle: Vehicle) -> Airframe:
    """What the controllers know of a vehicle."""
    rotors, bodies = vehicle.rotors, bodies_of(vehicle)
    rows = [wrench_of(rotor) for rotor in rotors]
    effect = np.array([(row[3], row[4], -row[2], row[5]) for row in rows]).T
    share = np.linalg.pinv(effect).ravel().tolist()
    return Airframe(
        mass=vehicle.mass,
        bodies=bodies,
        rotors=len(rotors),
        wrench=padded_rows(rows, 6 * ROTORS),
        share=padded(tuple(share), 4 * ROTORS),
        rotor_lever=math.sqrt(sum(row[3] ** 2 + row[4] ** 2 for row in rows) / len(rows)),
        rotor_thrust_max=padded(tuple([rotor.thrust_max for rotor in rotors]), ROTORS),
        rotor_lag=max(rotor.lag for rotor in rotors),
        rotor_radius=padded(tuple([rotor.radius for rotor in rotors]), ROTORS),
        joint_torque_max=padded(tuple([joint.torque_max for joint in vehicle.joints]), JOINTS),
        joint_rate_max=padded(tuple([joint.rate_max for joint in vehicle.joints]), JOINTS),
        joint_friction=padded(tuple([joint.coulomb for joint in vehicle.joints]), JOINTS),
        joint_drag=padded(tuple([one.viscous * one.rate_max for one in vehicle.joints]), JOINTS),
        angle_limits=_angle_limits(vehicle),
        home_posture=padded(vehicle.home_posture, JOINTS),
        points=points_of(vehicle),
        parts=parts_of(vehicle),
        tilt_max=vehicle.limits.tilt,
        body_rate_max=(vehicle.limits.roll_pitch_rate, vehicle.limits.yaw_rate),
        leg_length=max(z for _, _, z in vehicle.feet.positions),
        battery=vehicle.battery,
    )


def _angle_limits(vehicle: Vehicle) -> tuple[AngleLimit, ...]:
    """The joints' own limits, then the coupled ones; a joint without any has none."""
    n = len(vehicle.joints)
    own = [
        AngleLimit(tuple([float(k == i) for k in range(n)]), joint.position_min, joint.position_max)
        for i, joint in enumerate(vehicle.joints)
        if math.isfinite(joint.position_min) or math.isfinite(joint.position_max)
    ]
    coupled = [AngleLimit(one.row, one.minimum, one.maximum) for one in vehicle.coupled_limits]
    return (*own, *coupled)


def wrench_of(rotor: Rotor) -> Several:
    """Force [1] and torque [m] in B, about its origin, of a rotor per thrust."""
    (px, py, pz), (x, y, z) = rotor.position, rotor.axis
    # PX4's: a rotor that turns counter-clockwise turns the vehicle the other way about its axis.
    drag = rotor.torque_per_thrust if rotor.spin == "ccw" else -rotor.torque_per_thrust
    torque = (py * z - pz * y - drag * x, pz * x - px * z - drag * y, px * y - py * x - drag * z)
    return (x, y, z, *torque)


AIRFRAME = airframe_of(load_vehicle("paper"))
