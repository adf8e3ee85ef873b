"""Motion capture: cameras that see the vehicle, now and then confuse its markers."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sitl.ranges import V3
from sitl.sensors.channel import SensorModel
from sitl.sensors.exact import V4, SensorReadings, Thrusts, turned
from sitl.sensors.keys import MotionCapture
from sitl.sensors.noise import anywhere, digits, rounded


class PoseMeasurement(NamedTuple):
    """Position and attitude."""

    t_us: int
    p_WB: V3  # m, NED
    q_WB: V4  # [w, x, y, z], maps B to W
    position_variance: V3  # m², as the sensor states it
    attitude_variance: V3  # rad², roll, pitch, yaw
    resets: int  # how often the sensor's frame has jumped
    from_cameras_on_board: bool  # visual odometry, or motion capture


class MotionCaptureSensor(SensorModel):
    """The system of one flight."""

    kind = MotionCapture
    says = PoseMeasurement

    def __init__(self, keys: MotionCapture, random: np.random.Generator) -> None:
        self._keys = keys
        self._random = random
        self._attitude_rad = math.radians(keys.attitude_deg)

    def measure(
        self, exact: SensorReadings, thrust: Thrusts, stamp_us: int, outlier: bool
    ) -> PoseMeasurement:
        """A pose in the digits that it has."""
        return in_digits(self.seen(exact, stamp_us, outlier), self._keys)

    def seen(self, exact: SensorReadings, stamp_us: int, outlier: bool) -> PoseMeasurement:
        """A pose; an outlier is off by a fixed length and angle in any direction."""
        keys, (x, y, z) = self._keys, exact.p_WB
        dx, dy, dz, a, b, c = self._random.standard_normal(6).tolist()
        size, turn = keys.position_m, self._attitude_rad
        p = (x + size * dx, y + size * dy, z + size * dz)
        q = turned(exact.q_WB, (turn * a, turn * b, turn * c))
        if outlier:
            ox, oy, oz = anywhere(self._random, keys.outlier_m)
            p = (p[0] + ox, p[1] + oy, p[2] + oz)
            q = turned(q, anywhere(self._random, math.radians(keys.outlier_deg)))
        return PoseMeasurement(stamp_us, p, q, (size * size,) * 3, (turn * turn,) * 3, 0, False)


def in_digits(seen: PoseMeasurement, keys: MotionCapture) -> PoseMeasurement:
    """A pose on the grid of its digits; a rotation by a small angle moves ``q`` by half of it."""
    step, turn = keys.position_resolution_m, 0.5 * math.radians(keys.attitude_resolution_deg)
    if step > 0.0:
        seen = seen._replace(p_WB=digits(seen.p_WB, (step,) * 3))
    if turn > 0.0:
        w, x, y, z = [rounded(one, turn) for one in seen.q_WB]
        size = math.sqrt(w * w + x * x + y * y + z * z)
        seen = seen._replace(q_WB=(w / size, x / size, y / size, z / size))
    return seen
