"""Barometer: the standard atmosphere, on a day with another pressure."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sitl.sensors.channel import Aboard, SensorModel
from sitl.sensors.exact import SensorReadings, Thrusts
from sitl.sensors.keys import Barometer
from sitl.sensors.noise import GaussMarkov, normal, rounded

SEA_LEVEL_PA = 101_325.0
_SEA_LEVEL_K = 288.15
_LAPSE_K_M = 0.0065
_EXPONENT = 9.80665 * 0.0289644 / (8.31446 * _LAPSE_K_M)


class PressureMeasurement(NamedTuple):
    """Static pressure."""

    t_us: int
    pressure_pa: float


def standard_pressure(altitude: float) -> float:
    """Pressure [Pa] at an ``altitude`` [m] above mean sea level, to 11 km.

    Source: ISO 2533:1975, Standard Atmosphere.
    """
    return float(SEA_LEVEL_PA * (1.0 - _LAPSE_K_M * altitude / _SEA_LEVEL_K) ** _EXPONENT)


def standard_altitude(pressure_pa: float) -> float:
    """Altitude [m] above mean sea level of a ``pressure_pa`` [Pa]; the opposite."""
    ratio = (pressure_pa / SEA_LEVEL_PA) ** (1.0 / _EXPONENT)
    return float(_SEA_LEVEL_K / _LAPSE_K_M * (1.0 - ratio))


class BarometerSensor(SensorModel):
    """The barometer of one flight."""

    kind = Barometer
    says = PressureMeasurement

    def __init__(
        self, keys: Barometer, random: np.random.Generator, origin_altitude: float = 0.0
    ) -> None:
        """Draw this flight's day; the origin lies at ``origin_altitude`` [m] above the sea."""
        self._origin_altitude = origin_altitude
        self._keys = keys
        self._random = random
        self._offset_pa = normal(random, keys.offset_pa, 1)[0]
        period_s = 1.0 / keys.rate_hz
        self._drift = GaussMarkov((keys.drift_pa,), keys.drift_time_s, period_s, random)

    @classmethod
    def aboard(cls, keys: Barometer, random: np.random.Generator, where: Aboard) -> BarometerSensor:
        """One at the height of its vehicle's origin."""
        return cls(keys, random, where.origin.altitude)

    def measure(
        self, exact: SensorReadings, thrust: Thrusts, stamp_us: int, outlier: bool
    ) -> PressureMeasurement:
        """A pressure; an outlier is off by a fixed amount, up or down."""
        keys = self._keys
        error = self._offset_pa + self._drift.step()[0] + normal(self._random, keys.noise_pa, 1)[0]
        if outlier:
            error += math.copysign(keys.outlier_pa, float(self._random.uniform(-1.0, 1.0)))
        pressure = standard_pressure(self._origin_altitude - exact.p_WB[2]) + error
        return PressureMeasurement(stamp_us, rounded(pressure, keys.resolution_pa))
