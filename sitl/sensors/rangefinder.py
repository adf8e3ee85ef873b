"""Rangefinder: the distance to the ground along the base's z axis."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sitl.sensors.channel import SensorModel
from sitl.sensors.exact import SensorReadings, Thrusts
from sitl.sensors.keys import Rangefinder
from sitl.sensors.noise import normal, rounded


class RangeMeasurement(NamedTuple):
    """Distance along the base's z axis."""

    t_us: int
    distance: float  # m
    variance: float  # m²
    least: float  # m, that it can measure
    most: float  # m


class RangefinderSensor(SensorModel):
    """The rangefinder of one flight."""

    kind = Rangefinder
    says = RangeMeasurement

    def __init__(self, keys: Rangefinder, random: np.random.Generator) -> None:
        self._keys = keys
        self._random = random
        self._scale = 1.0 + normal(random, keys.scale_share, 1)[0]

    def measure(
        self, exact: SensorReadings, thrust: Thrusts, stamp_us: int, outlier: bool
    ) -> RangeMeasurement | None:
        """A distance; None out of range. An outlier is too short, as of an insect or dust."""
        keys, (_, x, y, _) = self._keys, exact.q_WB
        down = 1.0 - 2.0 * (x * x + y * y)  # of the base's z axis
        error = normal(self._random, keys.noise_m, 1)[0]
        if not down > 0.0:
            return None
        distance = self._scale * -exact.p_WB[2] / down + error
        if outlier:
            distance -= keys.outlier_m
        if not keys.least_m <= distance <= keys.most_m:
            return None
        distance = rounded(distance, keys.resolution_m)
        return RangeMeasurement(
            stamp_us, distance, keys.noise_m * keys.noise_m, keys.least_m, keys.most_m
        )
