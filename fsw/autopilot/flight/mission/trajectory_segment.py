r"""A segment of a mission, straight, along a circle or to a surface, from rest or a speed to rest.

The share s of the way rises with a rate that follows a cubic smooth step up, stays, and
follows one down again:

.. math:: \dot s = u\,S(t/t_u),\qquad S(x) = 3x^2 - 2x^3,\qquad |\ddot s| \le 1.5\,u/t_u

Position and heading share it, so both are twice continuously differentiable, also where one segment
follows another at rest. The fastest segment within a speed and an acceleration is closed form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from fsw.autopilot.geometry.rotation import wrap_angle
from fsw.autopilot.geometry.vectors import subtract
from fsw.autopilot.signals import EndEffectorTarget, Vec3

_PEAK = 1.5  # largest slope of S
_ZERO: Vec3 = (0.0, 0.0, 0.0)
TOO_NEAR_TO_LOOK = 0.3  # m
_RAMP_S, _RISE = 1.0, 5.0  # s at least, N/s on average, in which a force rises and falls


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """How fast a segment may be flown."""

    speed: float  # m/s
    acceleration: float  # m/s^2
    turn_rate: float  # rad/s
    turn_acceleration: float  # rad/s^2


@dataclass(frozen=True, slots=True)
class TrajectorySegment:
    """One straight line and one turn, begun at ``start_us``."""

    start_us: int
    start: Vec3  # m, end-effector
    way: Vec3  # m, from start to end
    yaw: float  # rad, at the start
    turn: float = 0.0  # rad
    up: float = 0.0  # s, speed rises
    cruise: float = 0.0  # s
    down: float = 0.0  # s, speed falls

    @property
    def end_us(self) -> int:
        """When the segment is flown."""
        return self.start_us + math.ceil(1e6 * (self.up + self.cruise + self.down))

    def at(self, t_us: int) -> EndEffectorTarget:
        """The reference at an instant, at rest before and after."""
        s, rate, bend = self._share((t_us - self.start_us) * 1e-6)
        (x, y, z), (dx, dy, dz) = self.start, self.way
        return EndEffectorTarget(
            t_us,
            (x + s * dx, y + s * dy, z + s * dz),
            (rate * dx, rate * dy, rate * dz),
            (bend * dx, bend * dy, bend * dz),
            wrap_angle(self.yaw + s * self.turn),
        )

    def _share(self, t: float) -> tuple[float, float, float]:
        """Share of the way [1], its rate [1/s] and the rate's slope [1/s^2]."""
        left = self.up + self.cruise + self.down - t
        if left <= 0.0:
            return 1.0, 0.0, 0.0
        if t < 0.0:
            return 0.0, 0.0, 0.0
        u = 1.0 / (0.5 * self.up + self.cruise + 0.5 * self.down)
        if t < self.up:
            s, rate, bend = _rise(t, self.up)
            return u * s, u * rate, u * bend
        if left < self.down:
            s, rate, bend = _rise(left, self.down)
            return 1.0 - u * s, u * rate, -u * bend
        return u * (t - 0.5 * self.up), u, 0.0


@dataclass(frozen=True, slots=True)
class CircleSegment:
    """Some turns about a centre; share and timing are those of a segment of the same length."""

    along: TrajectorySegment  # its way is the arc's length, its yaw the heading
    centre: Vec3  # m, NED, at the height that is flown
    radius: float  # m
    bearing: float  # rad, of the start as seen from the centre
    angle: float  # rad, flown in all; positive clockwise as seen from above
    look_at: Vec3 | None = None  # m, NED, where the nose points; None: the heading stays

    @property
    def end_us(self) -> int:
        """When the segment is flown."""
        return self.along.end_us

    def at(self, t_us: int) -> EndEffectorTarget:
        """The reference at an instant, at rest before and after."""
        line = self.along.at(t_us)
        per_metre = self.angle / self.along.way[0]
        angle = self.bearing + line.p_WE[0] * per_metre
        rate, bend = line.v_WE[0] * per_metre, line.a_WE[0] * per_metre
        c, s, r = math.cos(angle), math.sin(angle), self.radius
        x, y, z = self.centre
        p = (x + r * c, y + r * s, z)
        yaw = line.yaw
        if self.look_at is not None and math.dist(self.look_at[:2], p[:2]) > TOO_NEAR_TO_LOOK:
            yaw = math.atan2(self.look_at[1] - p[1], self.look_at[0] - p[0])
        return EndEffectorTarget(
            t_us,
            p,
            (-r * s * rate, r * c * rate, 0.0),
            (-r * (s * bend + c * rate * rate), r * (c * bend - s * rate * rate), 0.0),
            yaw,
        )


@dataclass(frozen=True, slots=True)
class PushSegment:
    """To a surface, a force on it that rises, stays and falls, and back."""

    into: TrajectorySegment  # ends where the tool touches
    back: TrajectorySegment
    force: float  # N, along the normal of the surface
    ramp: float  # s, from no force to all of it, and back

    @property
    def end_us(self) -> int:
        """When the segment is flown."""
        return self.back.end_us

    def at(self, t_us: int) -> EndEffectorTarget:
        """The reference at an instant, at rest before and after."""
        if t_us >= self.back.start_us:
            return self.back.at(t_us)
        pressed = 1e-6 * min(t_us - self.into.end_us, self.back.start_us - t_us)
        _, share, _ = _rise(min(max(pressed, 0.0), self.ramp), self.ramp)
        return replace(self.into.at(t_us), force=self.force * share)


Segment = TrajectorySegment | CircleSegment | PushSegment


def circle_from(
    start: EndEffectorTarget,
    centre: Vec3,
    radius: float,
    turns: float,
    look_at: Vec3 | None,
    limits: MotionLimits,
) -> CircleSegment:
    """The fastest circle within limits from ``start`` on it, taken at rest, to rest.

    It goes ``turns`` [1] about ``centre`` [m, NED] with ``radius`` [m], negative anticlockwise, and
    points at ``look_at`` [m, NED].
    """
    x, y, z = start.p_WE[0] - centre[0], start.p_WE[1] - centre[1], start.p_WE[2]
    r = abs(radius)
    # Half of the acceleration turns the velocity, and leaves more than half for its size.
    speed = min(limits.speed, math.sqrt(0.5 * limits.acceleration * r))
    if look_at is not None:
        speed = min(speed, limits.turn_rate * r)
    share = math.sqrt(0.75)
    arc = 2.0 * math.pi * r * turns
    paced = replace(limits, speed=speed, acceleration=share * limits.acceleration)
    from_zero = EndEffectorTarget(start.t_us, _ZERO, _ZERO, _ZERO, start.yaw)
    return CircleSegment(
        along=segment_to(from_zero, (arc, 0.0, 0.0), None, paced),
        centre=(centre[0], centre[1], z),
        radius=r,
        bearing=math.atan2(y, x),
        angle=math.copysign(2.0 * math.pi * turns, radius),
        look_at=look_at,
    )


def push_from(
    start: EndEffectorTarget, place: Vec3, force: float, press_s: float, limits: MotionLimits
) -> PushSegment:
    """From ``start``, taken at rest, to ``place`` [m, NED], where it presses, and back.

    The ``force`` [N] stays for ``press_s`` [s] between its rise and its fall.
    """
    ramp = max(_RAMP_S, force / _RISE)
    into = segment_to(start, place, None, limits)
    over_us = into.end_us + math.ceil(1e6 * (2.0 * ramp + press_s))
    back = segment_to(into.at(into.end_us), start.p_WE, None, limits)
    return PushSegment(into, replace(back, start_us=over_us), force, ramp)


def segment_to(
    start: EndEffectorTarget, end: Vec3, yaw: float | None, limits: MotionLimits
) -> TrajectorySegment:
    """The fastest segment within limits from ``start``, taken at rest, to rest at ``end`` [m, NED].

    Its heading ends at ``yaw`` [rad]; None keeps it.
    """
    way = subtract(end, start.p_WE)
    turn = 0.0 if yaw is None else wrap_angle(yaw - start.yaw)
    distance, angle = math.hypot(*way), abs(turn)
    if distance < 1e-9 and angle < 1e-9:
        return TrajectorySegment(start.t_us, start.p_WE, (0.0, 0.0, 0.0), start.yaw)
    u = _smaller(limits.speed, distance, limits.turn_rate, angle)
    slope = _smaller(limits.acceleration, distance, limits.turn_acceleration, angle)
    ramp = _PEAK * u / slope
    if u * ramp > 1.0:  # too short to reach the speed
        u = math.sqrt(slope / _PEAK)
        ramp = 1.0 / u
    return TrajectorySegment(
        start_us=start.t_us,
        start=start.p_WE,
        way=way,
        yaw=start.yaw,
        turn=turn,
        up=ramp,
        cruise=max(1.0 / u - ramp, 0.0),
        down=ramp,
    )


def braking_segment(start: EndEffectorTarget, limits: MotionLimits) -> TrajectorySegment:
    """Straight on from a moving reference until it rests, heading kept."""
    down = _PEAK * math.hypot(*start.v_WE) / limits.acceleration
    vx, vy, vz = start.v_WE
    way = (0.5 * down * vx, 0.5 * down * vy, 0.5 * down * vz)
    return TrajectorySegment(
        start_us=start.t_us, start=start.p_WE, way=way, yaw=start.yaw, down=down
    )


def _rise(t: float, ramp: float) -> tuple[float, float, float]:
    """Integral of S(t / ramp) over time, S and its slope."""
    x = t / ramp
    return (
        ramp * x**3 * (1.0 - 0.5 * x),
        x * x * (3.0 - 2.0 * x),
        6.0 * x * (1.0 - x) / ramp,
    )


def _smaller(linear: float, distance: float, angular: float, angle: float) -> float:
    """The limit on s that a limit along the way and one on the turn leave."""
    return min(
        linear / distance if distance > 0.0 else math.inf,
        angular / angle if angle > 0.0 else math.inf,
    )
