r"""How much the sensors shake from one reading to the next, as PX4 measures it.

.. math:: m \leftarrow 0.99\,m + 0.01\,\|x_k - x_{k-1}\|

Source: PX4, VehicleIMU: gyro and accelerometer vibration metric.
"""

from __future__ import annotations

import math

from fsw.signals import Vec2, Vec3

_SHARE = 0.01  # of the newest difference


class VibrationMeter:
    """Both metrics of one vehicle."""

    def __init__(self) -> None:
        self.metrics: Vec2 = (0.0, 0.0)  # gyro [rad/s], accelerometer [m/s^2]
        self._last: tuple[Vec3, Vec3] | None = None

    def add(self, gyro_B: Vec3, accel_B: Vec3) -> None:
        """Add a reading of ``gyro_B`` [rad/s] and ``accel_B`` [m/s^2]; NaN is ignored."""
        last, self._last = self._last, (gyro_B, accel_B)
        if last is None:
            return
        shaken = math.dist(gyro_B, last[0]), math.dist(accel_B, last[1])
        if math.isfinite(shaken[0] + shaken[1]):
            gyro, accel = self.metrics
            self.metrics = (
                gyro + _SHARE * (shaken[0] - gyro),
                accel + _SHARE * (shaken[1] - accel),
            )
