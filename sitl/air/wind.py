"""Velocity of the air: a steady wind and the turbulence that it carries."""

from __future__ import annotations

import math

from sitl.air.dryden import Dryden, low_altitude
from sitl.plant.vector import V3
from sitl.scenario import AirKeys
from sitl.seeds import stream

_SLOWEST = 1.0  # m/s, at which turbulence passes where there is no wind


class WindField:
    """The air of one flight; the same everywhere at one instant."""

    def __init__(self, keys: AirKeys, seed: int, step_s: float) -> None:
        """Sampled every ``step_s`` [s]; turbulence passes as fast as the wind."""
        self._steady = keys.wind_m_s
        north, east, _ = keys.wind_m_s
        speed = math.hypot(*keys.wind_m_s)
        level = math.hypot(north, east)
        self._along = (north / level, east / level) if level > 0.0 else (1.0, 0.0)
        self._gusts: Dryden | None = None
        if keys.turbulence_m_s > 0.0:
            scales = low_altitude(keys.turbulence_height_m, keys.turbulence_m_s)
            random = stream(seed, "air", "turbulence")
            self._gusts = Dryden(scales, max(speed, _SLOWEST), step_s, random)

    def step(self) -> V3:
        """Velocity of the air in the next step [m/s, NED]."""
        if self._gusts is None:
            return self._steady
        (u, v, w), (c, s), (north, east, down) = self._gusts.step(), self._along, self._steady
        return (north + c * u - s * v, east + s * u + c * v, down + w)
