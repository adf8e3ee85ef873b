"""Readings of the IMU on their way into the filter: what is wrong with one, and what stands in.

Accelerometer and gyro are judged each for itself. A reading far from the last good one is not
believed. What jumps once is believed again as soon as it is back, or stays where it jumped to; what
jumps again soon must be steady for longer. A gyro in flight that stays where it jumped to is
believed only where an attitude agrees with it (``claim.py``).
"""

from __future__ import annotations

import math
from typing import Any, Final

from fsw.compiled import compilable
from fsw.estimation.claim import add_claim, forget_claim, open_claim
from fsw.estimation.error_state import (
    COLUMNS,
    FORCE,
    IMU_CAPACITY,
    LOST,
    MODELLED,
    NO_FORCE,
    NO_RATE,
    RATE,
    TIME,
    vec3,
)
from fsw.estimation.sensor_fault import SensorFault
from fsw.signals import Vec3

TIME_TOLERANCE: Final = 0.002  # s, by which a reading may be ahead of the tick
IMU_TOO_OLD: Final = 0.03  # s; what the vehicle did so long ago says nothing about its rates now
STUCK_READINGS: Final = 5  # equal to the last bit, in a row: noise never is
# Steady readings in a row until what has jumped is the truth: of one that was calm, and of others.
STAYS: Final = 3
STAYS_LONG: Final = 25
_BACK: Final = 0.5  # of a jump: so near to what is flown, a gyro has come back to it
_BLOW: Final = 0.01  # s, for which a blow lasts that makes more than one jump
CALM: Final = 250  # readings that were believed, in a row
# A step of the gyro from one reading to the next. Rotors turn the body by 17 rad/s^2, which is
# 0.034 rad/s; in flight it changes by 0.016 rad/s on average with what rotors shake.
_STEP: Final = 0.06  # rad/s
_STEP_SHAKEN: Final = 3.0  # times the usual change
_SHAKEN_SHARE: Final = 0.01  # of the newest change, in the usual one
STEPS_APART: Final = 0.5  # s; farther apart, steps are not of one kind
# Plain numbers: kernels return them.
_NONE: Final = SensorFault.NONE.value
_NOT_FINITE: Final = SensorFault.NOT_FINITE.value
_IMPLAUSIBLE: Final = SensorFault.IMPLAUSIBLE.value
_FUTURE: Final = SensorFault.FUTURE.value
_REPEATED: Final = SensorFault.REPEATED.value
_STUCK: Final = SensorFault.STUCK.value
_JUMP: Final = SensorFault.JUMP.value


@compilable
def add_imu(x: Any, law: Any, now: float, time: float, f: Vec3, w: Vec3, model: Vec3) -> int:
    """Keep a reading of ``time`` [s] that came at ``now`` [s]; returns what is wrong with it.

    ``f`` [m/s^2, FRD] and ``w`` [rad/s, FRD]. In place of what is of no use, the last good one is
    kept, or it goes on as the rotors make it: of the ``model`` [SI, FRD], angular accelerations
    about x and y, and the specific force along -z, which is 0 where it is not known. A reading
    whose time is of no use is not kept at all. Numbers of ``SensorFault``.
    """
    last = x.imu[(x.end - 1) % IMU_CAPACITY]
    if not time <= now + TIME_TOLERANCE:
        return _FUTURE
    if x.end > 0 and time <= last[TIME]:
        return _REPEATED
    if x.end > 0 and time - last[TIME] <= law.imu_gap:
        note_step(x, time, w)
    doubted = x.doubted[1]
    of_force = _fault(x, 0, f, law.accel_range, law.accel_jump, False)
    of_rate = _fault(x, 1, w, law.gyro_range, law.gyro_jump, model[2] > 0.0)
    keep_force, keep_rate = of_force in (_NONE, _STUCK), of_rate in (_NONE, _STUCK)
    fault = of_force if of_force != _NONE else of_rate
    if x.end == 0 and not (keep_force and keep_rate):
        return fault
    row = x.imu[x.end % IMU_CAPACITY]
    lost = (0 if of_force == _NONE else NO_FORCE) | (0 if of_rate == _NONE else NO_RATE)
    modelled = lost != 0 and model[2] > 0.0 and x.end > 0
    row[TIME], row[LOST] = time, float(lost | MODELLED if modelled else lost)
    for i in range(3):
        row[FORCE + i] = f[i] if keep_force else last[FORCE + i]
        row[RATE + i] = w[i] if keep_rate else last[RATE + i]
    if modelled:
        _model_what_is_lost(row, last, lost, model)
    if x.end == 0:
        _keep_as(last, row)  # what goes before the first reading
    if x.doubted[1] > 0:
        _note_claim(x, doubted, time, w, vec3(row, RATE), of_rate == _JUMP)
    x.end += 1
    if x.end - x.first >= IMU_CAPACITY:  # the filter has not begun
        x.first += 1
    return fault


@compilable
def _keep_as(row: Any, other: Any) -> None:
    for i in range(COLUMNS):
        row[i] = other[i]


@compilable
def note_step(x: Any, time: float, w: Vec3) -> None:
    """Note a step of the gyro to a reading ``w`` [rad/s, FRD] of ``time`` [s], if it is one.

    Nothing but a blow turns a body so suddenly. What goes and comes back soon is none in sum.
    """
    a, b, c = w[0] - x.newest[3], w[1] - x.newest[4], w[2] - x.newest[5]
    change = math.sqrt(a * a + b * b + c * c)
    if not math.isfinite(change):
        return
    usual = max(_STEP, _STEP_SHAKEN * x.shaken)
    x.shaken += _SHAKEN_SHARE * (min(change, usual) - x.shaken)
    if change <= usual:
        return
    kept = 1.0 if time - x.stepped <= STEPS_APART else 0.0
    x.step[0] = kept * x.step[0] + a
    x.step[1] = kept * x.step[1] + b
    x.step[2] = kept * x.step[2] + c
    x.largest_step = max(kept * x.largest_step, change)
    x.stepped = time


@compilable
def _model_what_is_lost(row: Any, last: Any, lost: int, model: Vec3) -> None:
    """What rotors make of the reading before, in place of those halves that are ``lost``."""
    if lost & NO_FORCE:
        row[FORCE], row[FORCE + 1], row[FORCE + 2] = 0.0, 0.0, -model[2]
    if lost & NO_RATE:
        dt = row[TIME] - last[TIME]
        row[RATE] = last[RATE] + dt * model[0]
        row[RATE + 1] = last[RATE + 1] + dt * model[1]
        row[RATE + 2] = last[RATE + 2]


@compilable
def _note_claim(x: Any, doubted: int, time: float, w: Vec3, flown: Vec3, said: bool) -> None:
    """Note a reading ``w`` [rad/s, FRD] of a gyro that has jumped, if it has ``said`` something.

    Before it ``doubted`` was so many, at ``time`` [s], and ``flown`` [rad/s, FRD] is kept of it.
    """
    if doubted == 0:
        open_claim(x)
    elif not said or (x.steady[1] == 0 and time - x.claim_time > _BLOW):
        forget_claim(x)
    if said:
        add_claim(x, time, w, flown)


@compilable
def _fault(x: Any, half: int, reading: Vec3, most: float, jump: float, flies: bool) -> int:
    """What is wrong with one half of a reading; counts what comes in a row.

    Of a gyro that ``flies``, that it is steady is not enough: see ``claim.py``.
    """
    last, at = x.imu[(x.end - 1) % IMU_CAPACITY], 3 * half
    if not math.isfinite(reading[0] + reading[1] + reading[2]):
        x.steady[half] = 0
        return _NOT_FINITE
    size, change, stray = 0.0, 0.0, 0.0
    for i in range(3):
        size = max(size, abs(reading[i]))
        change = max(change, abs(reading[i] - x.newest[at + i]))
        stray = max(stray, abs(reading[i] - last[FORCE + at + i]))
        x.newest[at + i] = reading[i]
    if size > most:
        x.steady[half] = 0
        return _IMPLAUSIBLE
    if x.end == 0:
        return _NONE
    x.same[half] = x.same[half] + 1 if change == 0.0 else 0
    x.steady[half] = x.steady[half] + 1 if change <= jump else 0
    if flies and x.doubted[half] > 0:
        if x.doubted[half] == STAYS and _is_back(x, reading, jump):
            x.doubted[half], x.calm[half] = 0, 0
    else:
        x.doubted[half], x.calm[half] = doubt(
            x.doubted[half], x.steady[half], x.calm[half], stray > jump
        )
    if x.doubted[half] > 0:
        return _JUMP
    return _STUCK if x.same[half] >= STUCK_READINGS else _NONE


@compilable
def _is_back(x: Any, reading: Vec3, jump: float) -> bool:
    """Whether the gyro's ``reading`` [rad/s, FRD] is what is flown, its own bias taken off."""
    last = x.imu[(x.end - 1) % IMU_CAPACITY]
    stray = 0.0
    for i in range(3):
        bias = x.gyro_bias[i] - x.kept_bias[3 + i] if x.lost & NO_RATE else 0.0
        stray = max(stray, abs(reading[i] - last[RATE + i] + bias))
    return stray <= _BACK * jump


@compilable
def doubt(doubted: int, steady: int, calm: int, far: bool) -> tuple[int, int]:
    """How many ``steady`` readings in a row it takes to be believed (0: it is), and new ``calm``.

    ``doubted`` is that of the last reading, ``calm`` how many were believed since one was not, and
    ``far`` whether this one is too far from what is believed.
    """
    if doubted > 0:
        if steady >= doubted or (doubted == STAYS and not far):
            return 0, 0
        return doubted, calm
    if far:
        return (STAYS if calm >= CALM else STAYS_LONG), 0
    return 0, min(calm + 1, CALM)
