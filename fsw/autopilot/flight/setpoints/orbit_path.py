"""Orbit as a vector field: for any point, the target and velocity on the circle; pure."""

from __future__ import annotations

import math

from fsw.autopilot.signals import Facing, MotionSetpoint, Orbit, Vec3

_AT_CENTRE = 0.01  # m; nearer the centre any point of the circle is as good
_SHARE = 0.8  # of a limit; the rest corrects what is off


def max_orbit_speed(orbit_radius: float, turn_rate: float, acceleration: float) -> float:
    """How fast a circle of ``orbit_radius`` [m] can be flown [m/s].

    Limits of a steered reference: ``turn_rate`` [rad/s], for the nose goes round as the body does,
    and ``acceleration`` [m/s^2].
    """
    return min(_SHARE * turn_rate * orbit_radius, math.sqrt(_SHARE * acceleration * orbit_radius))


def on_orbit(orbit: Orbit, p: Vec3) -> MotionSetpoint:
    """Setpoint of a reference at p [m, NED]: the nearest point of the circle, moving along it.

    On the circle its velocity is the tangent's; off it the correction of
    ``generator.step`` leads there. It depends on the place alone, so it can be followed
    over a horizon.
    """
    dx, dy = p[0] - orbit.centre[0], p[1] - orbit.centre[1]
    distance = math.hypot(dx, dy)
    nx, ny = (dx / distance, dy / distance) if distance > _AT_CENTRE else (-1.0, 0.0)
    nearest = (orbit.centre[0] + orbit.radius * nx, orbit.centre[1] + orbit.radius * ny)
    sense = 1.0 if orbit.clockwise else -1.0  # clockwise from above turns north to east
    v = (-sense * orbit.speed * ny, sense * orbit.speed * nx, 0.0)
    target = (*nearest, orbit.centre[2])
    if orbit.facing is Facing.TANGENT:
        rate = sense * orbit.speed / orbit.radius
        return MotionSetpoint(False, target, v, yaw=math.atan2(v[1], v[0]), yaw_rate=rate)
    return MotionSetpoint(False, target, v)


def looking_at(motion: MotionSetpoint, place: Vec3, p: Vec3, v: Vec3) -> MotionSetpoint:
    """A motion with the heading towards ``place`` [m, NED].

    It is seen from the point ``p`` [m, NED], which moves at ``v`` [m/s, NED].
    """
    dx, dy = place[0] - p[0], place[1] - p[1]
    square = dx * dx + dy * dy
    if square < _NEAR * _NEAR:
        return motion  # over the place itself the bearing means nothing
    return MotionSetpoint(
        motion.of_end_effector,
        motion.p,
        motion.v,
        motion.a,
        yaw=math.atan2(dy, dx),
        yaw_rate=(dy * v[0] - dx * v[1]) / square,
        along_heading=motion.along_heading,
    )


_NEAR = 0.3  # m
