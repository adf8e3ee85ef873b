"""What the plant would say, for sensors without a plant."""

from __future__ import annotations

import math
from typing import Final

from sitl.sensors.exact import SensorReadings

START_US: Final = 1_000_000
STEP_US: Final = 2000
HOVER: Final = (8.0, 8.0, 8.0, 8.0)  # N


def reading(t_us: int = START_US) -> SensorReadings:
    """A vehicle that moves, 1.2 m above the ground, tilted."""
    x = 1e-6 * (t_us - START_US)
    roll, yaw = 0.1, 0.4
    cr, sr, cy, sy = math.cos(roll / 2), math.sin(roll / 2), math.cos(yaw / 2), math.sin(yaw / 2)
    return SensorReadings(
        t_us=t_us,
        p_WB=(x, -0.5 * x, -1.2),
        v_WB=(1.0, -0.5, 0.0),
        q_WB=(cr * cy, sr * cy, sr * sy, cr * sy),
        w_WB_B=(0.0, 0.0, 0.0),
        gyro_B=(0.1, -0.2, 0.3),
        accel_B=(0.5, -0.4, -9.7),
        q_arm=(-0.7, 1.4),
        qd_arm=(0.0, 0.0),
        tau_arm=(0.0, 0.0),
    )
