"""The filter's machine code: what the estimator calls, each once for a reading or a tick."""

from __future__ import annotations

import math
import struct
from typing import Any

from numpy.typing import NDArray

from fsw.autopilot.estimation import fusion, imu, joint_filter
from fsw.autopilot.estimation.error_state import (
    BA,
    BARO,
    BG,
    DELAY,
    ERRORS,
    FRAME,
    IMU_CAPACITY,
    LOST,
    RATE,
    TH,
    TIME,
    Array,
    Filter,
    Law,
    P,
    V,
    add_noise,
    advance,
    carry,
    integrated,
    mean_of,
    present,
    propagate,
    transition,
    varies,
)
from fsw.autopilot.estimation.faults import residuals
from fsw.autopilot.estimation.faults.encoder_watch import encoders_stuck, watch_encoders
from fsw.autopilot.geometry.rotation import matrix_from_quaternion, yaw_of
from fsw.autopilot.geometry.vectors import dot, four, put_four, put_three, three
from fsw.autopilot.model.airframe import GRAVITY
from fsw.autopilot.signals import JointVector, Mat3, Vec3, Vec4
from fsw.autopilot.tick_record import Estimate, Expected
from fsw.compiled import compilable, kernel, machine_code
from fsw.record import JOINTS as JOINT_CAPACITY
from fsw.record import PerJoint, Record, Three, per_joint

# What ``tick`` does, in this order.
PUSH, JOINTS, READING, ADVANCE, END = 1, 2, 4, 8, 16
# What came of it.
FAULT, FINITE, STUCK = 1, 2, 4


class Asked(Record):
    """What the filter is asked to do in one call, and what it found."""

    t_us: int  # now
    dt: float  # s, length of the tick
    expected: Expected
    encoders: PerJoint  # rad
    encoders_age: float  # s
    time: float  # s, of a reading of the IMU
    force: Three  # m/s^2, FRD
    rate: Three  # rad/s, FRD
    of_imu: int  # what is wrong with that, as ``SensorFault``
    of_encoders: int
    present: Estimate

    def begin(self, now: float, dt: float, expected: Expected | None) -> None:
        """A tick of ``dt`` [s] that ends ``now`` [s]; commands make of it what is ``expected``.

        None: the call itself finds out what is.
        """
        _TICK.pack_into(self.memory, 0, round(1e6 * now), dt)
        if expected is not None:
            self.memory[_EXPECTED] = expected.memory

    def read_joints(self, angles: JointVector, age: float) -> None:
        """What encoders say: ``angles`` [rad] that are ``age`` [s] old."""
        _ENCODERS[len(angles)].pack_into(self.memory, _ENCODERS_AT, *angles, age)

    def read(self, time: float, force: Vec3, rate: Vec3) -> None:
        """What the IMU says: ``time`` [s], ``force`` [m/s^2, FRD] and ``rate`` [rad/s, FRD]."""
        _READING.pack_into(self.memory, _READING_AT, time, *force, *rate)


_TICK = struct.Struct("<qd")
_EXPECTED = slice(Asked.place("expected"), Asked.place("encoders"))
_ENCODERS = [struct.Struct(f"<{per_joint(n)}d") for n in range(JOINT_CAPACITY + 1)]
_ENCODERS_AT = Asked.place("encoders")
_READING = struct.Struct("<7d")
_READING_AT = Asked.place("time")
PRESENT_AT = Asked.place("present")


@kernel
def tick(
    filters: Filter, law: Law, requests: NDArray[Any], parts: int, now: float, until: float
) -> int:
    """Do some ``parts`` [1] of a tick by one of ``requests`` (1,) [SI].

    Until ``now`` [s], or the filter's own time is ``until`` [s].
    """
    return run_filter(filters[0], law[0], requests[0], parts, now, until)


@compilable
def run_filter(x: Any, t: Any, a: Asked, parts: int, now: float, until: float) -> int:
    """Do some ``parts`` [1] of a tick as asked; what came of it.

    ``PUSH``: note what torques made of the joints; take in encoders, unless they are ``STUCK``:
    joints then follow from torques; take in a reading of the IMU; ``ADVANCE`` ``until`` [s]; and at
    the ``END`` predict the present ``now`` [s] from there, which may be no number.
    """
    e = a.expected
    model = four(e.model)
    a.of_imu, a.of_encoders, stuck = 0, 0, False
    if parts & JOINTS:
        was_stuck = encoders_stuck(x)
        stuck = watch_encoders(x, a.encoders, e)
        if stuck and not was_stuck:
            # An arm that stands still where the reading is, and nothing disturbs it.
            joint_filter.begin(x, t, now - a.encoders_age, a.encoders)
    if parts & PUSH:
        joint_filter.push(x, t, now, a.dt, e.u)
    if parts & JOINTS and not stuck:
        a.of_encoders = joint_filter.read(x, t, now, a.encoders, a.encoders_age)
    if parts & READING:
        f, w = three(a.force, 0), three(a.rate, 0)
        a.of_imu = imu.add_imu(x, t, now, a.time, f, w, model)
    found = (FAULT if a.of_imu or a.of_encoders else 0) | (STUCK if stuck else 0)
    if parts & ADVANCE:
        advance(x, t, until)
    if parts & END:
        a.present.t_us = a.t_us
        finite, R = _predict(x, now, a.present)
        if finite:
            found |= FINITE
        if a.dt > 0.0:
            residuals.witness(x, R, a.dt, model, three(e.pushed, 0))
    return found


@compilable
def _predict(x: Any, now: float, known: Estimate) -> tuple[bool, Mat3]:
    """Write the present; whether it has numbers and variances, and its rotation."""
    p, v, q, rate, force = present(x, now)
    joint_filter.present_joints(x, now, known.q_arm, known.qd_arm)
    R = matrix_from_quaternion(q)
    total = p[0] + p[1] + p[2] + v[0] + v[1] + v[2] + R[0] + rate[0] + rate[1] + rate[2] + force[2]
    for i in range(x.joint_count):
        total += known.q_arm[i] + known.qd_arm[i]
    finite = math.isfinite(total)
    put_three(known.p_WB, 0, p)
    put_three(known.v_WB, 0, v)
    put_three(known.w_WB_B, 0, rate)
    for i in range(9):
        known.R_WB[i] = R[i]
    known.yaw, known.specific_force = yaw_of(R), -force[2]
    return finite and varies(x), R


@machine_code
@kernel
def set_joints(x: Filter, law: Law, time: float, angles: JointVector) -> None:
    """Start from an arm that stands still at a ``time`` [s].

    Its ``angles`` [rad] are as many as a record has room for.
    """
    joint_filter.begin(x[0], law[0], time, angles)


@machine_code
@kernel
def begin(
    x: Filter,
    law: Law,
    time: float,
    p: Vec3,
    v: Vec3,
    q: Vec4,
    p_variance: Vec3,
    v_variance: Vec3,
    q_variance: Vec3,
) -> None:
    """Start the filter from a known state of ``time`` [s]; earlier readings are passed over.

    ``p`` [m, NED], ``v`` [m/s, NED], ``q`` [1]; ``p_variance`` [m^2, NED], ``v_variance``
    [m^2/s^2, NED], ``q_variance`` [rad^2, FRD].

    Where the first reading came later than the state, the filter begins with that reading: until
    then the vehicle moved as it did, but for what is not known of its velocity and its turning. To
    take the first reading, with all its vibration, for those before it would make up a velocity.
    """
    s, t = x[0], law[0]
    M = s.covariance
    M[:], s.bias[:] = 0.0, 0.0
    for i in range(3):
        s.p[i], s.v[i], s.acceleration[i] = p[i], v[i], 0.0
        M[P + i, P + i] = p_variance[i]
        M[V + i, V + i] = v_variance[i]
        M[TH + i, TH + i] = q_variance[i]
        M[BA + i, BA + i] = t.accel_bias * t.accel_bias
        M[BG + i, BG + i] = t.gyro_bias * t.gyro_bias
    put_four(s.q, q)
    M[BARO, BARO] = t.barometer.bias * t.barometer.bias
    M[DELAY, DELAY] = t.pose.delay_sigma * t.pose.delay_sigma
    s.baro_bias, s.pose_delay, s.lost = 0.0, t.pose.delay, 0
    s.noise_scale[fusion.POSE] = t.pose.noise_at_start * t.pose.noise_at_start
    s.noise_by_lag[fusion.POSE, 0] = s.noise_scale[fusion.POSE]
    s.time = time - t.pose.delay
    while s.first < s.end - 1 and s.imu[s.first % IMU_CAPACITY, TIME] <= s.time:
        s.first += 1
    before = s.imu[(s.first - 1) % IMU_CAPACITY]
    for i in range(3):
        s.rate[i] = before[4 + i]
    missed = before[TIME] - s.time
    if missed > t.imu_gap:
        s.time = before[TIME]
        for i in range(3):
            s.p[i] += missed * v[i]
            M[P + i, V + i] = M[V + i, P + i] = missed * v_variance[i]
            M[P + i, P + i] += missed * missed * v_variance[i]
            turned = missed * before[RATE + i]
            M[TH + i, TH + i] += turned * turned


@machine_code
@kernel
def couple_level(x: Filter, law: Law) -> None:
    """What is wrong with an attitude that the accelerometer gave is what is wrong with it.

    With d the vertical in body axes, a bias b turns it by -(d x b) / g.
    """
    s = x[0]
    M, R = s.covariance, matrix_from_quaternion(four(s.q))
    g, variance = GRAVITY, law[0].accel_bias * law[0].accel_bias
    a, b, c = R[6] / g, R[7] / g, R[8] / g
    rows = ((0.0, c, -b), (-c, 0.0, a), (b, -a, 0.0))
    for i in range(3):
        for j in range(3):
            M[TH + i, BA + j] = rows[i][j] * variance
            M[BA + j, TH + i] = rows[i][j] * variance
            M[TH + i, TH + j] += dot(rows[i], rows[j]) * variance


@machine_code
@kernel
def present_covariance(x: Filter, law: Law, now: float, M: Array, X: Array) -> None:
    """Write the covariance ``M`` (17, 17) [SI] at ``now`` [s] and a frame's ``X`` (17, 4) [SI]."""
    s, t = x[0], law[0]
    for i in range(ERRORS):
        for j in range(ERRORS):
            M[i, j] = s.covariance[i, j]
        for j in range(FRAME):
            X[i, j] = s.shared[i, j]
    q, time = four(s.q), s.time
    p, v = three(s.p, 0), three(s.v, 0)
    for k in range(s.first - 1, s.end):
        row = s.imu[k % IMU_CAPACITY]
        end = s.imu[(k + 1) % IMU_CAPACITY, TIME] if k + 1 < s.end else now
        f, w = mean_of(s, row, row)
        dt = end - time
        if dt > 0.0:
            blocks = transition(matrix_from_quaternion(q), f, w, dt)
            propagate(M, blocks, dt)
            carry(X, blocks, dt)
            add_noise(M, t, dt, int(row[LOST]), s.model_walk)
            p, v, q, _ = integrated(p, v, q, f, w, dt)
            time = end
