r"""How much the sensors shake from one reading to the next, as PX4 measures it.

.. math:: m \leftarrow 0.99\,m + 0.01\,\|x_k - x_{k-1}\|

Readings at the end of the accelerometer's range are counted, axis by axis: they say only that there
was more.

Source: PX4, VehicleIMU: gyro and accelerometer vibration metric; PX4Accelerometer: clipping.
"""

from __future__ import annotations

import math

from fsw.autopilot.signals import Vec2, Vec3

_SHARE = 0.01  # of the newest difference
_AT_THE_END = 0.999  # of the range; the last digit may be below it


class VibrationMeter:
    """Both metrics of one vehicle, and what its accelerometer could not measure."""

    def __init__(self, accel_range: float = math.inf) -> None:
        """An accelerometer that measures up to ``accel_range`` [m/s^2] on each axis."""
        self.metrics: Vec2 = (0.0, 0.0)  # gyro [rad/s], accelerometer [m/s^2]
        self.clipped = 0  # readings of one axis at an end of the range
        self.accel_range = accel_range
        self._last: tuple[Vec3, Vec3] | None = None

    def add(self, gyro_B: Vec3, accel_B: Vec3) -> None:
        """Add a reading of ``gyro_B`` [rad/s] and ``accel_B`` [m/s^2]; NaN is ignored."""
        end = _AT_THE_END * self.accel_range
        x, y, z = accel_B
        if not (-end < x < end and -end < y < end and -end < z < end):
            self.clipped += sum([abs(one) >= end for one in accel_B])
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
