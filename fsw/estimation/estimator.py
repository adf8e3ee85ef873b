"""From one sensor frame to the state estimate.

Position, velocity and attitude come from motion capture, rates from the gyro, joints from
their encoders. Nothing is filtered here: the loop that would suffer most from a velocity's
noise has an observer of its own (``control/tracking.py``), which knows the rotors
(docs/decisions/0006-estimate-without-filter.md).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

from fsw.compiled import compilable, compiled, machine_code
from fsw.geometry.rotation import matrix_from_quaternion, yaw_of
from fsw.signals import Mat3, SensorFrame, StateEstimate, Vec2, Vec3, Vec4


def estimate_state(sensors: SensorFrame) -> StateEstimate | None:
    """The vehicle's state, or None where a reading is not a number or no attitude."""
    p, v, w, q, qd = sensors.p_WB, sensors.v_WB, sensors.gyro_B, sensors.q_arm, sensors.qd_arm
    usable, R, yaw = _machine_code()(p, v, sensors.q_WB, w, sensors.accel_B, q, qd)
    if not usable:
        return None
    return StateEstimate(sensors.t_us, p, v, R, w, yaw, q, qd, -sensors.accel_B[2])


@compilable
def attitude(
    p_WB: Vec3, v_WB: Vec3, q_WB: Vec4, gyro_B: Vec3, accel_B: Vec3, q_arm: Vec2, qd_arm: Vec2
) -> tuple[bool, Mat3, float]:
    """Whether all readings are valid, the rotation R_WB and its yaw [rad].

    Args:
        p_WB: Position [m].
        v_WB: Velocity [m/s].
        q_WB: Attitude, [w, x, y, z] [1].
        gyro_B: Body rates [rad/s].
        accel_B: Specific force [m/s^2].
        q_arm: Joint angles [rad].
        qd_arm: Joint rates [rad/s].
    """
    norm2 = q_WB[0] * q_WB[0] + q_WB[1] * q_WB[1] + q_WB[2] * q_WB[2] + q_WB[3] * q_WB[3]
    # The sum is finite exactly when every reading is (infinities of both signs give NaN).
    total = (
        (p_WB[0] + p_WB[1] + p_WB[2])
        + (v_WB[0] + v_WB[1] + v_WB[2])
        + (gyro_B[0] + gyro_B[1] + gyro_B[2])
        + accel_B[2]
        + (q_arm[0] + q_arm[1])
        + (qd_arm[0] + qd_arm[1])
    )
    R = matrix_from_quaternion(q_WB)
    return math.isfinite(total) and 0.5 < norm2 < 2.0, R, yaw_of(R)


_attitude = compiled(attitude)


@cache
def _machine_code() -> Callable[..., tuple[bool, Mat3, float]]:
    """``attitude``, compiled when it is first wanted."""
    none, arm = (0.0, 0.0, 0.0), (0.0, 0.0)
    return machine_code(_attitude, none, none, (1.0, 0.0, 0.0, 0.0), none, none, arm, arm)
