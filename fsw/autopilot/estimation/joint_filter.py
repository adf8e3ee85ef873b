r"""Rates of the arm's joints, from encoders and the torque that is applied.

Encoders have no rate, and the difference of two readings of 1.5 mrad resolution 2 ms apart is off
by 0.7 rad/s. For each joint a Kalman filter of angle, rate and a disturbing acceleration,

.. math:: \ddot\theta = u + d, \quad \dot d = w,

whose input u is the acceleration that the model of the arm gives for the torques. All joints have
the same covariance, because they are read together.

A reading tells of the past. The state stays at the time of the newest one, and a ring keeps what
torques have made of the joints since; the present follows from both. So readings may be late, or
few. One that is far from what is expected is not believed (``imu.doubt``). One that has leapt, as
no joint can, and then follows the joint again has another zero. A joint whose drive is dead gets to
tens of radians a second, step by step, until an end stop throws it back.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

from fsw.autopilot.estimation.error_state import PUSHES
from fsw.autopilot.estimation.faults.sensor_fault import SensorFault
from fsw.autopilot.estimation.fusion import followed
from fsw.autopilot.estimation.imu import JUMP, NONE, REPEATED, doubt
from fsw.autopilot.geometry.vectors import clamp
from fsw.autopilot.signals import JointVector
from fsw.compiled import compilable
from fsw.record import Floats

ENCODERS_TOO_OLD: Final = 0.05  # s; what torques made of the joints since is too uncertain
_RATE_AT_START: Final = 1.0  # rad/s, standard deviation
_DISTURBANCE_AT_START: Final = 30.0  # rad/s^2
# How far a reading may be from what is expected, besides this many standard deviations; friction
# has held a joint for 0.05 rad.
_FAR: Final = 0.1  # rad
_SIGMAS: Final = 6.0
_MAX_SIGMA: Final = 0.03  # rad; of a wider one garbage would pass
# By what differences of surprises are beyond which are expected, the variance of readings grows;
# one step of an encoder does not make it.
_SCALE_FROM: Final = 4.0
_SCALE_LIMIT: Final = 1e4  # of the variance
# By how much a joint moves from one reading to the next, with the noise of both, beside what it did
# before: one without torque gains up to 6 rad/s in 2 ms.
_FASTEST: Final = 10.0  # rad/s
_SWINGS: Final = 50.0  # rad/s; 47 was the most that a joint without torque swung at
_NEAR: Final = 0.02  # rad
_TOO_OLD: Final = SensorFault.TOO_OLD.value


class JointState(NamedTuple):
    """What the filter believes of one joint."""

    angle: float  # rad
    rate: float = 0.0  # rad/s
    disturbance: float = 0.0  # rad/s^2


@compilable
def predicted(joint: JointState, u: float, dt: float) -> JointState:
    """A joint ``dt`` [s] later, accelerated by ``u`` [rad/s^2]."""
    a = u + joint.disturbance
    return JointState(
        joint.angle + dt * (joint.rate + 0.5 * dt * a), joint.rate + dt * a, joint.disturbance
    )


@compilable
def push(x: Any, law: Any, now: float, dt: float, u: Floats) -> None:
    """Joints of ``x`` were accelerated by ``u`` (j,) [rad/s^2] for ``dt`` [s] until ``now`` [s]."""
    last = x.pushes[(x.pushes_end - 1) % PUSHES, 0] if x.pushes_end > 0 else x.joint_time
    # What was missed is as if it had not been.
    x.joint_time += max(now - last - dt, 0.0)
    if x.pushes_end - x.pushed >= PUSHES - 1:
        _advance(x, law, x.pushes[x.pushed % PUSHES, 0])
    row = x.pushes[x.pushes_end % PUSHES]
    row[0] = now
    for i in range(x.joint_count):
        row[1 + i] = u[i]
    x.pushes_end += 1


@compilable
def read(x: Any, law: Any, now: float, angles: Floats, age: float) -> int:
    """Take in ``angles`` (j,) [rad], ``age`` [s] old at ``now`` [s]; returns what is wrong.

    The ``angles`` are written: they become those against the zero that is believed.
    """
    time, before = now - age, x.encoders_read
    if not time > before:
        return REPEATED
    _note_reading(x, angles, min(time - before, 1.0))
    x.encoders_read = time
    if time < x.joint_time:  # older than what the ring reaches back to
        return _TOO_OLD
    _advance(x, law, time)
    _take_off_zero(x, angles)
    far, before_it = _is_far(x, angles), x.encoder_doubted
    if far and not x.encoder_leapt > 0.0:
        # No reading has leapt since one was believed: the joint moves as torques do not make it.
        begin(x, law, time, angles, at_rest=False)
        far = False
    x.encoder_doubted, x.encoder_calm = doubt(
        x.encoder_doubted, x.encoder_steady, x.encoder_calm, far
    )
    if x.encoder_doubted > 0:
        return JUMP
    if before_it > 0 and far:
        _move_zero(x)
        _take_off_zero(x, angles)
    x.encoder_leapt, x.encoder_leap[:] = 0.0, 0.0
    if before_it > 0 and _is_far(x, angles):
        begin(x, law, time, angles)
    else:
        _correct(x, law, angles)
    return NONE


@compilable
def _note_reading(x: Any, angles: Floats, apart: float) -> None:
    """Whether ``angles`` have leapt since the last reading, ``apart`` [s] before."""
    steady = True
    for i in range(x.joint_count):
        if not abs(angles[i] - x.encoders[i]) <= _furthest(x, i, apart):
            steady = False
    if steady:
        x.encoder_steady += 1
    else:
        x.encoder_steady, x.encoder_leapt = 0, x.encoder_leapt + apart
    for i in range(x.joint_count):
        step = angles[i] - x.encoders[i]
        if steady:
            x.encoder_rate[i] = step / apart
        else:
            x.encoder_leap[i] += step
        x.encoders[i] = angles[i]


@compilable
def _furthest(x: Any, joint: int, seconds: float) -> float:
    """By how much a ``joint`` can have moved in some ``seconds`` [s] since it was read [rad]."""
    rate = min(abs(float(x.encoder_rate[joint])), _SWINGS)
    return _NEAR + (_FASTEST + rate) * seconds


@compilable
def _take_off_zero(x: Any, angles: Floats) -> None:
    """The newest reading against the zero that is believed. Writes angles."""
    for i in range(x.joint_count):
        angles[i] = x.encoders[i] - x.encoder_zero[i]


@compilable
def _is_far(x: Any, angles: Floats) -> bool:
    """Whether a reading is farther from what is expected than the filter may be wrong."""
    sigma, stray = min(math.sqrt(x.joint_variance[0, 0]), _MAX_SIGMA), 0.0
    for i in range(x.joint_count):
        stray = max(stray, abs(angles[i] - x.joints[i, 0]))
    return stray > _FAR + _SIGMAS * sigma


@compilable
def _move_zero(x: Any) -> None:
    """Take what no joint can have moved in the time for a zero that has moved.

    What garbage has leapt adds up to how the joint has moved meanwhile.
    """
    for i in range(x.joint_count):
        if abs(x.encoder_leap[i]) > _furthest(x, i, x.encoder_leapt):
            x.encoder_zero[i] += x.encoder_leap[i]


@compilable
def begin(
    x: Any, law: Any, time: float, angles: JointVector | Floats, at_rest: bool = True
) -> None:
    """Start at ``time`` [s] from an arm at ``angles`` (j,) [rad].

    It hardly moves if it is ``at_rest``; else its rates are kept.
    """
    x.joint_time = time
    while x.pushed < x.pushes_end and x.pushes[x.pushed % PUSHES, 0] <= time:
        x.pushed += 1
    C = x.joint_variance
    C[:] = 0.0
    C[0, 0] = law.encoder_noise * law.encoder_noise
    C[1, 1] = _RATE_AT_START * _RATE_AT_START
    C[2, 2] = _DISTURBANCE_AT_START * _DISTURBANCE_AT_START
    for i in range(x.joint_count):
        x.joints[i, 0], x.joints[i, 2] = angles[i], 0.0
        if at_rest:
            x.joints[i, 1] = 0.0


@compilable
def present_joints(x: Any, now: float, angles: Floats, rates: Floats) -> None:
    """Write ``angles`` (j,) [rad] and ``rates`` (j,) [rad/s] of the joints at ``now`` [s]."""
    for i in range(x.joint_count):
        joint, t = JointState(x.joints[i, 0], x.joints[i, 1], x.joints[i, 2]), x.joint_time
        for k in range(x.pushed, x.pushes_end):
            row = x.pushes[k % PUSHES]
            dt = row[0] - t
            if dt > 0.0:
                joint, t = predicted(joint, row[1 + i], dt), row[0]
        angles[i], rates[i] = joint.angle, joint.rate


@compilable
def _advance(x: Any, law: Any, until: float) -> None:
    """Move the joints' state on, not beyond the last push."""
    while x.pushed < x.pushes_end:
        row = x.pushes[x.pushed % PUSHES]
        _move(x, law, row, min(row[0], until) - x.joint_time)
        if row[0] > until:
            return
        x.pushed += 1


@compilable
def _move(x: Any, law: Any, push: Floats, dt: float) -> None:
    if not dt > 0.0:
        return
    for i in range(x.joint_count):
        joint = JointState(x.joints[i, 0], x.joints[i, 1], x.joints[i, 2])
        after = predicted(joint, push[1 + i], dt)
        x.joints[i, 0], x.joints[i, 1] = after.angle, after.rate
    x.joint_time += dt
    C, h, q = x.joint_variance, 0.5 * dt * dt, law.joint_disturbance_walk
    # F C F^T + Q, with C symmetrical.
    for i in range(3):
        C[0, i] += dt * C[1, i] + h * C[2, i]
        C[1, i] += dt * C[2, i]
    for i in range(3):
        C[i, 0] += dt * C[i, 1] + h * C[i, 2]
        C[i, 1] += dt * C[i, 2]
    q *= q * dt
    C[0, 0] += q * h * h / 5.0
    C[0, 1] += q * h * dt / 4.0
    C[0, 2] += q * h / 3.0
    C[1, 1] += q * dt * dt / 3.0
    C[1, 2] += q * dt / 2.0
    C[2, 2] += q
    C[1, 0], C[2, 0], C[2, 1] = C[0, 1], C[0, 2], C[1, 2]


@compilable
def _correct(x: Any, law: Any, angles: Floats) -> None:
    C = x.joint_variance
    total = C[0, 0] + max(x.encoder_scale, 1.0) * law.encoder_noise * law.encoder_noise
    most = _SIGMAS * math.sqrt(total)  # of a reading that is just believed, and may be garbage
    g0, g1, g2 = C[0, 0] / total, C[1, 0] / total, C[2, 0] / total
    squared = 0.0
    for i in range(x.joint_count):
        surprise = angles[i] - x.joints[i, 0]
        more = surprise - x.encoder_surprise[i]
        squared, x.encoder_surprise[i] = max(squared, more * more / total), surprise
        # What is much as it was in the last reading, as noise is not, is motion, and taken in.
        limit = most + (abs(x.encoder_taken[i]) if abs(more) <= most else 0.0)
        surprise = clamp(surprise, -limit, limit)
        x.encoder_taken[i] = surprise
        x.joints[i, 0] += g0 * surprise
        x.joints[i, 1] += g1 * surprise
        x.joints[i, 2] += g2 * surprise
    x.encoder_scale = min(followed(x.encoder_scale, squared, _SCALE_FROM), _SCALE_LIMIT)
    c0, c1, c2 = C[0, 0], C[0, 1], C[0, 2]
    C[0, 0] -= g0 * c0
    C[0, 1] -= g0 * c1
    C[0, 2] -= g0 * c2
    C[1, 1] -= g1 * c1
    C[1, 2] -= g1 * c2
    C[2, 2] -= g2 * c2
    C[1, 0], C[2, 0], C[2, 1] = C[0, 1], C[0, 2], C[1, 2]
