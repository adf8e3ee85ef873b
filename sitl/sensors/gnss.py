"""Satellite navigation: white noise, a part that wanders, digits, and reflections as outliers."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sitl.earth import RADIUS
from sitl.ranges import V3
from sitl.sensors.channel import Aboard, SensorModel
from sitl.sensors.exact import SensorReadings, Thrusts
from sitl.sensors.keys import Gnss
from sitl.sensors.noise import GaussMarkov, anywhere, digits

PLAIN_FIX, RTK_FIXED = 3, 6  # GPS_FIX_TYPE


class GnssMeasurement(NamedTuple):
    """Position and velocity from satellites."""

    t_us: int
    p_WB: V3  # m, NED
    v_WB: V3  # m/s, NED
    horizontal_deviation: float  # m, as the receiver states it
    vertical_deviation: float  # m
    rtk: bool
    satellites: int = 18  # that it sees

    @property
    def fix_type(self) -> int:
        """GPS_FIX_TYPE of MAVLink."""
        return RTK_FIXED if self.rtk else PLAIN_FIX


class GnssSensor(SensorModel):
    """The receiver of one flight."""

    kind = Gnss
    says = GnssMeasurement

    def __init__(self, keys: Gnss, random: np.random.Generator, latitude: float = 0.0) -> None:
        """Draw its errors; the local frame begins at a ``latitude`` [deg]."""
        self._keys = keys
        step = RADIUS * math.radians(keys.position_resolution_deg)  # m, northwards
        self._steps = (step, step * math.cos(math.radians(latitude)), keys.height_resolution_m)
        self._random = random
        level, down = keys.wander_horizontal_m, keys.wander_vertical_m
        sigmas = (level, level, down)
        self._wander = GaussMarkov(sigmas, keys.wander_time_s, 1.0 / keys.rate_hz, random)
        self._horizontal = math.hypot(keys.horizontal_m, level)
        self._vertical = math.hypot(keys.vertical_m, down)

    @classmethod
    def aboard(cls, keys: Gnss, random: np.random.Generator, where: Aboard) -> GnssSensor:
        """One at the latitude of its vehicle's origin."""
        return cls(keys, random, where.origin.latitude)

    def measure(
        self, exact: SensorReadings, thrust: Thrusts, stamp_us: int, outlier: bool
    ) -> GnssMeasurement:
        """Position and velocity; an outlier's position is off by a fixed length."""
        keys, (x, y, z), (vx, vy, vz) = self._keys, exact.p_WB, exact.v_WB
        ox, oy, oz = self._wander.step()
        dx, dy, dz, a, b, c = self._random.standard_normal(6).tolist()
        if outlier:
            fx, fy, fz = anywhere(self._random, keys.outlier_m)
            ox, oy, oz = ox + fx, oy + fy, oz + fz
        level, down, speed = keys.horizontal_m, keys.vertical_m, keys.velocity_m_s
        return GnssMeasurement(
            t_us=stamp_us,
            p_WB=digits(
                (x + ox + level * dx, y + oy + level * dy, z + oz + down * dz), self._steps
            ),
            v_WB=digits(
                (vx + speed * a, vy + speed * b, vz + speed * c),
                (keys.velocity_resolution_m_s,) * 3,
            ),
            horizontal_deviation=self._horizontal,
            vertical_deviation=self._vertical,
            rtk=keys.rtk,
        )
