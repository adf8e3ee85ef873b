"""The sphere that follows the end-effector's target and holds the base (Case II).

Source: docs/equations.md E15, E23.
"""

from __future__ import annotations

from fsw.autopilot.shapes.ball import PLANES_INSIDE, ball_plane, covers_inside
from fsw.autopilot.shapes.kind import ShapeKind, places
from fsw.autopilot.signals import TARGET_SPHERE, Shape, Vec3, Zone


def target_sphere(centre_from_target: Vec3, radius: float) -> Zone:
    """To keep the base within ``radius`` [m] of a place beside the target.

    ``centre_from_target`` [m, NED] leads from the target to it, (0, 0, -d_iw) for a sphere
    straight above.
    """
    return Zone(Shape(TARGET_SPHERE, (*centre_from_target, radius)), clearance=0.0, keep_in=True)


def _problem(numbers: tuple[float, ...]) -> str | None:
    return None if numbers[3] > 0.0 else f"a sphere of radius {numbers[3]:g} m contains nothing"


KIND = ShapeKind(
    name=TARGET_SPHERE,
    number=2,
    meaning=(*places("centre from target,"), "radius [m]"),
    planes_inside=PLANES_INSIDE,
    plane=ball_plane,
    problem=_problem,
    covers=covers_inside,
    follows_target=True,
)
