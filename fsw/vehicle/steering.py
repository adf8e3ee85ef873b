r"""A reference that a ground station steers: it runs ahead of the vehicle within limits.

What is asked for (a place, a velocity, an acceleration) may be anything, at any moment, and on
the far side of a wall. The planner tracks a point that moves as the vehicle can:

.. math:: v \to v_{ff} + S(|e|)\,\frac{e}{|e|}, \qquad |\dot v| \le a, \qquad |v| \le v_{max}

towards a place, with the barrier's own :math:`S` so that it can stop there. The point stays
within a leash of the vehicle and out of the walls, and nears a wall no faster than S: an error
that could outweigh the barrier's slack penalty never reaches the planner. The barrier
itself is the planner's and stays as it is (docs/decisions/0010-steering-through-the-planner.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from fsw.barriers.safe_approach import safe_approach_speed
from fsw.barriers.tangent import tangent
from fsw.geometry.rotation import wrap_angle
from fsw.signals import Facing, MotionSetpoint, Orbit, SafeSet, Vec2, Vec3, Wall
from fsw.vehicle.orbit import looking_at, on_orbit

_SETTLE_RATE = 2.0  # 1/s, of the last bit of the way
_GROUND_BRAKING = 1.0  # m/s^2
_CLEAR_OF_GROUND = 0.1  # m
_CREEP = 0.05  # m/s along the ground
_BRAKING_SHARE = 0.7  # of the acceleration; the rest is what stepping costs


@dataclass(frozen=True, slots=True)
class SteeringLimits:
    """How fast a steered reference moves."""

    cruise_speed: float = 1.0  # m/s, on the way to a place
    # Faster and harder, set-points that change every half second drove the fast loop into the
    # rotors' limits, and the vehicle off its plan.
    speed: float = 1.5  # m/s, at most
    acceleration: float = 1.0  # m/s^2
    yaw_rate: float = 0.3  # rad/s
    yaw_acceleration: float = 0.06  # rad/s^2; the plan's limit is 0.1
    joint_speed: float = 0.6  # rad/s
    leash: float = 0.3  # m, from the vehicle to the reference


@dataclass(frozen=True, slots=True)
class Lead:
    """The point that runs ahead: the body's origin or the end-effector."""

    of_end_effector: bool
    p: Vec3  # m
    v: Vec3  # m/s
    yaw: float  # rad
    yaw_rate: float = 0.0  # rad/s
    q_arm: Vec2 | None = None  # rad, joints to hold; None leaves them to the planner


@dataclass(frozen=True, slots=True)
class Aim:
    """What the point is after."""

    motion: MotionSetpoint
    joints: Vec2 | None = None  # rad
    speed: float | None = None  # m/s, towards a place; None: as usual
    orbit: Orbit | None = None  # in place of the motion
    look_at: Vec3 | None = None  # m, where the nose points in place of the motion's heading


def move(lead: Lead, aim: Aim, limits: SteeringLimits, dt: float) -> Lead:
    """The point a moment later, as if there were neither vehicle nor walls.

    Args:
        lead: The point now.
        aim: What it is after; the kinds of point agree.
        limits: How fast it may move.
        dt: The moment [s].
    """
    motion = _motion_now(lead, aim)
    p, v = _move_point(lead, motion, aim, limits, dt)
    yaw, yaw_rate = _turn(lead, motion, limits, dt)
    q_arm = lead.q_arm
    if q_arm is not None and aim.joints is not None:
        step = limits.joint_speed * dt
        q_arm = (
            q_arm[0] + _clamp(aim.joints[0] - q_arm[0], step),
            q_arm[1] + _clamp(aim.joints[1] - q_arm[1], step),
        )
    return replace(lead, p=p, v=v, yaw=yaw, yaw_rate=yaw_rate, q_arm=q_arm)


def tie(lead: Lead, vehicle: Vec3, leash: float) -> Lead:
    """Bring the point back to within a leash of where the vehicle's own point is [m]."""
    away = _minus(lead.p, vehicle)
    length = _length(away)
    if length <= leash:
        return lead
    return replace(lead, p=_plus(vehicle, away, leash / length))


def keep_out(lead: Lead, below: Vec3, safe_set: SafeSet, braking: float, slope: float) -> Lead:
    """The point off every wall and obstacle, and no faster towards one than would let it stop.

    Args:
        lead: The point.
        below: From the point to the other end of the arm, which must stay out as well [m].
        safe_set: Walls and obstacles; a sphere rides on the reference and needs nothing.
        braking: Deceleration the barrier counts on [m/s^2].
        slope: Of S at the boundary [1/s].
    """
    p, v = lead.p, lead.v
    for wall in safe_set.walls:
        reach = min(0.0, _dot(wall.normal, below))
        p, v = _off(wall, reach, p, v, braking, slope)
    for obstacle in safe_set.obstacles:
        for end in ((0.0, 0.0, 0.0), below):
            wall = tangent(obstacle, _plus(p, end, 1.0))
            p, v = _off(wall, _dot(wall.normal, end), p, v, braking, slope)
    return lead if p is lead.p and v is lead.v else replace(lead, p=p, v=v)


def _off(
    wall: Wall, reach: float, p: Vec3, v: Vec3, braking: float, slope: float
) -> tuple[Vec3, Vec3]:
    """A point that something reaches out from along the normal [m], off one wall."""
    n = wall.normal
    distance = _dot(n, p) + reach - wall.offset - wall.clearance
    if distance < 0.0:
        p = _plus(p, n, -distance)
    approach = -_dot(n, v)
    most = safe_approach_speed(max(distance, 0.0), braking, slope)
    if approach > most:
        v = _plus(v, n, approach - most)
    return p, v


def keep_up(lead: Lead, body_height: float, touch_speed: float) -> Lead:
    """The point no faster towards the ground than a landing, and hardly along it.

    Args:
        lead: The point.
        body_height: Of the body above where it stands, as the point wants it [m].
        touch_speed: Downwards at the ground [m/s]; 0 where this point is not to land.
    """
    (x, y, z), (vx, vy, vz) = lead.p, lead.v
    if touch_speed == 0.0 and body_height < _CLEAR_OF_GROUND:
        z -= _CLEAR_OF_GROUND - body_height
    room = max(body_height - (0.0 if touch_speed > 0.0 else _CLEAR_OF_GROUND), 0.0)
    most = safe_approach_speed(room, _GROUND_BRAKING, _SETTLE_RATE)
    vz = min(vz, max(most, touch_speed))
    level = math.hypot(vx, vy)
    if level > most + _CREEP:
        vx, vy = vx * (most + _CREEP) / level, vy * (most + _CREEP) / level
    return replace(lead, p=(x, y, z), v=(vx, vy, vz))


def arrived(lead: Lead, place: Vec3) -> bool:
    """Whether the point rests at a place."""
    return _length(_minus(place, lead.p)) < 0.02 and _length(lead.v) < 0.05


def _motion_now(lead: Lead, aim: Aim) -> MotionSetpoint:
    """What the point is after where it is now."""
    motion, look_at = aim.motion, aim.look_at
    if aim.orbit is not None:
        motion = on_orbit(aim.orbit, lead.p)
        if aim.orbit.facing is Facing.INITIAL:
            motion = replace(motion, yaw=aim.motion.yaw)
        elif aim.orbit.facing is Facing.CENTRE and look_at is None:
            look_at = aim.orbit.centre
    return motion if look_at is None else looking_at(motion, look_at, lead.p, lead.v)


def _move_point(
    lead: Lead, motion: MotionSetpoint, aim: Aim, limits: SteeringLimits, dt: float
) -> tuple[Vec3, Vec3]:
    braking, most = _BRAKING_SHARE * limits.acceleration, limits.speed
    wanted = (0.0, 0.0, 0.0) if motion.v is None else motion.v
    if motion.along_heading:
        wanted = _level(wanted, lead.yaw)
    if motion.p is not None:
        error = _minus(motion.p, lead.p)
        distance = _length(error)
        if distance > 0.0:
            cruise = min(aim.speed or limits.cruise_speed, limits.speed)
            if aim.orbit is not None:  # on the way to a circle too
                most = max(cruise, aim.orbit.speed)
            closing = min(safe_approach_speed(distance, braking, _SETTLE_RATE), cruise)
            wanted = _plus(wanted, error, closing / distance)
    elif motion.v is None and motion.a is not None:
        a = _level(motion.a, lead.yaw) if motion.along_heading else motion.a
        wanted = _plus(lead.v, a, dt)
    wanted = _shortened(wanted, most)
    change = _shortened(_minus(wanted, lead.v), limits.acceleration * dt)
    v = _plus(lead.v, change, 1.0)
    mean = _plus(lead.v, change, 0.5)
    return _plus(lead.p, mean, dt), v


def _turn(
    lead: Lead, motion: MotionSetpoint, limits: SteeringLimits, dt: float
) -> tuple[float, float]:
    wanted = 0.0
    if motion.yaw_rate is not None:
        wanted = _clamp(motion.yaw_rate, limits.yaw_rate)
    if motion.yaw is not None:
        error = wrap_angle(motion.yaw - lead.yaw)
        braking = _BRAKING_SHARE * limits.yaw_acceleration
        closing = min(safe_approach_speed(abs(error), braking, 0.5), limits.yaw_rate)
        wanted = _clamp(wanted + math.copysign(closing, error), limits.yaw_rate)
    change = _clamp(wanted - lead.yaw_rate, limits.yaw_acceleration * dt)
    return wrap_angle(lead.yaw + dt * (lead.yaw_rate + 0.5 * change)), lead.yaw_rate + change


def _level(ahead: Vec3, yaw: float) -> Vec3:
    c, s = math.cos(yaw), math.sin(yaw)
    return c * ahead[0] - s * ahead[1], s * ahead[0] + c * ahead[1], ahead[2]


def _plus(a: Vec3, b: Vec3, share: float) -> Vec3:
    return a[0] + share * b[0], a[1] + share * b[1], a[2] + share * b[2]


def _minus(a: Vec3, b: Vec3) -> Vec3:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _dot(a: Vec3, b: Vec3) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _length(a: Vec3) -> float:
    return math.sqrt(_dot(a, a))


def _shortened(a: Vec3, most: float) -> Vec3:
    length = _length(a)
    return a if length <= most else _plus((0.0, 0.0, 0.0), a, most / length)


def _clamp(value: float, bound: float) -> float:
    return min(max(value, -bound), bound)
