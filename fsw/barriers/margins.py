"""How far inside its safe set the vehicle is now, for telemetry, in plain floats."""

from __future__ import annotations

from fsw.barriers.safe_approach import BarrierTuning
from fsw.barriers.tangent import tangent
from fsw.geometry.vectors import dot, norm, subtract
from fsw.signals import ConstraintKind, ConstraintReport, EndEffectorTarget, SafeSet, Vec3, Wall

PointMotion = tuple[Vec3, Vec3]  # position [m], velocity [m/s]


def constraint_report(
    safe_set: SafeSet,
    tuning: BarrierTuning,
    points: tuple[PointMotion, PointMotion, PointMotion],
    target: EndEffectorTarget | None,
) -> ConstraintReport:
    """Margins and barrier values of the active safe set.

    The points are base, joint 2 and end-effector; the sphere hangs on the target. For walls and
    then obstacles there is one margin each and critical point in that order; for the sphere a
    single one.
    """
    if safe_set.kind in (ConstraintKind.WALLS, ConstraintKind.OBSTACLES):
        pairs = [_margin_and_rate(wall, p, v) for wall in safe_set.walls for p, v in points]
        pairs += [
            _margin_and_rate(tangent(obstacle, p), p, v)
            for obstacle in safe_set.obstacles
            for p, v in points
        ]
    elif safe_set.sphere is not None and target is not None:
        offset, (p, v) = safe_set.sphere.centre_from_target, points[0]
        e = subtract(subtract(p, target.p_WE), offset)
        distance = norm(e)
        outward = dot(e, subtract(v, target.v_WE)) / max(distance, 1e-6)
        inner, outer = safe_set.sphere.radius - distance, safe_set.sphere.radius + distance
        h = min(tuning.approach_speed(inner) - outward, tuning.approach_speed(outer) + outward)
        return ConstraintReport(safe_set.kind, (inner,), (h,))
    else:
        pairs = []
    return ConstraintReport(
        safe_set.kind,
        tuple(margin for margin, _ in pairs),
        tuple(tuning.approach_speed(margin) + rate for margin, rate in pairs),
    )


def _margin_and_rate(wall: Wall, p: Vec3, v: Vec3) -> tuple[float, float]:
    return dot(wall.normal, p) - wall.offset - wall.clearance, dot(wall.normal, v)
