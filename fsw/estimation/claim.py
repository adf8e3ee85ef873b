"""What a gyro claims that has jumped, until something that measures the attitude decides.

No rotor makes a body turn otherwise within 2 ms. Either something hit it, or the gyro is wrong for
good, and to be steady is no proof. So two turns are integrated from the jump on: that of what the
gyro says, and that of the rotors' model, which is flown meanwhile. An attitude that was measured
afterwards, or the field of the Earth in body axes, agrees with one of them. If it is not the
gyro's, the comparison begins anew, at that measurement: a gyro that is right again is believed.
"""

from __future__ import annotations

import math
from typing import Any, Final

from fsw.compiled import compilable
from fsw.estimation.error_state import (
    CLAIMS,
    IMU_CAPACITY,
    LOST,
    MODELLED,
    NO_RATE,
    RATE,
    TH,
    TIME,
    V,
    restore_bias,
    vec3,
    vec4,
)
from fsw.geometry.quaternion import conjugate, multiply, rotation_vector, turned
from fsw.geometry.rotation import matrix_from_quaternion, rotate_back
from fsw.signals import Vec3, Vec4

# Of the attitude, or of the field.
NO_START, START = 0, 1
_SIGMAS: Final = 5.0  # of both attitudes between which a turn is seen
_FIELD_SIGMAS: Final = 3.0  # of both fields, of which more than noise is counted
_SHARE: Final = 0.1  # of how far both turns are apart: scale, and when within a tick it was hit
_APART: Final = 3.0  # times the tolerance: then one measurement is enough
_LEAST: Final = 0.06  # s, after which one is, however little both are apart
_OFFSET: Final = 0.4  # rad/s, of a gyro, that is as large as noise by then
_WHOLE: Final = 3.0  # rad; farther apart, both may look alike again
# What is not known of a state that went on by the wrong turn.
_TURN: Final = 0.05  # rad
_SPEED: Final = 0.3  # m/s


@compilable
def open_claim(x: Any) -> None:
    """Begin with the attitude at the newest reading that is kept, which is believed."""
    forget_claim(x)
    q, t = vec4(x.q), x.time
    if not q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] > 0.5:
        return  # the filter has not begun
    last = x.imu[(x.first - 1) % IMU_CAPACITY]
    for k in range(x.first, x.end):
        row = x.imu[k % IMU_CAPACITY]
        h = 0.5 * (row[TIME] - t)
        q = turned(
            q,
            h * (row[RATE] + last[RATE] - 2.0 * x.gyro_bias[0]),
            h * (row[RATE + 1] + last[RATE + 1] - 2.0 * x.gyro_bias[1]),
            h * (row[RATE + 2] + last[RATE + 2] - 2.0 * x.gyro_bias[2]),
        )
        t, last = row[TIME], row
    add_claim(x, t, vec3(last, RATE), vec3(last, RATE))
    _start(x, t, q)


@compilable
def forget_claim(x: Any) -> None:
    """Begin anew with the next reading, at the next measurement."""
    x.claims, x.claim_started, x.field_started = 0, NO_START, NO_START


@compilable
def add_claim(x: Any, time: float, said: Vec3, flown: Vec3) -> None:
    """Note what the gyro ``said`` [rad/s, FRD] and what is ``flown`` [the same, FRD].

    Both are of ``time`` [s].
    """
    row = x.claim[x.claims % CLAIMS]
    row[0] = time
    for i in range(3):
        row[1 + i], row[4 + i] = said[i], flown[i]
    x.claims += 1


@compilable
def _start(x: Any, time: float, q: Vec4) -> None:
    x.claim_started, x.claim_time = START, time
    for i in range(4):
        x.claim_q[i] = q[i]


@compilable
def turns(x: Any, since: float, until: float) -> tuple[bool, Vec4, Vec4]:
    """How a body turns from ``since`` [s] to ``until`` [s] by what the gyro says, and as is flown.

    False: not all of it is known, or they are apart by so much that a whole turn would not show.
    What was said last is held.
    """
    said, flown = (1.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    first, lost, bias = max(0, x.claims - CLAIMS), x.lost & NO_RATE, x.gyro_bias
    b0, b1, b2 = bias[0], bias[1], bias[2]
    s0, s1, s2 = b0, b1, b2
    if lost:
        s0, s1, s2 = x.kept_bias[3], x.kept_bias[4], x.kept_bias[5]
    if x.claims == first or x.claim[first % CLAIMS, 0] > since + 1e-9:
        return False, said, flown
    apart = 0.0
    for k in range(first, x.claims):
        a = x.claim[k % CLAIMS]
        held = k + 1 == x.claims
        b = a if held else x.claim[(k + 1) % CLAIMS]
        begin, end = max(a[0], since), until if held else min(b[0], until)
        dt = end - begin
        if dt > 0.0:
            apart += dt * _gap((a[1] - s0, a[2] - s1, a[3] - s2), (a[4] - b0, a[5] - b1, a[6] - b2))
            said = turned(
                said,
                dt * (0.5 * (a[1] + b[1]) - s0),
                dt * (0.5 * (a[2] + b[2]) - s1),
                dt * (0.5 * (a[3] + b[3]) - s2),
            )
            flown = turned(
                flown,
                dt * (0.5 * (a[4] + b[4]) - b0),
                dt * (0.5 * (a[5] + b[5]) - b1),
                dt * (0.5 * (a[6] + b[6]) - b2),
            )
    return apart < _WHOLE, said, flown


@compilable
def judge_by_attitude(x: Any, time: float, q: Vec4, sigma: float) -> bool:
    """Whether an attitude ``q`` [1] measured at ``time`` [s] proves a gyro right that has jumped.

    ``sigma`` [rad] is the standard deviation about its worst axis. If it is, the readings since
    are put in place of those of the model.
    """
    if x.claim_started == NO_START:
        _start(x, time, q)
        return False
    known, said, flown = turns(x, x.claim_time, time)
    if not known:
        if time > x.claim_time:
            _start(x, time, q)
        return False
    seen = multiply(conjugate(vec4(x.claim_q)), q)
    of_said = _angle(multiply(conjugate(said), seen))
    of_flown = _angle(multiply(conjugate(flown), seen))
    apart = _angle(multiply(conjugate(said), flown))
    told = _told(time - x.claim_time, of_said, of_flown, apart, _SIGMAS * sigma)
    if told < 0:
        _start(x, time, q)
        x.field_started = NO_START
    if told <= 0 or x.steady[1] < x.doubted[1]:
        return False
    _believe(x, x.claim_time, vec4(x.claim_q))
    return True


@compilable
def judge_by_field(x: Any, noise: float, time: float, field: Vec3) -> bool:
    """The same by the Earth's ``field`` [Gauss, FRD] at ``time`` [s], known to ``noise`` [Gauss].

    It turns in body axes against the body. A turn about it is not seen.
    """
    size = math.sqrt(field[0] * field[0] + field[1] * field[1] + field[2] * field[2])
    known, said, flown = False, (1.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    if x.field_started:
        known, said, flown = turns(x, x.field_time, time)
    if not (known and size > noise):
        if not x.field_started or time > x.field_time:
            _start_field(x, time, field)
        return False
    by_said = rotate_back(matrix_from_quaternion(said), vec3(x.claim_field, 0))
    by_flown = rotate_back(matrix_from_quaternion(flown), vec3(x.claim_field, 0))
    of_said, of_flown = _gap(by_said, field) / size, _gap(by_flown, field) / size
    apart, sigma = _gap(by_said, by_flown) / size, noise / size
    told = _told(time - x.field_time, of_said, of_flown, apart, _FIELD_SIGMAS * sigma)
    if told < 0:
        _start_field(x, time, field)
    if told <= 0 or x.steady[1] < x.doubted[1]:
        return False
    if x.claim_started == START and turns(x, x.claim_time, time)[0]:
        _believe(x, x.claim_time, vec4(x.claim_q))
    else:
        _believe(x, math.inf, vec4(x.q))
    return True


@compilable
def _start_field(x: Any, time: float, field: Vec3) -> None:
    x.field_started, x.field_time = START, time
    for i in range(3):
        x.claim_field[i] = field[i]


@compilable
def _told(passed: float, of_said: float, of_flown: float, apart: float, off: float) -> int:
    """Whether a measurement tells that the gyro is right (1), that it is not (-1), or nothing (0).

    ``passed`` [s] since the beginning; how far what is seen is ``of_said`` [rad] from what the gyro
    said, ``of_flown`` [rad] from what is flown, and how far both are ``apart`` [rad]. One
    measurement is ``off`` [rad] by no more.
    """
    noise = math.sqrt(2.0) * off
    if apart < _APART * noise and passed < max(_LEAST, noise / _OFFSET):
        return 0
    right = of_said <= noise + _SHARE * apart
    if apart >= _APART * noise:
        right = right and of_said < of_flown
    return 1 if right else -1


@compilable
def _believe(x: Any, since: float, q: Vec4) -> None:
    """Put what the gyro said in place of the model, from ``since`` [s] on; attitude ``q`` there."""
    for k in range(x.first - 1, x.end):
        row = x.imu[k % IMU_CAPACITY]
        if int(row[LOST]) & NO_RATE:
            _restore(x, row)
    if x.lost & NO_RATE:
        for i in range(3, 6):
            restore_bias(x, x.covariance, i)
        x.lost &= ~NO_RATE
    if x.time > since:
        known, said, _ = turns(x, since, x.time)
        if known:
            there = multiply(q, said)
            for i in range(4):
                x.q[i] = there[i]
        M = x.covariance
        for i in range(3):
            M[TH + i, TH + i] += _TURN * _TURN
            M[V + i, V + i] += _SPEED * _SPEED
    x.doubted[1] = 0
    forget_claim(x)


@compilable
def _restore(x: Any, row: Any) -> None:
    for k in range(max(0, x.claims - CLAIMS), x.claims):
        one = x.claim[k % CLAIMS]
        if one[0] == row[TIME]:
            for i in range(3):
                row[RATE + i] = one[1 + i]
            lost = int(row[LOST]) & ~NO_RATE
            row[LOST] = float(0 if lost == MODELLED else lost)


@compilable
def _angle(q: Vec4) -> float:
    a, b, c = rotation_vector(q)
    return math.sqrt(a * a + b * b + c * c)


@compilable
def _gap(a: Vec3, b: Vec3) -> float:
    x, y, z = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return math.sqrt(x * x + y * y + z * z)
