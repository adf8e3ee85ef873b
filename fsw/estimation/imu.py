"""Readings of the IMU on their way into the filter: what is wrong with one, and what stands in."""

from __future__ import annotations

import math
from typing import Any, Final

from fsw.compiled import compilable
from fsw.estimation.error_state import COLUMNS, FORCE, IMU_CAPACITY, LOST, RATE, TIME
from fsw.estimation.sensor_fault import SensorFault
from fsw.signals import Vec3

TIME_TOLERANCE: Final = 0.002  # s, by which a reading may be ahead of the tick
STUCK_READINGS: Final = 5  # equal to the last bit, in a row: noise never is
_UNLIKE_READINGS: Final = 3  # far from the last one, in a row, that are not believed
# Plain numbers: kernels return them.
_NONE: Final = SensorFault.NONE.value
_NOT_FINITE: Final = SensorFault.NOT_FINITE.value
_IMPLAUSIBLE: Final = SensorFault.IMPLAUSIBLE.value
_FUTURE: Final = SensorFault.FUTURE.value
_REPEATED: Final = SensorFault.REPEATED.value
_STUCK: Final = SensorFault.STUCK.value
_JUMP: Final = SensorFault.JUMP.value


@compilable
def add_imu(x: Any, law: Any, now: float, time: float, f: Vec3, w: Vec3) -> int:
    """Keep a reading of ``time`` [s] that came at ``now`` [s]; returns what is wrong with it.

    ``f`` [m/s^2, FRD] and ``w`` [rad/s, FRD]. In place of a reading that is none, the last good one
    is kept; one whose time is of no use is not kept at all. Numbers of ``SensorFault``.
    """
    last = x.imu[(x.end - 1) % IMU_CAPACITY]
    if not time <= now + TIME_TOLERANCE:
        return _FUTURE
    if x.end > 0 and time <= last[TIME]:
        return _REPEATED
    fault = _fault(x, law, f, w)
    kept = fault in (_NONE, _STUCK)
    if x.end == 0 and not kept:
        return fault
    row = x.imu[x.end % IMU_CAPACITY]
    row[TIME], row[LOST] = time, 0.0 if fault == _NONE else 1.0
    for i in range(3):
        row[FORCE + i] = f[i] if kept else last[FORCE + i]
        row[RATE + i] = w[i] if kept else last[RATE + i]
    if x.end == 0:
        for i in range(COLUMNS):  # what goes before the first reading
            last[i] = row[i]
    x.end += 1
    if x.end - x.first >= IMU_CAPACITY:  # the filter has not begun
        x.first += 1
    return fault


@compilable
def _fault(x: Any, law: Any, f: Vec3, w: Vec3) -> int:
    """What is wrong with the numbers of a reading; counts what comes in a row."""
    if not math.isfinite(f[0] + f[1] + f[2] + w[0] + w[1] + w[2]):
        return _NOT_FINITE
    force = max(abs(f[0]), abs(f[1]), abs(f[2]))
    rate = max(abs(w[0]), abs(w[1]), abs(w[2]))
    if force > law.accel_range or rate > law.gyro_range:
        return _IMPLAUSIBLE
    if x.end == 0:
        return _NONE
    last = x.imu[(x.end - 1) % IMU_CAPACITY]
    force, rate = 0.0, 0.0
    for i in range(3):
        force = max(force, abs(f[i] - last[FORCE + i]))
        rate = max(rate, abs(w[i] - last[RATE + i]))
    x.same = x.same + 1 if force == 0.0 and rate == 0.0 else 0
    # One that stays where it jumped to is the truth, or all there is.
    far = force > law.accel_jump or rate > law.gyro_jump
    x.unlike = x.unlike + 1 if far else 0
    if far and x.unlike <= _UNLIKE_READINGS:
        return _JUMP
    return _STUCK if x.same >= STUCK_READINGS else _NONE
