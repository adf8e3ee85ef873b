"""The vehicle as the controllers believe it to be (Table I of the paper and our choices)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from fsw.autopilot.signals import Vec2, Vec3

GRAVITY = 9.81  # m/s^2, along +z of the world


@dataclass(frozen=True, slots=True)
class AttitudeLag:
    """How fast the attitude loop turns a commanded acceleration into a real one."""

    kp: float = 50.0  # 1/s^2, the paper's PID
    kd: float = 15.0  # 1/s
    # Eq 16 as printed: u is the acceleration. The states a, j and s then keep their start values,
    # and a start with zeros in them has no tilt in the arm's kinematics either.
    at_once: bool = False


@dataclass(frozen=True, slots=True)
class BodySize:
    """How far the vehicle reaches beyond its joints and its rotors' hubs."""

    hull: float = 0.08  # m, radius of the sphere that holds frame and battery
    blade: float = 0.165  # m, radius of a rotor
    disc: float = 0.02  # m, half the thickness of the space that the blades sweep
    feet_spread: float = 0.2  # m, feet at (+-spread, +-spread)
    leg: float = 0.01  # m, radius
    link: float = 0.02  # m, radius
    tool: float = 0.025  # m, radius about the end-effector


@dataclass(frozen=True, slots=True)
class Airframe:
    """'+' quadrotor with a planar two-joint arm whose first joint is at the body origin.

    Rotors are numbered rear, left, front, right, so that with thrusts f the torque is
    ``[L (f2 - f4), L (f3 - f1), b (f1 - f2 + f3 - f4)]`` in the body (FRD).
    """

    mass: float = 3.5  # kg, the whole vehicle
    inertia: Vec3 = (0.3, 0.3, 0.6)  # kg m^2, base only
    rotor_arm: float = 0.3  # m, L
    yaw_per_thrust: float = 0.016  # m, b
    rotor_thrust_max: float = 2.0 * 3.5 * GRAVITY / 4.0  # N; thrust-to-weight 2, our choice
    rotor_lag: float = 0.04  # s, our choice
    attitude_lag: AttitudeLag = field(default_factory=AttitudeLag)
    link_length: Vec2 = (0.15, 0.15)  # m
    link_mass: Vec2 = (0.2, 0.2)  # kg, from the laboratory's public model
    link_com: Vec2 = (0.075, 0.075)  # m from the link's joint
    link_inertia: Vec2 = (4.256e-5, 8.321e-5)  # kg m^2 about +y at the link's centre of mass
    joint_torque_max: float = 2.0  # N m, our choice
    # kg m^2 of each joint's motor, times the square of its gear's ratio; the paper has none.
    joint_armature: float = 0.0
    joint1_limit: float = math.pi / 3.0  # rad, |th1|
    joint12_limit: float = math.pi / 2.0  # rad, |th1 + th2|
    # A servo of 2.5 N m stall torque and 5.8 rad/s without load, common in this class, still turns
    # at 5 rad/s against the arm's weight.
    joint_rate_max: float = 5.0  # rad/s, each joint, our choice
    # The planner's pi / 10 of Table I and what cancels 0.8 m/s^2 on both axes at once: 23.8 deg.
    tilt_max: float = math.radians(25.0)  # rad, of the body's z axis against the vertical
    # Roll and pitch: the fast loop's jerk of 20 m/s^3 on both axes turns a hovering body at
    # 2.9 rad/s. Yaw: three times what a setpoint may turn.
    body_rate_max: Vec2 = (3.0, 1.0)  # rad/s, of roll and pitch together, and of yaw
    leg_length: float = 0.32  # m, body origin above ground when standing
    size: BodySize = field(default_factory=BodySize)


AIRFRAME = Airframe()
