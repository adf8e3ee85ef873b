"""Joint encoders: angles in steps. There is no tachometer."""

from __future__ import annotations

import numpy as np

from sitl.sensors.exact import V4, SensorReadings
from sitl.sensors.keys import Encoders
from sitl.sensors.measurements import JointMeasurement
from sitl.sensors.noise import normal

_BLOCK = 250  # numbers drawn at once


class EncoderSensor:
    """The encoders of one flight."""

    def __init__(self, keys: Encoders, random: np.random.Generator, joints: int) -> None:
        self._keys = keys
        self._random = random
        self._offset = normal(random, keys.offset_rad, joints)
        self._draws: list[float] = []

    def measure(
        self, exact: SensorReadings, thrust: V4, stamp_us: int, outlier: bool
    ) -> JointMeasurement:
        """All angles; an outlier has a wrong bit, in the first joint."""
        keys = self._keys
        offset = self._offset
        if keys.noise_rad > 0.0:
            offset = [zero + self._noise() for zero in offset]
        if outlier:
            offset = [offset[0] + keys.outlier_rad, *offset[1:]]
        grid = keys.resolution_rad
        if grid > 0.0:
            pairs = zip(exact.q_arm, offset, strict=True)
            angles = tuple([grid * round((angle + more) / grid) for angle, more in pairs])
        else:
            angles = tuple([a + more for a, more in zip(exact.q_arm, offset, strict=True)])
        return JointMeasurement(stamp_us, angles)

    def _noise(self) -> float:
        if not self._draws:
            self._draws = normal(self._random, self._keys.noise_rad, _BLOCK)
        return self._draws.pop()
