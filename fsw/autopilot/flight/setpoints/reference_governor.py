"""The one limiter of references: no reference leads the vehicle out of its safe set.

The planner's barriers keep the vehicle inside for any reference, at a penalty that a reference
far outside could outbid. So every reference passes here, by its origin:

============================  =====================================================
reference                     limits
============================  =====================================================
of the vehicle's own: a       ``limit_setpoint``: near the vehicle, off every wall and the ground,
setpoint that is generated    and towards either no faster than the barrier lets it stop
from outside: streamed        ``limit_horizon``: near the vehicle's own motion, not far behind a
targets, mission, setpoints   wall and not fast towards one; streamed targets and missions no
                              faster than a setpoint, between the lowest and the highest height
a place of a mission          ``project``: the nearest place inside
a takeoff's, a landing's      ``max_lead``: waits for a vehicle that is held up
============================  =====================================================

Source: docs/decisions/0010-setpoints-through-the-planner.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

from fsw.autopilot.barriers.safe_approach import BarrierTuning, safe_approach_speed
from fsw.autopilot.flight.setpoints.offboard_setpoint import finite_or_zero
from fsw.autopilot.geometry.vectors import add_scaled, dot, limit_norm, norm, subtract
from fsw.autopilot.model.body import NO_HULL, Hull, hull_of, hull_reach_at
from fsw.autopilot.parameters.flight_config import FlightConfig, lowest_height
from fsw.autopilot.shapes.kind import Surface
from fsw.autopilot.shapes.zones import FORCE_MAX, NO_ZONES, Array, moving_zones, nearest_plane
from fsw.autopilot.signals import EndEffectorTarget, MotionSetpoint, SafeSet, Vec3
from fsw.compiled import compilable, kernel, machine_code
from fsw.frozen import Remembered, replace

SETTLE_RATE = 2.0  # 1/s, of the last bit of the way
_GROUND_BRAKING = 1.0  # m/s^2
_CLEAR_OF_GROUND = 0.1  # m
_CREEP = 0.05  # m/s along the ground
_MAX_LEAD_DISTANCE = 0.4  # m from where the end-effector's motion leads to the target, now
_LEAD_GROWTH = 0.4  # m/s, by which that grows over the horizon
_MAX_VELOCITY_ERROR = 1.0  # m/s; more makes the planned arm wind up
_MAX_DEPTH = 0.1  # m behind the clearance; the paper's path goes 0.03 m deep
_NEAR = 0.1  # m, that a reference may be ahead of a vehicle at the largest speed
_LAG = 0.3  # s, that a vehicle may be behind what moves on; it takes off 0.22 s behind
_ALWAYS = 0.5  # m/s towards a wall, half of what the penalty of a row stands
_PROJECTIONS = 30  # one after the other; in a corner they have to settle
_TOLERANCE = 1e-4  # m
_HERE: Vec3 = (0.0, 0.0, 0.0)
_LOW, _HIGH, _FAST, _FAR = 1, 2, 4, 8  # which limits a target has left
_AWAY = 1.0  # m from the end-effector; what a vehicle falls behind while it makes way is less
_TOLD = 1e-3  # m, m/s; less is rounding

Limits = tuple[float, float, float]
"""Lowest and highest z of the end-effector [m, NED], largest speed [m/s] of a reference."""
UNLIMITED: Limits = (math.inf, -math.inf, math.inf)


@compilable
def limit_lead(p: Vec3, vehicle: Vec3, max_lead_distance: float) -> Vec3:
    """``p`` [m, NED] brought to within ``max_lead_distance`` [m] of ``vehicle`` [m, NED]."""
    away = subtract(p, vehicle)
    length = norm(away)
    return (
        p if length <= max_lead_distance else add_scaled(vehicle, away, max_lead_distance / length)
    )


@compilable
def lead_at(v: Vec3, fastest: float) -> float:
    """How far [m] a reference may lead a vehicle at ``v`` [m/s, NED], of ``fastest`` [m/s].

    One that is led by as much at any speed would be led to any speed.
    """
    return max(_MAX_LEAD_DISTANCE * max(1.0 - norm(v) / fastest, 0.0), _NEAR)


def max_lead(speed: float) -> float:
    """How far [m] what moves at a ``speed`` [m/s] may lead the vehicle before it waits for it."""
    return _NEAR + _LAG * speed


@kernel
def _approached(
    zones: Array,
    t_us: int,
    p: Vec3,
    v: Vec3,
    ends: tuple[Vec3, Vec3],
    hulls: tuple[Hull, Hull],
    alpha: float,
    slope: float,
) -> tuple[Vec3, Vec3]:
    for zone in range(len(zones)):
        for k in range(2):
            at = nearest_plane(zones, zone, add_scaled(p, ends[k], 1.0), t_us)
            n = (at.nx, at.ny, at.nz)
            distance = at.distance - hull_reach_at(hulls[k], n)
            if distance < 0.0:
                p = add_scaled(p, n, -distance)
            v = _slowed(v, n, safe_approach_speed(max(distance, 0.0), alpha, slope))
    return p, v


def limit_approach(
    p: Vec3,
    v: Vec3,
    ends: tuple[Vec3, Vec3],
    hulls: tuple[Hull, Hull],
    safe_set: SafeSet,
    t_us: int,
    barrier: BarrierTuning,
) -> tuple[Vec3, Vec3]:
    """``p`` [m, NED] off every zone, and its ``v`` [m/s, NED] such that it can stop.

    Both ``ends`` of the arm [m, NED], as seen from the point, stay out as well, with the ``hulls``
    (places, 3) [m] around them. A sphere rides on the reference and needs nothing.
    """
    zones, tuning = _moving_zones(safe_set), (barrier.alpha, barrier.slope)
    return _approach()(zones, t_us, p, v, ends, hulls, *tuning)


@cache
def _approach() -> Callable[..., tuple[Vec3, Vec3]]:
    """``_approached``, compiled when it is first wanted."""
    ends, hulls = (_HERE, _HERE), (NO_HULL, NO_HULL)
    return machine_code(_approached, NO_ZONES, 0, _HERE, _HERE, ends, hulls, 1.0, 1.0)


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
    limits: Limits,
) -> tuple[Vec3, Vec3, int]:
    """Place and velocity of one target, of ``t_us``, as limited; and which limits it has left."""
    ahead, left = 1e-6 * (t_us - begin_us), 0
    lowest, highest, fastest = limits
    led = add_scaled(p_WE, v_WE, ahead)
    near = limit_lead(p, led, _MAX_LEAD_DISTANCE + _LEAD_GROWTH * ahead)
    if fastest < math.inf:
        if p[2] > lowest + _TOLD:
            left |= _LOW
        if p[2] < highest - _TOLD:
            left |= _HIGH
        near = limit_lead(near, p_WE, fastest * ahead + lead_at(v_WE, fastest))
        if norm(v) > fastest + _TOLD:
            left |= _FAST
        if norm(subtract(p, p_WE)) > fastest * ahead + _AWAY:
            left |= _FAR
        v = limit_norm(v, fastest)
        near = (near[0], near[1], min(max(near[2], highest), lowest))
        down = safe_approach_speed(max(lowest - p_WE[2], 0.0), _GROUND_BRAKING, SETTLE_RATE)
        v = (v[0], v[1], min(v[2], down))
    p = near
    v = limit_lead(v, v_WE, _MAX_VELOCITY_ERROR)
    for zone in range(len(zones)):
        at = nearest_plane(zones, zone, p, t_us)
        if -at.distance > _MAX_DEPTH:
            p = add_scaled(p, (at.nx, at.ny, at.nz), -at.distance - _MAX_DEPTH)
    for zone in range(len(zones)):
        at = nearest_plane(zones, zone, p_WE, begin_us)
        v = _slowed(v, (at.nx, at.ny, at.nz), _fastest(at, alpha, slope))
    return p, v, left


@cache
def _limit_target() -> Callable[..., tuple[Vec3, Vec3, int]]:
    """``_limited``, compiled when it is first wanted."""
    return machine_code(_limited, NO_ZONES, 0, 0, _HERE, _HERE, _HERE, _HERE, 1.0, 1.0, UNLIMITED)


@Remembered
def _moving_zones(safe_set: SafeSet) -> Array:
    """The zones that a reference keeps off: a sphere rides on it."""
    return moving_zones(safe_set, None)


@compilable
def _fastest(at: Surface, alpha: float, slope: float) -> float:
    """How fast to approach a zone [m/s]."""
    return max(safe_approach_speed(max(at.distance, 0.0), alpha, slope), _ALWAYS)


def project_to_safe_set(p: Vec3, safe_set: SafeSet, t_us: int, *, touches: bool = False) -> Vec3:
    """``p`` [m, NED], or a point near it that keeps the clearance of every zone at a time.

    Of a tool that ``touches`` what may be touched, of every other zone.
    """
    return _project()(_moving_zones(safe_set), t_us, p, float(touches))


@kernel
def _projected(zones: Array, t_us: int, p: Vec3, touches: float) -> Vec3:
    for _ in range(_PROJECTIONS):
        moved = False
        for zone in range(len(zones)):
            at = nearest_plane(zones, zone, p, t_us)
            may_touch = touches > 0.0 and zones[zone, FORCE_MAX] > 0.0
            if -at.distance > _TOLERANCE and not may_touch:
                p, moved = add_scaled(p, (at.nx, at.ny, at.nz), -at.distance), True
        if not moved:
            break
    return p


@cache
def _project() -> Callable[..., Vec3]:
    """``_projected``, compiled when it is first wanted."""
    return machine_code(_projected, NO_ZONES, 0, _HERE, 0.0)


def project(
    target: EndEffectorTarget, safe_set: SafeSet, *, touches: bool = False
) -> EndEffectorTarget:
    """The target, or at rest at the boundary where it is beyond a wall or near an obstacle.

    A tool that ``touches`` goes up to what may be touched.
    """
    p = project_to_safe_set(target.p_WE, safe_set, target.t_us, touches=touches)
    if p == target.p_WE:
        return target
    rest = (0.0, 0.0, 0.0)
    return replace(target, p_WE=p, v_WE=rest, a_WE=rest)


class ReferenceGovernor:
    """The limits of one configuration."""

    def __init__(self, config: FlightConfig) -> None:
        self._config = config
        self._barrier = config.planner.walls
        self._hulls = hull_of(config.body), NO_HULL
        # The arm hangs: the end-effector is that much lower than the base.
        lowest, highest = lowest_height(config), config.steering.highest
        self._hanging = hanging = config.surroundings.hanging
        self._limits = (hanging - lowest, hanging - highest, config.steering.speed)

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
        above = body_down + self._config.steering.highest
        if above < 0.0:
            p, v = (p[0], p[1], p[2] - above), (v[0], v[1], max(v[2], 0.0))
        touch_speed = 0.0 if of_end_effector else self._config.limits.land_speed
        height = -body_down - self._config.airframe.leg_length
        if of_end_effector:  # a body may be asked down to the ground, to land
            height -= self._config.limits.airborne_height - _CLEAR_OF_GROUND
        p, v = limit_descent(p, v, height, touch_speed)
        ends = (other_end, _HERE) if of_end_effector else (_HERE, other_end)
        return limit_approach(p, v, ends, self._hulls, safe_set, t_us, self._barrier)

    def limit_horizon(
        self,
        targets: tuple[EndEffectorTarget, ...],
        p_WE: Vec3,
        v_WE: Vec3,
        safe_set: SafeSet,
        limits: Limits = UNLIMITED,
    ) -> tuple[tuple[EndEffectorTarget, ...], str]:
        """The targets of a horizon, the same object where nothing had to be limited, and why.

        What is asked for near the motion of the end-effector, ``p_WE`` [m, NED] and ``v_WE``
        [m/s, NED], and not far behind a wall passes as it is: the paper's own path enters the
        safety zone. Targets from outside have ``limits`` [m, m, m/s] of height and speed as well.
        """
        zones, begin_us, limited, left = _moving_zones(safe_set), targets[0].t_us, [], 0
        alpha, slope = self._barrier.alpha, self._barrier.slope
        for one in targets:
            about = zones, begin_us, one.t_us, one.p_WE, one.v_WE, p_WE, v_WE
            p, v, which = _limit_target()(*about, alpha, slope, limits)
            limited.append(EndEffectorTarget(one.t_us, p, v, one.a_WE, one.yaw, one.force))
            left |= which
        result = tuple(limited)
        return targets if result == targets else result, self._reason(left, limits)

    def limit_now(
        self,
        target: EndEffectorTarget,
        p_WE: Vec3,
        v_WE: Vec3,
        safe_set: SafeSet,
        limits: Limits,
    ) -> EndEffectorTarget:
        """The target from outside of this instant.

        ``p_WE`` [m, NED], ``v_WE`` [m/s, NED], ``limits`` [m, m, m/s] as in ``limit_horizon``.
        """
        lowest, highest, fastest = limits
        if (
            highest <= target.p_WE[2] <= lowest
            and norm(target.v_WE) <= fastest
            and norm(subtract(target.p_WE, p_WE)) <= _NEAR
        ):
            return target
        return self.limit_horizon((target,), p_WE, v_WE, safe_set, limits)[0][0]

    def is_up(self, target: EndEffectorTarget) -> bool:
        """Whether a target is at the lowest height or above: what came up from below is up."""
        return target.p_WE[2] <= self._limits[0]

    def limits_from(self, lowest: float = -math.inf) -> Limits:
        """The limits of targets from outside, of which the lowest height is none above ``lowest``.

        ``lowest`` [m, NED] is where the end-effector came up from, if it is on its way from below.
        """
        usual, highest, fastest = self._limits
        return max(usual, lowest), highest, fastest

    def left_by(self, motion: MotionSetpoint) -> str:
        """Which limits of a generated setpoint a motion leaves, in words; empty: none.

        A body that is asked down to the ground is to land.
        """
        lowest, highest, fastest = self._limits
        hanging, left = (0.0 if motion.of_end_effector else self._hanging), 0
        if motion.p is not None and motion.p[2] > lowest + _TOLD and motion.of_end_effector:
            left |= _LOW
        if motion.p is not None and motion.p[2] + hanging < highest - _TOLD:
            left |= _HIGH
        speed = 0.0 if motion.v is None else norm(finite_or_zero(motion.v))
        if speed > fastest + _TOLD:
            left |= _FAST
        return self._reason(left, self._limits)

    def _reason(self, left: int, limits: Limits) -> str:
        """Which of the ``limits`` have been left, in words; empty: none."""
        lowest, highest, fastest = limits
        said = {
            _LOW: f"a target is below {-lowest:.2f} m",
            _HIGH: f"a target is above {-highest:.0f} m",
            _FAST: f"targets ask for more than {fastest:g} m/s",
            _FAR: f"targets are more than {_AWAY:g} m ahead of the end-effector",
        }
        return ", ".join(text for flag, text in said.items() if left & flag)
