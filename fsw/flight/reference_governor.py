"""The one limiter of references: no reference leads the vehicle out of its safe set.

The planner's barriers keep the vehicle inside for any reference, at a penalty that a reference
far outside could outbid. So every reference passes here, by its origin:

============================  =====================================================
reference                     limits
============================  =====================================================
of the vehicle's own: a       ``limit_setpoint``: near the vehicle, off every wall and the ground,
setpoint that is generated    and towards either no faster than the barrier lets it stop
from outside: streamed        ``limit_horizon``: near the vehicle's own motion, not far behind a
targets, mission, setpoints   wall and not fast towards one
a place of a mission          ``project``: the nearest place inside
============================  =====================================================

Source: docs/decisions/0010-setpoints-through-the-planner.md.
"""

from __future__ import annotations

import math
from dataclasses import replace

from fsw.barriers.safe_approach import safe_approach_speed
from fsw.barriers.tangent import planes, tangent
from fsw.geometry.vectors import add_scaled, dot, norm, subtract
from fsw.parameters.flight_config import FlightConfig
from fsw.signals import EndEffectorTarget, SafeSet, Vec3, Wall

SETTLE_RATE = 2.0  # 1/s, of the last bit of the way
_GROUND_BRAKING = 1.0  # m/s^2
_CLEAR_OF_GROUND = 0.1  # m
_CREEP = 0.05  # m/s along the ground
_MAX_LEAD_DISTANCE = 0.4  # m from where the end-effector's motion leads to the target, now
_LEAD_GROWTH = 0.4  # m/s, by which that grows over the horizon
_MAX_VELOCITY_ERROR = 1.0  # m/s; more makes the planned arm wind up
_MAX_DEPTH = 0.1  # m behind the clearance; the paper's path goes 0.03 m deep
_ALWAYS = 0.5  # m/s towards a wall, half of what the penalty of a row stands
_PROJECTIONS = 30  # one after the other; in a corner they have to settle
_TOLERANCE = 1e-4  # m


def limit_lead(p: Vec3, vehicle: Vec3, max_lead_distance: float) -> Vec3:
    """``p`` [m, NED] brought to within ``max_lead_distance`` [m] of ``vehicle`` [m, NED]."""
    away = subtract(p, vehicle)
    length = norm(away)
    return (
        p if length <= max_lead_distance else add_scaled(vehicle, away, max_lead_distance / length)
    )


def limit_approach(
    p: Vec3, v: Vec3, other_end: Vec3, safe_set: SafeSet, braking: float, slope: float
) -> tuple[Vec3, Vec3]:
    """``p`` [m, NED] off every wall and obstacle, and its ``v`` [m/s, NED] such that it can stop.

    The arm's ``other_end`` [m, NED], as seen from the point, stays out as well. The barrier counts
    on a deceleration ``braking`` [m/s^2] and the ``slope`` [1/s] of S at the boundary. A sphere
    rides on the reference and needs nothing.
    """
    for wall in safe_set.walls:
        reach = min(0.0, dot(wall.normal, other_end))
        p, v = _off(wall, reach, p, v, braking, slope)
    for obstacle in safe_set.obstacles:
        for end in ((0.0, 0.0, 0.0), other_end):
            wall = tangent(obstacle, add_scaled(p, end, 1.0))
            p, v = _off(wall, dot(wall.normal, end), p, v, braking, slope)
    return p, v


def _off(
    wall: Wall, reach: float, p: Vec3, v: Vec3, braking: float, slope: float
) -> tuple[Vec3, Vec3]:
    """A point that something reaches out from along the normal [m], off one wall."""
    n = wall.normal
    distance = dot(n, p) + reach - wall.offset - wall.clearance
    if distance < 0.0:
        p = add_scaled(p, n, -distance)
    return p, _slowed(v, n, safe_approach_speed(max(distance, 0.0), braking, slope))


def _slowed(v: Vec3, n: Vec3, most: float) -> Vec3:
    """A velocity that approaches against a normal no faster than ``most``."""
    approach = -dot(n, v)
    return add_scaled(v, n, approach - most) if approach > most else v


def limit_descent(p: Vec3, v: Vec3, body_height: float, touch_speed: float) -> tuple[Vec3, Vec3]:
    """``p`` [m, NED], ``v`` [m/s, NED] no faster down than a landing, and hardly along the ground.

    The point asks for the body at ``body_height`` [m] above where it stands; at the ground it may
    move down at ``touch_speed`` [m/s], 0 where it is not to land.
    """
    (x, y, z), (vx, vy, vz) = p, v
    if touch_speed == 0.0 and body_height < _CLEAR_OF_GROUND:
        z -= _CLEAR_OF_GROUND - body_height
    room = max(body_height - (0.0 if touch_speed > 0.0 else _CLEAR_OF_GROUND), 0.0)
    most = safe_approach_speed(room, _GROUND_BRAKING, SETTLE_RATE)
    vz = min(vz, max(most, touch_speed))
    level = math.hypot(vx, vy)
    if level > most + _CREEP:
        vx, vy = vx * (most + _CREEP) / level, vy * (most + _CREEP) / level
    return (x, y, z), (vx, vy, vz)


def limit_reference(
    targets: tuple[EndEffectorTarget, ...],
    p_WE: Vec3,
    v_WE: Vec3,
    safe_set: SafeSet,
    braking: float,
    slope: float,
) -> tuple[EndEffectorTarget, ...]:
    """The targets of a horizon, the same object where nothing had to be limited.

    What is asked for near the motion of the end-effector, ``p_WE`` [m] and ``v_WE`` [m/s], and not
    far behind a wall passes as it is: the paper's own path enters the safety zone. The barrier
    counts on a deceleration ``braking`` [m/s^2] and the ``slope`` [1/s] of S at the boundary.
    """
    begin_us, limited = targets[0].t_us, []
    approached = [
        (wall.normal, _fastest(wall, p_WE, braking, slope)) for wall in planes(safe_set, p_WE)
    ]
    for target in targets:
        ahead = 1e-6 * (target.t_us - begin_us)
        led = add_scaled(p_WE, v_WE, ahead)
        p = limit_lead(target.p_WE, led, _MAX_LEAD_DISTANCE + _LEAD_GROWTH * ahead)
        v = limit_lead(target.v_WE, v_WE, _MAX_VELOCITY_ERROR)
        for wall in planes(safe_set, p):
            depth = wall.offset + wall.clearance - dot(wall.normal, p)
            if depth > _MAX_DEPTH:
                p = add_scaled(p, wall.normal, depth - _MAX_DEPTH)
        for n, most in approached:
            v = _slowed(v, n, most)
        limited.append(EndEffectorTarget(target.t_us, p, v, target.a_WE, target.yaw))
    result = tuple(limited)
    return targets if result == targets else result


def _fastest(wall: Wall, p_WE: Vec3, braking: float, slope: float) -> float:
    """How fast to approach a wall [m/s]."""
    room = max(dot(wall.normal, p_WE) - (wall.offset + wall.clearance), 0.0)
    return max(safe_approach_speed(room, braking, slope), _ALWAYS)


def project_to_safe_set(p: Vec3, safe_set: SafeSet) -> Vec3:
    """``p`` [m, NED], or a point near it that keeps every wall's and obstacle's clearance."""
    for _ in range(_PROJECTIONS):
        moved = p
        for wall in planes(safe_set, p):
            lacking = wall.offset + wall.clearance - dot(wall.normal, p)
            if lacking > _TOLERANCE:
                p = add_scaled(p, wall.normal, lacking)
        if p is moved:
            break
    return p


def project(target: EndEffectorTarget, safe_set: SafeSet) -> EndEffectorTarget:
    """The target, or at rest at the boundary where it is beyond a wall or near an obstacle."""
    p = project_to_safe_set(target.p_WE, safe_set)
    if p is target.p_WE:
        return target
    rest = (0.0, 0.0, 0.0)
    return replace(target, p_WE=p, v_WE=rest, a_WE=rest)


class ReferenceGovernor:
    """The limits of one configuration."""

    def __init__(self, config: FlightConfig) -> None:
        self._config = config
        self._max_lead_distance = config.steering.max_lead_distance
        self._barrier = config.planner.walls

    def limit_setpoint(
        self, p: Vec3, v: Vec3, *, other_end: Vec3, of_end_effector: bool, safe_set: SafeSet
    ) -> tuple[Vec3, Vec3]:
        """A generated setpoint ``p`` [m, NED], ``v`` [m/s, NED] off the ground and off every wall.

        ``other_end`` [m, NED] of the arm is seen from it.
        """
        body_down = p[2] + (other_end[2] if of_end_effector else 0.0)
        touch_speed = 0.0 if of_end_effector else self._config.limits.land_speed
        height = -body_down - self._config.airframe.leg_length
        p, v = limit_descent(p, v, height, touch_speed)
        if not (safe_set.walls or safe_set.obstacles):
            return p, v
        return limit_approach(p, v, other_end, safe_set, self._barrier.alpha, self._barrier.slope)

    def limit_lead(self, p: Vec3, vehicle: Vec3) -> Vec3:
        """``p`` [m, NED] within reach of the vehicle's own point ``vehicle`` [m, NED]."""
        return limit_lead(p, vehicle, self._max_lead_distance)

    def limit_horizon(
        self, targets: tuple[EndEffectorTarget, ...], p_WE: Vec3, v_WE: Vec3, safe_set: SafeSet
    ) -> tuple[EndEffectorTarget, ...]:
        """See ``limit_reference``; the end-effector is at ``p_WE`` [m] and moves at v_WE [m/s]."""
        barrier = self._barrier
        return limit_reference(targets, p_WE, v_WE, safe_set, barrier.alpha, barrier.slope)
