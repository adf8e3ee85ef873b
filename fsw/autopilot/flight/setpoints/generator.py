r"""Setpoint generator: a setpoint that moves as the vehicle can, towards a goal.

A goal (a place, a velocity, an acceleration, a circle) may change to anything, at any time,
and on the far side of a wall. The planner tracks a point, of the body or of the end-effector, that
runs ahead of the vehicle within limits:

.. math:: v \to v_{ff} + S(|e|)\,\frac{e}{|e|}, \qquad |\dot v| \le a, \qquad |v| \le v_{max}

towards a place, with the barrier's own :math:`S` so that it can stop there. The reference governor
keeps it near the vehicle and off walls and ground. Source: decision 0010 in docs/decisions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fsw.autopilot.barriers.safe_approach import safe_approach_speed
from fsw.autopilot.flight.setpoints.offboard_setpoint import finite_or_zero, turn_level
from fsw.autopilot.flight.setpoints.reference_governor import (
    SETTLE_RATE,
    ReferenceGovernor,
    limit_lead,
)
from fsw.autopilot.geometry.rotation import wrap_angle
from fsw.autopilot.geometry.vectors import add_scaled, clamp_magnitude, limit_norm, norm, subtract
from fsw.autopilot.model.kinematics import end_effector, end_effector_when_level
from fsw.autopilot.parameters.flight_config import FlightConfig, SetpointLimits
from fsw.autopilot.signals import (
    EndEffectorTarget,
    Facing,
    JointVector,
    MotionSetpoint,
    Orbit,
    SafeSet,
    StateEstimate,
    Vec3,
)
from fsw.frozen import replace

_BRAKING_SHARE = 0.7  # of the acceleration; the rest is what stepping costs
_ARRIVED = 0.02  # m
_AT_REST = 0.05  # m/s
_AT_CENTRE = 0.01  # m; nearer the centre any point of a circle is as good
_SHARE = 0.8  # of a limit; the rest corrects what is off
_NEAR = 0.3  # m from a place that is looked at, in which its bearing means nothing
_OPEN: Vec3 = (math.nan, math.nan, math.nan)


@dataclass(frozen=True, slots=True)
class ReferenceState:
    """The point that runs ahead: the body's origin or the end-effector."""

    of_end_effector: bool
    p: Vec3  # m
    v: Vec3  # m/s
    yaw: float  # rad
    yaw_rate: float = 0.0  # rad/s
    q_arm: JointVector | None = None  # rad, joints to hold; None leaves them to the planner


@dataclass(frozen=True, slots=True)
class PositionGoal:
    """The goal of the point."""

    motion: MotionSetpoint
    joints: JointVector | None = None  # rad
    speed: float | None = None  # m/s, towards a place; None: as usual
    orbit: Orbit | None = None  # in place of the motion
    look_at: Vec3 | None = None  # m, where the nose points in place of the motion's heading


def step(
    reference: ReferenceState, goal: PositionGoal, limits: SetpointLimits, dt: float
) -> ReferenceState:
    """The point ``dt`` [s] later, as if there were neither vehicle nor walls.

    Point and goal are both of the body or both of the end-effector.
    """
    motion = _motion_now(reference, goal)
    p, v = _move_point(reference, motion, goal, limits, dt)
    yaw, yaw_rate = _turn(reference, motion, limits, dt)
    q_arm = reference.q_arm
    if q_arm is not None and goal.joints is not None:
        most = limits.joint_speed * dt
        pairs = zip(q_arm, goal.joints, strict=True)
        q_arm = tuple([now + clamp_magnitude(wanted - now, most) for now, wanted in pairs])
    return replace(reference, p=p, v=v, yaw=yaw, yaw_rate=yaw_rate, q_arm=q_arm)


def arrived(reference: ReferenceState, place: Vec3) -> bool:
    """Whether the point rests at ``place`` [m, NED]."""
    return norm(subtract(place, reference.p)) < _ARRIVED and norm(reference.v) < _AT_REST


class SetpointGenerator:
    """Makes the setpoints of one configuration."""

    def __init__(self, config: FlightConfig) -> None:
        self._config = config
        self._governor = ReferenceGovernor(config)

    def begin(self, estimate: StateEstimate, *, of_end_effector: bool = False) -> ReferenceState:
        """A point that begins where the vehicle is and moves as it does."""
        if of_end_effector:
            p, v = end_effector(self._config.airframe.bodies, estimate)
            return ReferenceState(True, p, v, estimate.yaw)
        return ReferenceState(
            of_end_effector=False,
            p=estimate.p_WB,
            v=estimate.v_WB,
            yaw=estimate.yaw,
            yaw_rate=0.0,
            q_arm=estimate.q_arm,
        )

    def advance(
        self,
        reference: ReferenceState,
        goal: PositionGoal,
        estimate: StateEstimate,
        safe_set: SafeSet,
    ) -> ReferenceState:
        """The point one planning period later."""
        config = self._config
        moved = step(reference, goal, config.steering, config.planner.period)
        if reference.of_end_effector:
            vehicle = end_effector(config.airframe.bodies, estimate)[0]
        else:
            vehicle = estimate.p_WB
        p = limit_lead(moved.p, vehicle, config.steering.max_lead_distance)
        return self._limited(replace(moved, p=p), estimate, safe_set, estimate.t_us)

    def horizon(
        self,
        reference: ReferenceState,
        goal: PositionGoal,
        estimate: StateEstimate,
        safe_set: SafeSet,
        t_us: int,
    ) -> tuple[tuple[EndEffectorTarget, ...], tuple[JointVector, ...]]:
        """Targets and joints at the nodes, the first at ``t_us``; joints only if some are asked."""
        config, targets, joint_targets = self._config, [], []
        for node in range(config.planner.horizon + 1):
            at_us = t_us + node * config.mpc_period_us
            if node > 0:
                reference = step(reference, goal, config.steering, config.planner.period)
                reference = self._limited(reference, estimate, safe_set, at_us)
            target = self.target(reference, at_us)
            # The planner looks ahead at the vehicle's yaw rate, so it has to see where ours leads.
            ahead = config.planner.weights.yaw_lead * reference.yaw_rate
            targets.append(replace(target, yaw=wrap_angle(target.yaw + ahead)))
            if reference.q_arm is not None:
                joint_targets.append(reference.q_arm)
        return tuple(targets), tuple(joint_targets)

    def target(self, reference: ReferenceState, t_us: int) -> EndEffectorTarget:
        """The end-effector's target where a setpoint is for the body or the end-effector."""
        p, v, w = reference.p, reference.v, reference.yaw_rate
        if reference.of_end_effector or reference.q_arm is None:
            return EndEffectorTarget(t_us, p, v, (0.0, 0.0, 0.0), reference.yaw)
        x, y, z = self._hanging(reference.q_arm, reference.yaw)
        return EndEffectorTarget(
            t_us,
            (p[0] + x, p[1] + y, p[2] + z),
            (v[0] - w * y, v[1] + w * x, v[2]),
            (0.0, 0.0, 0.0),
            reference.yaw,
        )

    def _limited(
        self, reference: ReferenceState, estimate: StateEstimate, safe_set: SafeSet, t_us: int
    ) -> ReferenceState:
        x, y, z = self._hanging(reference.q_arm or estimate.q_arm, reference.yaw)
        p, v = self._governor.limit_setpoint(
            reference.p,
            reference.v,
            other_end=(-x, -y, -z) if reference.of_end_effector else (x, y, z),
            of_end_effector=reference.of_end_effector,
            safe_set=safe_set,
            t_us=t_us,
        )
        return replace(reference, p=p, v=v)

    def _hanging(self, q_arm: JointVector, yaw: float) -> Vec3:
        """From the body to the end-effector while level [m]."""
        return end_effector_when_level(self._config.airframe.bodies, q_arm, yaw)


def _motion_now(reference: ReferenceState, goal: PositionGoal) -> MotionSetpoint:
    """The goal at the point's current position."""
    motion, look_at = goal.motion, goal.look_at
    if goal.orbit is not None:
        motion = on_orbit(goal.orbit, reference.p)
        if goal.orbit.facing is Facing.INITIAL:
            motion = replace(motion, yaw=goal.motion.yaw)
        elif goal.orbit.facing is Facing.CENTRE and look_at is None:
            look_at = goal.orbit.centre
    return motion if look_at is None else looking_at(motion, look_at, reference.p, reference.v)


def max_orbit_speed(orbit_radius: float, turn_rate: float, acceleration: float) -> float:
    """How fast a circle of ``orbit_radius`` [m] can be flown [m/s].

    Limits of a steered reference: ``turn_rate`` [rad/s], for the nose goes round as the body does,
    and ``acceleration`` [m/s^2].
    """
    return min(_SHARE * turn_rate * orbit_radius, math.sqrt(_SHARE * acceleration * orbit_radius))


def on_orbit(orbit: Orbit, p: Vec3) -> MotionSetpoint:
    """Setpoint of a reference at p [m, NED]: the nearest point of the circle, moving along it.

    On the circle its velocity is the tangent's; off it the correction of
    ``step`` leads there. It depends on the place alone, so it can be followed
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


def _move_point(
    reference: ReferenceState,
    motion: MotionSetpoint,
    goal: PositionGoal,
    limits: SetpointLimits,
    dt: float,
) -> tuple[Vec3, Vec3]:
    braking, most = _BRAKING_SHARE * limits.acceleration, limits.speed
    wanted = _velocity_asked(reference, motion, dt)
    if motion.p is not None:
        error = finite_or_zero(subtract(motion.p, reference.p))
        distance = norm(error)
        if distance > 0.0:
            cruise = min(goal.speed or limits.cruise_speed, limits.speed)
            if goal.orbit is not None:  # on the way to a circle too
                most = max(cruise, goal.orbit.speed)
            closing = min(safe_approach_speed(distance, braking, SETTLE_RATE), cruise)
            wanted = add_scaled(wanted, error, closing / distance)
    wanted = limit_norm(wanted, most)
    change = limit_norm(subtract(wanted, reference.v), limits.acceleration * dt)
    v = add_scaled(reference.v, change, 1.0)
    mean = add_scaled(reference.v, change, 0.5)
    return add_scaled(reference.p, mean, dt), v


def _velocity_asked(reference: ReferenceState, motion: MotionSetpoint, dt: float) -> Vec3:
    """The velocity of each axis [m/s]: given; else 0 towards a place, or as accelerated."""
    p, v, a = (vector or _OPEN for vector in (motion.p, motion.v, motion.a))
    if motion.along_heading:
        v, a = turn_level(v, reference.yaw), turn_level(a, reference.yaw)
    grown = finite_or_zero(add_scaled(reference.v, a, dt))
    x, y, z = (
        (grown[k] if math.isnan(p[k]) else 0.0) if math.isnan(v[k]) else v[k] for k in range(3)
    )
    return x, y, z


def _turn(
    reference: ReferenceState, motion: MotionSetpoint, limits: SetpointLimits, dt: float
) -> tuple[float, float]:
    wanted = 0.0
    if motion.yaw_rate is not None:
        wanted = clamp_magnitude(motion.yaw_rate, limits.yaw_rate)
    if motion.yaw is not None:
        error = wrap_angle(motion.yaw - reference.yaw)
        braking = _BRAKING_SHARE * limits.yaw_acceleration
        closing = min(safe_approach_speed(abs(error), braking, 0.5), limits.yaw_rate)
        wanted = clamp_magnitude(wanted + math.copysign(closing, error), limits.yaw_rate)
    change = clamp_magnitude(wanted - reference.yaw_rate, limits.yaw_acceleration * dt)
    yaw = wrap_angle(reference.yaw + dt * (reference.yaw_rate + 0.5 * change))
    return yaw, reference.yaw_rate + change
