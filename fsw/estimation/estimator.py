"""From one sensor frame to the state estimate.

Position, velocity and attitude come from motion capture, rates from the gyro, joints from
their encoders. Nothing is filtered here: the loop that would suffer most from a velocity's
noise has an observer of its own (``control/tracking.py``), which knows the rotors
(docs/decisions/0006-estimate-without-filter.md).
"""

from __future__ import annotations

import math

from fsw.geometry.rotation import matrix_from_quaternion, yaw_of
from fsw.signals import SensorFrame, StateEstimate


def estimate_state(sensors: SensorFrame) -> StateEstimate | None:
    """The vehicle's state, or None where a reading is not a number or no attitude."""
    q = sensors.q_WB
    norm2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
    # The sum is finite exactly when every reading is (infinities of both signs give NaN).
    total = (
        sum(sensors.p_WB)
        + sum(sensors.v_WB)
        + sum(sensors.gyro_B)
        + sensors.accel_B[2]
        + sum(sensors.q_arm)
        + sum(sensors.qd_arm)
    )
    if not (math.isfinite(total) and 0.5 < norm2 < 2.0):
        return None
    R = matrix_from_quaternion(q)
    return StateEstimate(
        sensors.t_us,
        sensors.p_WB,
        sensors.v_WB,
        R,
        sensors.gyro_B,
        yaw_of(R),
        sensors.q_arm,
        sensors.qd_arm,
        -sensors.accel_B[2],
    )
