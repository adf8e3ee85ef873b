"""From one sensor frame to the state estimate.

Position, velocity and attitude come from motion capture, rates from the gyro, joints from
their encoders. Nothing is filtered here: the loop that would suffer most from a velocity's
noise has an observer of its own (``control/tracking.py``), which knows the rotors
(docs/decisions/0006-estimate-without-filter.md).
"""

from __future__ import annotations

import struct
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.geometry.rotation import matrix_from_quaternion, yaw_of
from fsw.autopilot.geometry.vectors import four, put_three, three
from fsw.autopilot.signals import SensorFrame, StateEstimate, Vec3
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
    return _read(r.array, reading_of(sensors), sensors.t_us)


def reading_of(sensors: SensorFrame) -> Floats:
    """The numbers of a frame (READINGS,) [SI]."""
    s = sensors
    parts = *s.p_WB, *s.v_WB, *s.q_WB, *s.gyro_B, *s.accel_B, *s.q_arm, *s.qd_arm
    return np.frombuffer(_FRAMES[len(s.q_arm)].pack(*parts))


@machine_code
@kernel
def _read(records: NDArray[Any], reading: Floats, now_us: int) -> int:
    """Write the estimate that a ``reading`` (READINGS,) [SI] is."""
    r = records[0]
    r.has_estimate = 1
    return read_into(r.estimate, reading, now_us)


@compilable
def read_into(x: Estimate, reading: Floats, now_us: int) -> int:
    """The estimate of a ``reading`` (READINGS,) [SI]; which parts of that cannot be."""
    s, missing = reading, 0
    p, v, q, w = three(s, 0), three(s, 3), four(s, 6), three(s, 10)
    norm2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
    # Of what is no number every comparison is false.
    if not (_within(p, _PLACE_LIMIT) and _within(v, _SPEED_LIMIT) and 0.5 < norm2 < 2.0):
        missing |= POSE
    if not (_within(w, _RATE_LIMIT) and abs(s[15]) < FORCE_LIMIT):
        missing |= INERTIAL
    R = matrix_from_quaternion(q)
    put_three(x.p_WB, 0, p)
    put_three(x.v_WB, 0, v)
    put_three(x.w_WB_B, 0, w)
    for i in range(9):
        x.R_WB[i] = R[i]
    for i in range(x.q_arm.size):
        x.q_arm[i], x.qd_arm[i] = s[_ANGLES_AT + i], s[_RATES_AT + i]
        if not (abs(x.q_arm[i]) < _ANGLE_LIMIT and abs(x.qd_arm[i]) < _RATE_LIMIT):
            missing |= JOINTS
    x.t_us, x.yaw, x.specific_force = now_us, yaw_of(R), -s[15]
    return missing


@compilable
def _within(values: Vec3, limit: float) -> bool:
    """Whether each of ``values`` [the unit of ``limit``] is nearer to zero than ``limit`` [SI]."""
    within = True
    for one in values:
        within = within and abs(one) < limit
    return within
