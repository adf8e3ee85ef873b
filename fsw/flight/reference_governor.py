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
from collections.abc import Callable
from dataclasses import replace
from functools import cache, lru_cache

from fsw.barriers.safe_approach import BarrierTuning, safe_approach_speed
from fsw.compiled import compilable, kernel, machine_code
from fsw.geometry.vectors import add_scaled, dot, norm, subtract
from fsw.model.body import Body, body_of, hull_reach
from fsw.parameters.flight_config import FlightConfig
from fsw.shapes.kind import Surface
from fsw.shapes.zones import NO_ZONES, Array, moving_zones, nearest_plane, surface
from fsw.signals import EndEffectorTarget, SafeSet, Vec3

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
_HERE: Vec3 = (0.0, 0.0, 0.0)


@compilable
def limit_lead(p: Vec3, vehicle: Vec3, max_lead_distance: float) -> Vec3:
    """``p`` [m, NED] brought to within ``max_lead_distance`` [m] of ``vehicle`` [m, NED]."""
    away = subtract(p, vehicle)
    length = norm(away)
    return (
        p if length <= max_lead_distance else add_scaled(vehicle, away, max_lead_distance / length)
    )


def limit_approach(
    p: Vec3,
    v: Vec3,
    ends: tuple[tuple[Vec3, Body | None], ...],
    safe_set: SafeSet,
    t_us: int,
    barrier: BarrierTuning,
) -> tuple[Vec3, Vec3]:
    """``p`` [m, NED] off every zone, and its ``v`` [m/s, NED] such that it can stop.

    Both ``ends`` of the arm [m, NED], as seen from the point, stay out as well, one of them with
    the body around it. A sphere rides on the reference and needs nothing.
    """
    for zone in range(len(safe_set.zones)):
        for end, body in ends:
            at = surface(safe_set, zone, add_scaled(p, end, 1.0), t_us)
            if at is None:
                continue
            n = at.normal
            distance = at.distance - (0.0 if body is None else hull_reach(body, n))
            if distance < 0.0:
                p = add_scaled(p, n, -distance)
            room = max(distance, 0.0)
            v = _slowed(v, n, safe_approach_speed(room, barrier.alpha, barrier.slope))
    return p, v


@compilable
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
    barrier: BarrierTuning,
) -> tuple[EndEffectorTarget, ...]:
    """The targets of a horizon, the same object where nothing had to be limited.

    What is asked for near the motion of the end-effector, ``p_WE`` [m] and ``v_WE`` [m/s], and not
    far behind a wall passes as it is: the paper's own path enters the safety zone.
    """
    zones, begin_us, limited = _moving_zones(safe_set), targets[0].t_us, []
    for target in targets:
        p, v = _limit_target()(
            *(zones, begin_us, target.t_us, target.p_WE, target.v_WE),
            *(p_WE, v_WE, barrier.alpha, barrier.slope),
        )
        limited.append(EndEffectorTarget(target.t_us, p, v, target.a_WE, target.yaw))
    result = tuple(limited)
    return targets if result == targets else result


@kernel
def _limited(
    zones: Array,
    begin_us: int,
    t_us: int,
    p: Vec3,
    v: Vec3,
    p_WE: Vec3,
    v_WE: Vec3,
    alpha: float,
    slope: float,
) -> tuple[Vec3, Vec3]:
    """``limit_reference`` for place and velocity of one target, of ``t_us``."""
    ahead = 1e-6 * (t_us - begin_us)
    led = add_scaled(p_WE, v_WE, ahead)
    p = limit_lead(p, led, _MAX_LEAD_DISTANCE + _LEAD_GROWTH * ahead)
    v = limit_lead(v, v_WE, _MAX_VELOCITY_ERROR)
    for zone in range(len(zones)):
        at = nearest_plane(zones, zone, p, t_us)
        if -at.distance > _MAX_DEPTH:
            p = add_scaled(p, (at.nx, at.ny, at.nz), -at.distance - _MAX_DEPTH)
    for zone in range(len(zones)):
        at = nearest_plane(zones, zone, p_WE, begin_us)
        v = _slowed(v, (at.nx, at.ny, at.nz), _fastest(at, alpha, slope))
    return p, v


@cache
def _limit_target() -> Callable[..., tuple[Vec3, Vec3]]:
    """``_limited``, compiled when it is first wanted."""
    return machine_code(_limited, NO_ZONES, 0, 0, _HERE, _HERE, _HERE, _HERE, 1.0, 1.0)


@lru_cache(maxsize=16)
def _moving_zones(safe_set: SafeSet) -> Array:
    """The zones that a reference keeps off: a sphere rides on it."""
    return moving_zones(safe_set, None)


@compilable
def _fastest(at: Surface, alpha: float, slope: float) -> float:
    """How fast to approach a zone [m/s]."""
    return max(safe_approach_speed(max(at.distance, 0.0), alpha, slope), _ALWAYS)


def project_to_safe_set(p: Vec3, safe_set: SafeSet, t_us: int) -> Vec3:
    """``p`` [m, NED], or a point near it that keeps the clearance of every zone at a time."""
    for _ in range(_PROJECTIONS):
        moved = p
        for zone in range(len(safe_set.zones)):
            at = surface(safe_set, zone, p, t_us)
            if at is not None and -at.distance > _TOLERANCE:
                p = add_scaled(p, at.normal, -at.distance)
        if p is moved:
            break
    return p


def project(target: EndEffectorTarget, safe_set: SafeSet) -> EndEffectorTarget:
    """The target, or at rest at the boundary where it is beyond a wall or near an obstacle."""
    p = project_to_safe_set(target.p_WE, safe_set, target.t_us)
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
        self._body = body_of(config.planner.body, config.airframe)

    def limit_setpoint(
        self,
        p: Vec3,
        v: Vec3,
        *,
        other_end: Vec3,
        of_end_effector: bool,
        safe_set: SafeSet,
        t_us: int,
    ) -> tuple[Vec3, Vec3]:
        """A generated setpoint ``p`` [m, NED], ``v`` [m/s, NED] off the ground and off every zone.

        ``other_end`` [m, NED] of the arm is seen from it.
        """
        body_down = p[2] + (other_end[2] if of_end_effector else 0.0)
        touch_speed = 0.0 if of_end_effector else self._config.limits.land_speed
        height = -body_down - self._config.airframe.leg_length
        p, v = limit_descent(p, v, height, touch_speed)
        body, tip = (other_end, _HERE) if of_end_effector else (_HERE, other_end)
        return limit_approach(
            p, v, ((body, self._body), (tip, None)), safe_set, t_us, self._barrier
        )

    def limit_lead(self, p: Vec3, vehicle: Vec3) -> Vec3:
        """``p`` [m, NED] within reach of the vehicle's own point ``vehicle`` [m, NED]."""
        return limit_lead(p, vehicle, self._max_lead_distance)

    def limit_horizon(
        self, targets: tuple[EndEffectorTarget, ...], p_WE: Vec3, v_WE: Vec3, safe_set: SafeSet
    ) -> tuple[EndEffectorTarget, ...]:
        """See ``limit_reference``; the end-effector is at ``p_WE`` [m] and moves at v_WE [m/s]."""
        return limit_reference(targets, p_WE, v_WE, safe_set, self._barrier)
