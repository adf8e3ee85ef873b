"""Which way the vehicle looks along its path.

The arm moves in one vertical plane of the body. In that plane it holds the end-effector while the
base is pushed about; across it can do nothing. Work
beside a wall therefore needs that plane turned to the wall.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sitl.scenario import V3, Points, Scenario, ScenarioWall
from sitl.trajectory import Reference

_NEAR_M: Final = 0.05  # this much farther away, a wall counts 1/e of the nearer one
_AROUND_S: Final = tuple(0.5 * k for k in range(-4, 5))  # the vehicle turns slowly: seen ahead


class Heading:
    """Yaw over the time of a reference."""

    def __init__(self, scenario: Scenario, reference: Reference) -> None:
        upright = tuple(wall for wall in scenario.walls if math.hypot(*wall.normal[:2]) > 0.5)
        curve = scenario.trajectory
        self._walls = upright if getattr(curve, "heading", "start") == "walls" else ()
        self._times: tuple[float, ...] = ()
        self._yaws = [math.radians(yaw) for yaw in getattr(curve, "yaw_deg", ())]
        if isinstance(curve, Points) and self._yaws:
            self._times = curve.time_s
        self._fixed = math.radians(scenario.start.yaw_deg)
        self._reference = reference

    def at(self, t: float) -> float:
        """Yaw [rad, NED] at t [s] after the start of the trajectory."""
        if self._times:
            return math.remainder(float(np.interp(t, self._times, self._yaws)), 2.0 * math.pi)
        if not self._walls:
            return self._fixed
        yaws = [facing(self._walls, self._reference.place(t + around)) for around in _AROUND_S]
        return sum(yaws) / len(yaws)


def facing(walls: tuple[ScenarioWall, ...], p: V3) -> float:
    """Yaw in [0, pi) that turns the arm's plane at p [m, NED] to the nearest wall.

    Near two walls it lies between their yaws. A plane faces a wall with either side, so half a
    turn more is the same.
    """
    x, y, z = p
    gaps = [a * x + b * y + c * z - wall.offset_m for wall in walls for a, b, c in (wall.normal,)]
    nearest = min(gaps)
    weights = [math.exp((nearest - gap) / _NEAR_M) for gap in gaps]
    yaws = [math.atan2(wall.normal[1], wall.normal[0]) % math.pi for wall in walls]
    return sum(w * yaw for w, yaw in zip(weights, yaws, strict=True)) / sum(weights)
