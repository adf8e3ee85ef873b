"""From one sensor frame to the state estimate.

Position, velocity and attitude come from motion capture, rates from the gyro, joints from
their encoders. Nothing is filtered here: the loop that would suffer most from a velocity's
noise has an observer of its own (``control/tracking.py``), which knows the rotors
(docs/decisions/0006-estimate-without-filter.md).
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.geometry.rotation import matrix_from_quaternion, yaw_of
from fsw.autopilot.signals import Mat3, SensorFrame, StateEstimate, Vec3, Vec4
from fsw.autopilot.tick_record import Estimate, Tick
from fsw.compiled import compilable, kernel, machine_code
from fsw.record import JOINTS as _ROOM
from fsw.record import Floats, per_joint

_ANGLES_AT: Final = 16
_RATES_AT: Final = _ANGLES_AT + _ROOM
READINGS: Final = _RATES_AT + _ROOM
"""Numbers of a frame: position, velocity, quaternion, gyro, accelerometer, joints, their rates.

It has room for the joints of any vehicle; those that one does not have are zero.
"""
_FRAMES: Final = [struct.Struct(f"<{_ANGLES_AT}d{2 * per_joint(n)}") for n in range(_ROOM + 1)]
POSE, INERTIAL, JOINTS = 1, 2, 4  # parts of a frame
# Farther or faster is no vehicle of this kind.
_PLACE_LIMIT: Final = 1e5  # m
_SPEED_LIMIT: Final = 100.0  # m/s
_RATE_LIMIT: Final = 100.0  # rad/s, of body and joints
_ANGLE_LIMIT: Final = 100.0  # rad, of joints
FORCE_LIMIT: Final = 1000.0  # m/s^2


def estimate_state(sensors: SensorFrame) -> StateEstimate | None:
    """The vehicle's state, or None where a reading is no number, out of range or no attitude."""
    r = Tick()
    r.joint_count = len(sensors.q_arm)
    return None if read_frame(sensors, r) else r.state_estimate


def read_frame(sensors: SensorFrame, r: Tick) -> int:
    """Write the state that a frame tells; which parts of it are no numbers or out of range."""
    return _machine_code()(r.array, reading_of(sensors), sensors.t_us)


def reading_of(sensors: SensorFrame) -> Floats:
    """The numbers of a frame (READINGS,) [SI]."""
    s = sensors
    parts = *s.p_WB, *s.v_WB, *s.q_WB, *s.gyro_B, *s.accel_B, *s.q_arm, *s.qd_arm
    return np.frombuffer(_FRAMES[len(s.q_arm)].pack(*parts))


@kernel
def _read(records: NDArray[Any], reading: Floats, now_us: int) -> int:
    """Write the estimate that a ``reading`` (READINGS,) [SI] is."""
    r = records[0]
    r.has_estimate = 1
    return read_into(r.estimate, reading, now_us)


@compilable
def read_into(x: Estimate, reading: Floats, now_us: int) -> int:
    """The estimate of a ``reading`` (READINGS,) [SI]; which parts of that cannot be."""
    s = reading
    p, v, w = (s[0], s[1], s[2]), (s[3], s[4], s[5]), (s[10], s[11], s[12])
    missing, R, x.yaw = attitude(p, v, (s[6], s[7], s[8], s[9]), w, (s[13], s[14], s[15]))
    for i in range(3):
        x.p_WB[i], x.v_WB[i], x.w_WB_B[i] = p[i], v[i], w[i]
    for i in range(9):
        x.R_WB[i] = R[i]
    for i in range(x.q_arm.size):
        x.q_arm[i], x.qd_arm[i] = s[_ANGLES_AT + i], s[_RATES_AT + i]
        # Of what is no number every comparison is false.
        if not (abs(x.q_arm[i]) < _ANGLE_LIMIT and abs(x.qd_arm[i]) < _RATE_LIMIT):
            missing |= JOINTS
    x.t_us, x.specific_force = now_us, -s[15]
    return missing


@compilable
def attitude(
    p_WB: Vec3, v_WB: Vec3, q_WB: Vec4, gyro_B: Vec3, accel_B: Vec3
) -> tuple[int, Mat3, float]:
    """Parts that are no numbers, out of range or no attitude; the rotation R_WB and its yaw [rad].

    Args:
        p_WB: Position [m].
        v_WB: Velocity [m/s].
        q_WB: Attitude, [w, x, y, z] [1].
        gyro_B: Body rates [rad/s].
        accel_B: Specific force [m/s^2].
    """
    missing = 0
    norm2 = q_WB[0] * q_WB[0] + q_WB[1] * q_WB[1] + q_WB[2] * q_WB[2] + q_WB[3] * q_WB[3]
    # Of what is no number every comparison is false.
    if not (_within(p_WB, _PLACE_LIMIT) and _within(v_WB, _SPEED_LIMIT) and 0.5 < norm2 < 2.0):
        missing |= POSE
    if not (_within(gyro_B, _RATE_LIMIT) and abs(accel_B[2]) < FORCE_LIMIT):
        missing |= INERTIAL
    R = matrix_from_quaternion(q_WB)
    return missing, R, yaw_of(R)


@compilable
def _within(values: Vec3, limit: float) -> bool:
    """Whether each of ``values`` [the unit of ``limit``] is nearer to zero than ``limit`` [SI]."""
    within = True
    for one in values:
        within = within and abs(one) < limit
    return within


@cache
def _machine_code() -> Callable[..., int]:
    """``_read``, compiled when it is first wanted."""
    return machine_code(_read, Tick().array, np.frombuffer(bytes(8 * READINGS)), 0)
