"""Readings of the IMU on their way into the filter: what is wrong with one, and what stands in.

Accelerometer and gyro are judged each for itself. A reading far from the last good one is not
believed. What jumps once is believed again as soon as it is back. On the ground so is what stays
where it jumped to: vehicles are carried about. In flight that is for ``verdict.py`` to say,
which also tells which half is out, and which may be wrong.
"""

from __future__ import annotations

import math
from typing import Any, Final

from fsw.autopilot.estimation.error_state import (
    COLUMNS,
    FORCE,
    FORCE_MADE,
    IMU_CAPACITY,
    LOST,
    MISSED,
    MODELLED,
    NO_FORCE,
    NO_RATE,
    NOTHING,
    RATE,
    RATE_MADE,
    TIME,
)
from fsw.autopilot.estimation.faults.sensor_fault import SensorFault
from fsw.autopilot.geometry.vectors import clamp
from fsw.autopilot.signals import Vec3, Vec4
from fsw.compiled import compilable

TIME_TOLERANCE: Final = 0.002  # s, by which a reading may be ahead of the tick
IMU_TOO_OLD: Final = 0.03  # s; what the vehicle did so long ago says nothing about its rates now
IMU_SILENT: Final = 0.008  # s, longer than jitter: from then on the rotors' model stands in
# Equal to the last bit, in a row: noise of three axes never is, that of one by chance for a while.
STUCK_READINGS: Final = 5
_STUCK_AXIS: Final = 50
# Steady readings in a row until what has jumped is the truth: of one that was calm, and of others.
STAYS: Final = 3
STAYS_LONG: Final = 25
_BACK: Final = 0.5  # of a jump: so near to what is flown, a half has come back to it
BLOW: Final = 25  # readings: what is felt as a blow is over by then
CALM: Final = 250  # readings that were believed, in a row
# Plain numbers: kernels return them.
NONE: Final = SensorFault.NONE.value
_NOT_FINITE: Final = SensorFault.NOT_FINITE.value
_IMPLAUSIBLE: Final = SensorFault.IMPLAUSIBLE.value
_FUTURE: Final = SensorFault.FUTURE.value
REPEATED: Final = SensorFault.REPEATED.value
_STUCK: Final = SensorFault.STUCK.value
JUMP: Final = SensorFault.JUMP.value


@compilable
def add_imu(x: Any, law: Any, now: float, time: float, f: Vec3, w: Vec3, model: Vec4) -> int:
    """Keep a reading of ``time`` [s] that came at ``now`` [s]; returns what is wrong with it.

    ``f`` [m/s^2, FRD] and ``w`` [rad/s, FRD]. In place of what is of no use, the last good one is
    kept, or it goes on as the rotors make it: of the ``model`` [SI, FRD], angular accelerations,
    and the specific force along -z, which is 0 where it is not known. A reading whose time is of no
    use is not kept at all. Numbers of ``SensorFault``.
    """
    last = x.imu[(x.end - 1) % IMU_CAPACITY]
    if not time <= now + TIME_TOLERANCE:
        return _FUTURE
    if x.end > 0 and time <= last[TIME]:
        return REPEATED
    flies = model[3] > 0.0
    of_force = _fault(x, 0, f, law.accel_range, law.accel_jump, flies)
    of_rate = _fault(x, 1, w, law.gyro_range, law.gyro_jump, flies)
    keep_force, keep_rate = of_force in (NONE, _STUCK), of_rate in (NONE, _STUCK)
    fault = of_force if of_force != NONE else of_rate
    if x.end == 0 and not (keep_force and keep_rate):
        return fault
    row = x.imu[x.end % IMU_CAPACITY]
    lost = (0 if of_force == NONE else NO_FORCE) | (0 if of_rate == NONE else NO_RATE)
    lost |= x.out
    modelled = flies and x.end > 0
    # Of what may be wrong the reading is used, and the bias may be anything: on the ground too it
    # walks no faster than by what has shown.
    doubtful = lost | (x.suspect & NOTHING)
    if doubtful and (modelled or not lost):
        doubtful |= MODELLED | (FORCE_MADE if lost & NO_FORCE else 0)
    row[TIME], row[LOST] = time, float(doubtful)
    for i in range(3):
        row[FORCE + i] = f[i] if keep_force else last[FORCE + i]
        row[RATE + i] = w[i] if keep_rate else last[RATE + i]
    if modelled and lost:
        _model_what_is_lost(x, row, last, lost, model)
    _count_rate(x, row, last, modelled and lost & NO_RATE != 0, keep_rate)
    since = min(time - last[TIME], law.imu_gap)
    row[MISSED] = _missed(x, 0, f, law.accel_range, row, since, of_force)
    row[MISSED + 1] = _missed(x, 1, w, law.gyro_range, row, since, of_rate)
    if x.end == 0:
        for i in range(COLUMNS):
            last[i] = row[i]  # what goes before the first reading
    x.end += 1
    if x.end - x.first >= IMU_CAPACITY:  # the filter has not begun
        x.first += 1
    return fault


@compilable
def _missed(
    x: Any, half: int, reading: Vec3, most: float, row: Any, since: float, fault: int
) -> float:
    """Variance of velocity or attitude that a ``reading`` of one half adds as it is refused [SI].

    A blow is refused as a jump, and yet it moves the vehicle: by up to the integral of what is
    refused, of which the unit shows ``most`` [SI], in ``since`` [s]. It ends within ``BLOW``
    readings. What lasts is a fault, and ``faults/verdict.py`` says which.
    """
    refused = fault in (JUMP, _IMPLAUSIBLE)
    x.refused[half] = x.refused[half] + 1 if refused else 0
    already, after = 0.0, 0.0
    for i in range(3 * half, 3 * half + 3):
        already += x.missed[i] * x.missed[i]
        if not refused:
            x.missed[i] = 0.0
        elif x.refused[half] <= BLOW:
            shown = clamp(reading[i - 3 * half], -most, most)
            x.missed[i] += since * (shown - row[FORCE + i])
        after += x.missed[i] * x.missed[i]
    return max(after - already, 0.0)


@compilable
def _model_what_is_lost(x: Any, row: Any, last: Any, lost: int, model: Vec4) -> None:
    """What rotors make of the reading before, in place of those halves that are ``lost``.

    With the force across that has lately been felt beside theirs: wind, and the accelerometer's
    bias. Along z their lift knows it.
    """
    if lost & NO_FORCE:
        kept = (x.kept_bias if x.lost & NO_FORCE else x.bias)[2]
        for i in range(3):
            lift = (1.0 + x.baseline[9]) * model[3]
            row[FORCE + i] = kept - lift if i == 2 else x.baseline[6 + i]
    if lost & NO_RATE:
        dt = row[TIME] - last[TIME]
        for i in range(3):
            row[RATE + i] = last[RATE + i] + dt * model[i]


@compilable
def _count_rate(x: Any, row: Any, last: Any, made: bool, reads: bool) -> None:
    """Note whether the rate in a ``row`` is ``made``; what is in doubt, and ``reads``, follows it.

    What rotors make runs away, and the bias with it: with a joint that hung limp by 31 rad/s. The
    difference of both is the rate, and it neither jumps nor is turned by this. What is in no doubt
    has a zero of its own (``error_state.mean_of``).
    """
    was_made = int(last[LOST]) & RATE_MADE != 0
    if made or (was_made and not reads):
        row[LOST] += RATE_MADE
    elif was_made and int(row[LOST]) & NO_RATE:
        for i in range(3):
            off = row[RATE + i] - last[RATE + i]
            x.bias[3 + i] += off
            for k in range(max(x.first - 1, x.end - IMU_CAPACITY + 1), x.end):
                x.imu[k % IMU_CAPACITY, RATE + i] += off


@compilable
def _fault(x: Any, half: int, reading: Vec3, most: float, jump: float, flies: bool) -> int:
    """What is wrong with one half of a reading; counts what comes in a row.

    Of a unit that ``flies``, that it is steady is not enough: see ``faults/verdict.py``.
    """
    last, at = x.imu[(x.end - 1) % IMU_CAPACITY], 3 * half
    if not math.isfinite(reading[0] + reading[1] + reading[2]):
        x.steady[half] = 0
        return _NOT_FINITE
    size, change, stray = 0.0, 0.0, 0.0
    for i in range(3):
        size = max(size, abs(reading[i]))
        moved = abs(reading[i] - x.newest[at + i])
        x.same[at + i] = x.same[at + i] + 1 if moved == 0.0 else 0
        change = max(change, moved)
        stray = max(stray, abs(reading[i] - last[FORCE + at + i]))
        x.newest[at + i] = reading[i]
    if size > most:
        x.steady[half] = 0
        return _IMPLAUSIBLE
    if x.end == 0:
        return NONE
    x.steady[half] = x.steady[half] + 1 if change <= jump else 0
    if flies and x.doubted[half] > 0 and not x.believed & (1 << half):
        if x.doubted[half] == STAYS and _is_back(x, half, reading, jump):
            x.doubted[half], x.calm[half] = 0, 0
    else:
        x.doubted[half], x.calm[half] = doubt(
            x.doubted[half], x.steady[half], x.calm[half], stray > jump
        )
    if x.doubted[half] > 0:
        return JUMP
    return _STUCK if is_stuck(x.same, half) else NONE


@compilable
def is_stuck(same: Any, half: int) -> bool:
    """Whether a half of the unit repeats itself, or one axis of it for longer."""
    a, b, c = same[3 * half], same[3 * half + 1], same[3 * half + 2]
    stuck: bool = min(a, b, c) >= STUCK_READINGS or max(a, b, c) >= _STUCK_AXIS
    return stuck


@compilable
def _is_back(x: Any, half: int, reading: Vec3, jump: float) -> bool:
    """Whether a ``reading`` [SI, FRD] of one half is what is flown, its own bias taken off."""
    last, at = x.imu[(x.end - 1) % IMU_CAPACITY], 3 * half
    stray = 0.0
    for i in range(3):
        bias = x.bias[at + i] - x.kept_bias[at + i]
        if not x.lost & (NO_RATE if half else NO_FORCE):
            bias = 0.0
        stray = max(stray, abs(reading[i] - last[FORCE + at + i] + bias))
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
