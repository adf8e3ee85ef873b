"""From one sensor frame to the state estimate.

Position, velocity and attitude come from motion capture, rates from the gyro, joints from
their encoders. Nothing is filtered here: the loop that would suffer most from a velocity's
noise has an observer of its own (``control/tracking.py``), which knows the rotors
(docs/decisions/0006-estimate-without-filter.md).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Final

from fsw.compiled import compilable, compiled, machine_code
from fsw.geometry.rotation import matrix_from_quaternion, yaw_of
from fsw.signals import Mat3, SensorFrame, StateEstimate, Vec2, Vec3, Vec4

POSE, INERTIAL, JOINTS = 1, 2, 4  # parts of a frame
# Farther or faster is no vehicle of this kind.
_PLACE_LIMIT: Final = 1e5  # m
_SPEED_LIMIT: Final = 100.0  # m/s
_RATE_LIMIT: Final = 100.0  # rad/s, of body and joints
_ANGLE_LIMIT: Final = 100.0  # rad, of joints
FORCE_LIMIT: Final = 1000.0  # m/s^2


def estimate_state(sensors: SensorFrame) -> StateEstimate | None:
    """The vehicle's state, or None where a reading is no number, out of range or no attitude."""
    missing, estimate = read_frame(sensors)
    return None if missing else estimate


def read_frame(sensors: SensorFrame) -> tuple[int, StateEstimate]:
    """Parts of a frame that are no numbers or out of range, and the state that it tells."""
    p, v, w, q, qd = sensors.p_WB, sensors.v_WB, sensors.gyro_B, sensors.q_arm, sensors.qd_arm
    missing, R, yaw = _machine_code()(p, v, sensors.q_WB, w, sensors.accel_B, q, qd)
    return missing, StateEstimate(sensors.t_us, p, v, R, w, yaw, q, qd, -sensors.accel_B[2])


@compilable
def attitude(
    p_WB: Vec3, v_WB: Vec3, q_WB: Vec4, gyro_B: Vec3, accel_B: Vec3, q_arm: Vec2, qd_arm: Vec2
) -> tuple[int, Mat3, float]:
    """Parts that are no numbers, out of range or no attitude; the rotation R_WB and its yaw [rad].

    Args:
        p_WB: Position [m].
        v_WB: Velocity [m/s].
        q_WB: Attitude, [w, x, y, z] [1].
        gyro_B: Body rates [rad/s].
        accel_B: Specific force [m/s^2].
        q_arm: Joint angles [rad].
        qd_arm: Joint rates [rad/s].
    """
    missing = 0
    norm2 = q_WB[0] * q_WB[0] + q_WB[1] * q_WB[1] + q_WB[2] * q_WB[2] + q_WB[3] * q_WB[3]
    # Of what is no number every comparison is false.
    if not (_within(p_WB, _PLACE_LIMIT) and _within(v_WB, _SPEED_LIMIT) and 0.5 < norm2 < 2.0):
        missing |= POSE
    if not (_within(gyro_B, _RATE_LIMIT) and abs(accel_B[2]) < FORCE_LIMIT):
        missing |= INERTIAL
    if not (_within(q_arm, _ANGLE_LIMIT) and _within(qd_arm, _RATE_LIMIT)):
        missing |= JOINTS
    R = matrix_from_quaternion(q_WB)
    return missing, R, yaw_of(R)


@compilable
def _within(values: Vec3 | Vec2, limit: float) -> bool:
    """Whether each of ``values`` [the unit of ``limit``] is nearer to zero than ``limit`` [SI]."""
    within = True
    for one in values:
        within = within and abs(one) < limit
    return within


_attitude = compiled(attitude)


@cache
def _machine_code() -> Callable[..., tuple[int, Mat3, float]]:
    """``attitude``, compiled when it is first wanted."""
    none, arm = (0.0, 0.0, 0.0), (0.0, 0.0)
    return machine_code(_attitude, none, none, (1.0, 0.0, 0.0, 0.0), none, none, arm, arm)
