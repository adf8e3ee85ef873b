"""Which targets are believed, of a stream or a mission: within bounds, and not pressing too hard.

What may be pressed is judged as the start-up analysis has it for scenarios (``against_pressing``),
whoever sends it. The surface is the nearest one that may be touched, and friction pulls against how
the target moves over it.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Final, NamedTuple

from fsw.autopilot.control.tube import Tube
from fsw.autopilot.flight.commands.bounds import target_problem
from fsw.autopilot.geometry.vectors import add_scaled, dot, norm, subtract
from fsw.autopilot.model.body import body_of, tool_radius
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.parameters.touching import Pressed, against_pressing
from fsw.autopilot.shapes.kind import Surface
from fsw.autopilot.shapes.zones import surface
from fsw.autopilot.signals import EndEffectorTarget, SafeSet, Vec3, Zone
from fsw.frozen import replace

_RESTS = 1e-3  # m/s along a surface, below which a tool presses in one place
_STILL: Vec3 = (0.0, 0.0, 0.0)
FARTHEST: Final = 0.3  # m, of a place in a mission from the surface that it means


class TargetCheck:
    """Judges what targets ask of one configuration."""

    def __init__(self, config: FlightConfig, loop: Tube) -> None:
        """Of the vehicle of a ``config``, whose loops follow the plan within ``loop``."""

        @lru_cache(maxsize=64)  # a tool that rests, or slides straight, asks the same all the time
        def against(zone: Zone, asked: Pressed) -> str:
            return against_pressing(config, zone, loop, asked)

        self._against = against
        self._tool_radius = tool_radius(body_of("full", config.airframe))

    def believed(
        self, targets: tuple[EndEffectorTarget, ...], safe_set: SafeSet, now_us: int
    ) -> tuple[tuple[EndEffectorTarget, ...], list[str]]:
        """Those of the ``targets`` that can be flown in a ``safe_set``, and why others cannot."""
        against = [
            target_problem(one, now_us) or self._pressing_problem(one, safe_set) for one in targets
        ]
        judged = tuple(zip(targets, against, strict=True))
        refused = [f"target refused: {problem}" for _, problem in judged if problem is not None]
        return tuple([one for one, problem in judged if problem is None]), refused

    def _pressing_problem(self, target: EndEffectorTarget, safe_set: SafeSet) -> str | None:
        """Why a ``target`` cannot be pressed as it asks, in a ``safe_set``; None: it can."""
        if not target.force > 0.0:
            return None
        found = _nearest(safe_set, target.p_WE, target.t_us)
        if found is None:
            return f"{target.force:.1f} N are asked for where nothing may be touched"
        zone, at = found
        return self._pressed_problem(zone, (at.nx, at.ny, at.nz), target.force, target.v_WE)

    def _pressed_problem(self, zone: Zone, normal: Vec3, force: float, v: Vec3) -> str | None:
        """Why a ``force`` [N] cannot be pressed with on a ``zone``; None: it can.

        Along the ``normal`` [1, NED], by a tool that moves at ``v`` [m/s, NED].
        """
        v = subtract(v, zone.velocity)
        slide = add_scaled(v, normal, -dot(normal, v))
        asked = Pressed(normal, force, slide if norm(slide) > _RESTS else _STILL)
        # Where it is by now is of no matter, nor how it moves.
        still = replace(zone, velocity=_STILL, t_us=0)
        return self._against(still, asked) or None

    def meet(self, p: Vec3, force: float, safe_set: SafeSet, t_us: int) -> Meeting:
        """Where the tool meets the surface at ``p`` [m, NED] at a time, to press on it.

        ``force`` [N] is what it is to press with.
        """
        found = _nearest(safe_set, p, t_us)
        if found is None:
            return Meeting(p, _STILL, "there is no surface that may be touched")
        zone, at = found
        normal, off = (at.nx, at.ny, at.nz), at.distance + zone.clearance - self._tool_radius
        if abs(off) > FARTHEST:
            return Meeting(p, _STILL, f"the surface that may be touched is {off:.2f} m away")
        against = self._pressed_problem(zone, normal, force, _STILL)
        return Meeting(add_scaled(p, normal, -off), normal, against or "")


class Meeting(NamedTuple):
    """Where the tool just touches a surface, or why it is not to press there."""

    place: Vec3  # m, NED
    normal: Vec3  # [1, NED], out of the surface
    against: str = ""


def _nearest(safe_set: SafeSet, p: Vec3, t_us: int) -> tuple[Zone, Surface] | None:
    """The nearest zone to ``p`` [m, NED] that may be touched, and its surface at the clearance."""
    found, least = None, math.inf
    for k, zone in enumerate(safe_set.zones):
        at = surface(safe_set, k, p, t_us) if zone.touch else None
        if at is not None and at.distance + zone.clearance < least:
            found, least = (zone, at), at.distance + zone.clearance
    return found
