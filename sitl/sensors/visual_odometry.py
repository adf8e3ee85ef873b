"""Visual-inertial odometry: a pose in a frame of its own, which drifts and jumps."""

from __future__ import annotations

import math

import numpy as np

from sitl.ranges import V3
from sitl.sensors.channel import SensorModel
from sitl.sensors.exact import V4, SensorReadings, Thrusts
from sitl.sensors.keys import VisualOdometry
from sitl.sensors.motion_capture import MotionCaptureSensor, PoseMeasurement, in_digits
from sitl.sensors.noise import normal


class VisualOdometrySensor(SensorModel):
    """The cameras of one flight; at its begin the frame is the true one.

    It knows how it drifts, and states the variance that has come together since the frame was the
    true one, or was recognised. That the frame is turned shows in places far from its origin.
    """

    kind = VisualOdometry
    says = PoseMeasurement

    def __init__(self, keys: VisualOdometry, random: np.random.Generator) -> None:
        self._keys = keys
        self._random = random
        self._pose = MotionCaptureSensor(keys, random)  # the same noise, in another frame
        self._offset: V3 = (0.0, 0.0, 0.0)  # m, of the frame's origin
        self._yaw = 0.0  # rad, of the frame
        self._resets = 0
        self._begun = False
        self._offset_variance = 0.0  # m²
        self._yaw_variance = 0.0  # rad²
        period_s = 1.0 / keys.rate_hz
        self._walk_m = keys.drift_m * math.sqrt(period_s)
        self._walk_rad = math.radians(keys.drift_deg) * math.sqrt(period_s)
        self._recognises_share = period_s / keys.recognises_every_s

    def measure(
        self, exact: SensorReadings, thrust: Thrusts, stamp_us: int, outlier: bool
    ) -> PoseMeasurement:
        """A pose in the frame as it is now."""
        if self._begun:
            self._drift()
        self._begun = True
        seen = self._pose.seen(exact, stamp_us, outlier)
        keys, (x, y, z), (ox, oy, oz) = self._keys, seen.p_WB, self._offset
        c, s = math.cos(self._yaw), math.sin(self._yaw)
        noise, turn = seen.position_variance[0] + self._offset_variance, self._yaw_variance
        roll, pitch, yaw = seen.attitude_variance
        drifted = seen._replace(
            position_variance=(noise + turn * y * y, noise + turn * x * x, noise),
            attitude_variance=(roll, pitch, yaw + turn),
            p_WB=(c * x - s * y + ox, s * x + c * y + oy, z + oz),
            q_WB=_yawed(self._yaw, seen.q_WB),
            resets=self._resets % 256,
            from_cameras_on_board=True,
        )
        return in_digits(drifted, keys)

    def _drift(self) -> None:
        keys, (x, y, z) = self._keys, self._offset
        dx, dy, dz, turn = self._random.standard_normal(4).tolist()
        self._offset = (x + self._walk_m * dx, y + self._walk_m * dy, z + self._walk_m * dz)
        self._yaw += self._walk_rad * turn
        self._offset_variance += self._walk_m * self._walk_m
        self._yaw_variance += self._walk_rad * self._walk_rad
        if float(self._random.uniform()) < self._recognises_share:
            ox, oy, oz = normal(self._random, keys.recognised_m, 3)
            self._offset = (ox, oy, oz)
            self._yaw = normal(self._random, math.radians(keys.recognised_deg), 1)[0]
            self._offset_variance = keys.recognised_m * keys.recognised_m
            self._yaw_variance = math.radians(keys.recognised_deg) ** 2
            self._resets += 1


def _yawed(yaw: float, q: V4) -> V4:
    """Attitude ``q`` as seen from a frame that is turned: the world turns by ``yaw`` [rad]."""
    c, s = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    w, x, y, z = q
    return (c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w)
