"""Magnetometer: the Earth's field in the body's axes, with what the vehicle adds."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sitl.ranges import V3
from sitl.sensors.channel import SensorModel
from sitl.sensors.exact import V4, SensorReadings, Thrusts
from sitl.sensors.keys import Magnetometer
from sitl.sensors.noise import anywhere, normal, rounded


class MagneticMeasurement(NamedTuple):
    """Magnetic field."""

    t_us: int
    field_B: V3  # Gauss


class MagnetometerSensor(SensorModel):
    """The magnetometer of one flight."""

    kind = Magnetometer
    says = MagneticMeasurement

    def __init__(self, keys: Magnetometer, random: np.random.Generator) -> None:
        self._keys = keys
        self._random = random
        self._offset = normal(random, keys.offset_gauss, 3)
        self._scale = [1.0 + error for error in normal(random, keys.scale_share, 3)]

    def measure(
        self, exact: SensorReadings, thrust: Thrusts, stamp_us: int, outlier: bool
    ) -> MagneticMeasurement:
        """A field; an outlier has a disturbance of a fixed size in any direction."""
        keys, field = self._keys, _in_body(exact.q_WB, self._keys.field_gauss)
        more = anywhere(self._random, keys.outlier_gauss) if outlier else (0.0, 0.0, 0.0)
        noise = normal(self._random, keys.noise_gauss, 3)
        x, y, z = (
            rounded(s * b + o + n + m, keys.resolution_gauss)
            for s, b, o, n, m in zip(self._scale, field, self._offset, noise, more, strict=True)
        )
        return MagneticMeasurement(stamp_us, (x, y, z))


def _in_body(q: V4, v: tuple[float, float, float]) -> tuple[float, float, float]:
    """A vector of W in B, for the attitude ``q``."""
    w, x, y, z = q
    a, b, c = v
    # v + 2 u × (u × v + w v) with the conjugate, u = −(x, y, z).
    tx, ty, tz = 2.0 * (z * b - y * c), 2.0 * (x * c - z * a), 2.0 * (y * a - x * b)
    return (
        a + w * tx + z * ty - y * tz,
        b + w * ty + x * tz - z * tx,
        c + w * tz + y * tx - x * ty,
    )
