"""Which targets of a stream are believed: within bounds, and not pressing too hard.

What may be pressed is judged as the start-up analysis has it for scenarios (``against_pressing``),
whoever sends it. The surface is the nearest one that may be touched, and friction pulls against how
the target moves over it.
"""

from __future__ import annotations

from functools import lru_cache

from fsw.autopilot.control.tube import Tube
from fsw.autopilot.flight.commands.bounds import target_problem
from fsw.autopilot.geometry.vectors import add_scaled, dot, norm, subtract
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.parameters.touching import Pressed, against_pressing
from fsw.autopilot.shapes.zones import surface
from fsw.autopilot.signals import EndEffectorTarget, SafeSet, Vec3, Zone
from fsw.frozen import replace

_RESTS = 1e-3  # m/s along a surface, below which a tool presses in one place
_STILL: Vec3 = (0.0, 0.0, 0.0)


class TargetCheck:
    """Judges what targets ask of one configuration."""

    def __init__(self, config: FlightConfig, loop: Tube) -> None:
        """Of the vehicle of a ``config``, whose loops follow the plan within ``loop``."""

        @lru_cache(maxsize=64)  # a tool that rests, or slides straight, asks the same all the time
        def against(zone: Zone, asked: Pressed) -> str:
            return against_pressing(config, zone, loop, asked)

        self._against = against

    def believed(
        self, targets: tuple[EndEffectorTarget, ...], safe_set: SafeSet, now_us: int
    ) -> tuple[tuple[EndEffectorTarget, ...], list[str]]:
        """Those of the ``targets`` that can be flown in a ``safe_set``, and why others cannot."""
        if not targets:
            return (), []
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
        found, least = None, float("inf")
        for k, zone in enumerate(safe_set.zones):
            at = surface(safe_set, k, target.p_WE, target.t_us) if zone.touch else None
            if at is not None and at.distance + zone.clearance < least:
                found, least = (zone, at), at.distance + zone.clearance
        if found is None:
            return f"{target.force:.1f} N are asked for where nothing may be touched"
        zone, at = found
        normal = at.nx, at.ny, at.nz
        v = subtract(target.v_WE, zone.velocity)
        slide = add_scaled(v, normal, -dot(normal, v))
        asked = Pressed(normal, target.force, slide if norm(slide) > _RESTS else _STILL)
        # Where it is by now is of no matter, nor how it moves.
        still = replace(zone, velocity=_STILL, t_us=0)
        return self._against(still, asked) or None
