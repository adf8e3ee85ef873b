"""The end-effector reference between the points that were received."""

from __future__ import annotations

import math
from bisect import bisect_right
from operator import attrgetter

from fsw.autopilot.geometry.rotation import wrap_angle
from fsw.autopilot.signals import EndEffectorTarget, Vec3

_REST: Vec3 = (0.0, 0.0, 0.0)
_time = attrgetter("t_us")
KEPT_POINTS = 256  # 25 s of a 10 Hz stream; a flood must not grow the memory


def still_at(p_WE: Vec3, t_us: int = 0, yaw: float = 0.0) -> EndEffectorTarget:
    """A target at rest at ``p_WE`` [m] with ``yaw`` [rad]."""
    return EndEffectorTarget(t_us, p_WE, _REST, _REST, yaw)


def merge(
    stream: tuple[EndEffectorTarget, ...],
    received: tuple[EndEffectorTarget, ...],
    now_us: int,
) -> tuple[EndEffectorTarget, ...]:
    """Add points to the stream, sorted by time, a later point for the same instant wins.

    Points before the last one already due are forgotten; points that are not numbers never
    enter.
    """
    if not received:
        return stream
    new = tuple([point for point in received if _is_finite(point)])
    if stream and len(new) == 1 and new[0].t_us > stream[-1].t_us:
        points = stream + new  # the usual case, at a tenth of the cost
    else:
        by_time = {point.t_us: point for point in (*stream, *new)}
        points = tuple([by_time[t] for t in sorted(by_time)])
    due = bisect_right(points, now_us, key=_time)
    return points[max(due - 1, 0) :][:KEPT_POINTS]


def _is_finite(point: EndEffectorTarget) -> bool:
    return math.isfinite(
        sum(point.p_WE) + sum(point.v_WE) + sum(point.a_WE) + point.yaw + point.force
    )


def sample(stream: tuple[EndEffectorTarget, ...], t_us: int) -> EndEffectorTarget:
    """The reference at ``t_us``: cubic between points, sorted by time, at rest beyond the ends."""
    after = bisect_right(stream, t_us, key=_time)
    if after == 0:
        return still_at(stream[0].p_WE, t_us, stream[0].yaw)
    before = stream[after - 1]
    if after == len(stream):
        if before.t_us == t_us:
            return before
        return still_at(before.p_WE, t_us, before.yaw)
    return _hermite(before, stream[after], t_us)


def _hermite(first: EndEffectorTarget, last: EndEffectorTarget, t_us: int) -> EndEffectorTarget:
    """Cubic through both points' positions and velocities."""
    span = (last.t_us - first.t_us) * 1e-6
    share = (t_us - first.t_us) * 1e-6 / span
    (x, vx, ax), (y, vy, ay), (z, vz, az) = (
        _cubic(span, share, first.p_WE[k], first.v_WE[k], last.p_WE[k], last.v_WE[k])
        for k in range(3)
    )
    yaw = wrap_angle(first.yaw + share * wrap_angle(last.yaw - first.yaw))
    force = first.force
    if force != last.force:
        force += (t_us - first.t_us) / (last.t_us - first.t_us) * (last.force - force)
    return EndEffectorTarget(t_us, (x, y, z), (vx, vy, vz), (ax, ay, az), yaw, force)


def _cubic(span: float, x: float, p0: float, v0: float, p1: float, v1: float) -> Vec3:
    """Position, velocity and acceleration on one axis, at ``x`` of the ``span``."""
    m0, m1 = span * v0, span * v1
    c2 = 3.0 * (p1 - p0) - 2.0 * m0 - m1
    c3 = -2.0 * (p1 - p0) + m0 + m1
    return (
        p0 + x * (m0 + x * (c2 + x * c3)),
        (m0 + x * (2.0 * c2 + x * 3.0 * c3)) / span,
        (2.0 * c2 + 6.0 * x * c3) / (span * span),
    )


def vertical_ramp(
    start: EndEffectorTarget, climb: float, speed: float, t_us: int
) -> EndEffectorTarget:
    """Straight up or down from a point and its time on, then still.

    ``climb`` [m] is the height to gain, ``speed`` [m/s] positive.
    """
    elapsed = max(t_us - start.t_us, 0) * 1e-6
    x, y, z = start.p_WE
    direction = 1.0 if climb >= 0.0 else -1.0
    gained = speed * elapsed
    if gained >= abs(climb):
        return still_at((x, y, z - climb), t_us, start.yaw)
    return EndEffectorTarget(
        t_us,
        (x, y, z - direction * gained),
        (0.0, 0.0, -direction * speed),
        _REST,
        start.yaw,
    )
