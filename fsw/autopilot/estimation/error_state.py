r"""The error-state Kalman filter: nominal state, its prediction by the IMU, and a correction.

The nominal state is integrated from the IMU; the filter estimates its small error

.. math:: \delta x = (\delta p, \delta v, \delta\theta, \delta a_b, \delta\omega_b,
          \delta b, \delta\tau)

with the attitude's error in body axes, :math:`q_t = q \otimes \mathrm{Exp}(\delta\theta)`, the
biases of accelerometer and gyro, that of the barometer b, and the pose's further delay tau. A
correction moves the error into the nominal state.

The state lies a fixed time behind the present, so that measurements are fused at their own time.
The present follows from it by integrating the IMU's readings since (``present``).

Source: J. Solà, Quaternion kinematics for the error-state Kalman filter, 2017 (arXiv 1711.02508),
section 5; docs/decisions/0030-an-estimate-of-the-present.md.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.geometry.quaternion import turned
from fsw.autopilot.geometry.rotation import matrix_from_quaternion, rotate
from fsw.autopilot.geometry.vectors import add_scaled, cross, dot, four, put_four, three
from fsw.autopilot.model.airframe import GRAVITY
from fsw.autopilot.signals import Mat3, Vec3, Vec4
from fsw.compiled import compilable
from fsw.record import JOINTS

Array = NDArray[np.float64]
# Entries of the error.
P, V, TH, BA, BG, BARO, DELAY = 0, 3, 6, 9, 12, 15, 16
ERRORS: Final = 17
FRAME: Final = 4  # errors of an odometry's frame: north, east, down [m], heading [rad]
FIELD: Final = 3  # errors of a magnetometer that stay: its offset [Gauss, FRD]
ROWS: Final = 3  # of a measurement, at most
IMU_CAPACITY: Final = 256  # readings since the filter's time
# Columns of a reading: time [s], specific force [m/s^2] and rate [rad/s] in body axes, which of
# both are of no use: an older reading's, or one that repeats itself; and the variance of velocity
# [m^2/s^2] and of attitude [rad^2] that it adds because it was refused as a jump.
TIME, FORCE, RATE, LOST, MISSED, COLUMNS = 0, 1, 4, 7, 8, 10
NO_FORCE, NO_RATE, NOTHING = 1, 2, 3  # of LOST
ON_TRIAL = 8
CONTRADICTED = 32  # by more than what rotors that are off explain
NO_HEADING = 128  # the magnetometer is named: what turns forces into the world may be wrong
MODELLED = 4  # of LOST: where nothing is measured, it is what rotors make of the vehicle
# Of LOST: force, or rate, of this reading is that of the rotors' model.
FORCE_MADE, RATE_MADE = 16, 64
MADE_LASTS: Final = 0.5  # s, of what the rotors' model does not know of a force
WITNESS: Final = 29  # integrals: see faults/residuals.py
HEIGHT_LASTS: Final = 0.15  # s, for which a height counts as measured after it was
PUSHES: Final = 160  # ticks that the joints' state may lie behind
LAGS: Final = (4, 8, 16)  # measurements, over which noise is looked for that is no white one

FILTER: Final = np.dtype(
    [
        ("time", float),  # s, of the state
        ("height_time", float),  # s, at which a height was used last
        ("p", float, (3,)),  # m, NED
        ("v", float, (3,)),  # m/s, NED
        ("q", float, (4,)),  # body to NED
        ("bias", float, (6,)),  # of accelerometer [m/s^2] and gyro [rad/s], body
        ("baro_bias", float),  # m
        ("pose_delay", float),  # s
        ("covariance", float, (ERRORS, ERRORS)),
        ("rate", float, (3,)),  # rad/s, body, at the state's time
        ("acceleration", float, (3,)),  # m/s^2, NED, there
        ("imu", float, (IMU_CAPACITY, COLUMNS)),  # ring
        ("first", np.int64),  # of the readings after the state's time, counted from the start
        ("end", np.int64),  # behind the newest reading
        # Of accelerometer and gyro, in this order (imu.py).
        ("newest", float, (6,)),  # m/s^2 and rad/s, as they came, believed or not
        ("same", np.int64, (6,)),  # how often each number of the newest came in a row
        ("steady", np.int64, (2,)),  # how many in a row were near the one before
        ("calm", np.int64, (2,)),  # how many in a row were believed
        # Of those that were refused as a jump in a row: how many, and by what they differ from what
        # stands in, its integral.
        ("refused", np.int64, (2,)),
        ("missed", float, (6,)),  # m/s and rad, body
        ("doubted", np.int64, (2,)),  # how many steady ones it takes to be believed; 0: it is
        # Of the law for who is wrong (verdict.py): which halves are not used, and of which the
        # bias may be anything; what both and the rotors have made of the vehicle since it flies;
        # and how quickly a force [m/s^3/sqrt(Hz)] and a rate [rad/s^2/sqrt(Hz)] may be off that
        # the rotors' model gives, or is compared with.
        ("out", np.int64),
        ("suspect", np.int64),  # and ON_TRIAL where anything fires, CONTRADICTED
        ("believed", np.int64),  # halves whose jumps are the truth
        ("witness", float, (WITNESS,)),
        # SI: biases, what is felt beside the model, and the share of thrust that it does not know.
        ("baseline", float, (10,)),
        ("model_walk", float, (2,)),
        # By how much more than it states a pose's and a receiver's variance is, by lag and the
        # largest, and their last innovations: of each lag the last of which it took notice, and
        # by what that differed from the one before (fusion.py).
        ("noise_scale", float, (4,)),
        ("noise_by_lag", float, (4, 1 + len(LAGS))),
        ("innovated_last", float, (4, ROWS)),
        ("innovated_before", float, (4, len(LAGS), 2, ROWS)),
        ("innovations", np.int64, (4,)),  # how many there have been
        # By what share of its variance one differs from the next, up to 1; of those that lean one
        # way, each over its deviation, the sum, the last one, and what of that has leapt; and when
        # they did so plainly [s], 0: never.
        ("scatter", float, (4,)),
        ("leaning", float, (4, 3, ROWS)),
        ("leant_at", float),
        ("innovated_at", float, (4,)),  # s, of the last one
        # From when until when [s] poses were wrong that later ones have refuted, if there were any.
        ("refuted", float, (2,)),
        ("lost", np.int64),  # which halves of the state's own reading are of no use
        # Joints, at a time of their own (joint_filter.py), and what torques made of them since.
        ("joint_count", np.int64),  # of the vehicle
        ("turns", float, (4,)),  # by how much more than the paper's it turns: residuals.py
        # Of each: angle [rad], rate [rad/s] and disturbance [rad/s^2].
        ("joints", float, (JOINTS, 3)),
        ("joint_variance", float, (3, 3)),  # [SI], of each
        ("joint_time", float),  # s
        ("pushes", float, (PUSHES, 1 + JOINTS)),  # ring: up to a time [s], accelerations [rad/s^2]
        ("pushed", np.int64),  # the first of them after the joints' time, counted from the start
        ("pushes_end", np.int64),  # behind the last one
        # Encoders: the newest reading [rad] and its time [s], and as above.
        ("encoders", float, (JOINTS,)),
        ("encoders_read", float),
        # Whether they are stuck (faults/encoder_watch.py). Of each: readings in a row that were the
        # same, infinite of one that is stuck, what undid its joint's torque when they began [N m],
        # and by how much it had moved unseen [rad].
        ("encoder_repeats", float, (JOINTS,)),
        ("encoder_undone", float, (JOINTS,)),
        ("encoder_unseen", float, (JOINTS,)),
        ("encoder_steady", np.int64),
        ("encoder_calm", np.int64),
        ("encoder_doubted", np.int64),
        ("encoder_zero", float, (JOINTS,)),  # rad, by which readings have leapt so far
        ("encoder_rate", float, (JOINTS,)),  # rad/s, by the last reading that did not leap
        # Of what is doubted: how far readings have leapt [rad], and in which time [s].
        ("encoder_leap", float, (JOINTS,)),
        ("encoder_leapt", float),
        ("encoder_scale", float),  # by how much their variance is larger than stated
        ("encoder_surprise", float, (JOINTS,)),  # rad, of the last one that was believed
        ("encoder_taken", float, (JOINTS,)),  # rad, as much of it as was taken in
        # What is known of the biases while the readings are of no use.
        ("kept_bias", float, (6,)),
        ("kept_variance", float, (6,)),
        # Of the measurement that is being fused.
        ("H", float, (ROWS, ERRORS)),
        ("residual", float, (ROWS,)),
        ("variance", float, (ROWS,)),
        ("innovation", float, (2, ROWS)),  # of both parts of a measurement, as it came
        ("gain", float, (ERRORS, ROWS)),
        ("factor", float, (ROWS, ROWS)),
        ("error", float, (ERRORS,)),
        # Of an odometry's frame (drift.py): whether it drifts, and its covariance with the error.
        ("drifts", np.int64),
        ("shared", float, (ERRORS, FRAME)),
        ("innovated", float, (ROWS,)),
        # Of an offset (sensors/magnetometer.py): whether one was used, its covariance with the
        # error, and the slope over it of the heading that is being fused.
        ("compass", np.int64),
        ("with_offset", float, (ERRORS, FIELD)),
        ("offset_slope", float, (FIELD,)),
    ],
    align=True,
)
Filter = NDArray[Any]  # (1,) of FILTER
Law = NDArray[Any]  # (1,) of a packed EstimatorTuning


@compilable
def integrated(
    p: Vec3, v: Vec3, q: Vec4, f: Vec3, w: Vec3, dt: float
) -> tuple[Vec3, Vec3, Vec4, Vec3]:
    """Position, velocity, attitude ``dt`` [s] later, and the acceleration meanwhile.

    ``p`` [m, NED], ``v`` [m/s, NED], ``q`` [1]; specific force ``f`` [m/s^2, FRD] and rate ``w``
    [rad/s, FRD] are means over the step. Solà, eq 260, with the force turned by half the step.
    """
    half = 0.5 * dt
    ax, ay, az = rotate(matrix_from_quaternion(q), add_scaled(f, cross(w, f), half))
    a = (ax, ay, az + GRAVITY)
    placed = add_scaled(p, add_scaled(v, a, half), dt)
    return placed, add_scaled(v, a, dt), turned(q, dt * w[0], dt * w[1], dt * w[2]), a


@compilable
def transition(R: Mat3, f: Vec3, w: Vec3, dt: float) -> tuple[Mat3, Mat3, Mat3]:
    """Blocks of F, ``dt`` [s] long: velocity over attitude and bias, and attitude over attitude.

    ``R`` [1, body to NED] and the means ``f`` [m/s^2, FRD] and ``w`` [rad/s, FRD] are of the step.
    """
    # -R [f]x dt, Solà's slope of the velocity over the attitude, row by row.
    g = (dt * f[0], dt * f[1], dt * f[2])
    slope = (*cross(g, three(R, 0)), *cross(g, three(R, 3)), *cross(g, three(R, 6)))
    r00, r01, r02 = dt * R[0], dt * R[1], dt * R[2]
    r10, r11, r12 = dt * R[3], dt * R[4], dt * R[5]
    r20, r21, r22 = dt * R[6], dt * R[7], dt * R[8]
    x, y, z = dt * w[0], dt * w[1], dt * w[2]
    # Exp(-w dt) to second order.
    e00, e01, e02 = 1.0 - 0.5 * (y * y + z * z), z + 0.5 * x * y, -y + 0.5 * x * z
    e10, e11, e12 = -z + 0.5 * x * y, 1.0 - 0.5 * (x * x + z * z), x + 0.5 * y * z
    e20, e21, e22 = y + 0.5 * x * z, -x + 0.5 * y * z, 1.0 - 0.5 * (x * x + y * y)
    return (
        slope,
        (r00, r01, r02, r10, r11, r12, r20, r21, r22),
        (e00, e01, e02, e10, e11, e12, e20, e21, e22),
    )


@compilable
def carry(M: Array, blocks: tuple[Mat3, Mat3, Mat3], dt: float) -> None:
    """Replace ``M`` (17, n) [SI] by F M, with the ``blocks`` of F [SI], ``dt`` [s] later."""
    slope, by_bias, turn = blocks
    for j in range(M.shape[1]):
        t, b = (M[6, j], M[7, j], M[8, j]), (M[9, j], M[10, j], M[11, j])
        for i in range(3):
            M[P + i, j] += dt * M[V + i, j]
            M[V + i, j] += dot(three(slope, 3 * i), t) - dot(three(by_bias, 3 * i), b)
            M[TH + i, j] = dot(three(turn, 3 * i), t) - dt * M[BG + i, j]


@compilable
def propagate(M: Array, blocks: tuple[Mat3, Mat3, Mat3], dt: float) -> None:
    """Replace the covariance ``M`` (17, 17) [SI] by F M F^T, ``dt`` [s] later. Solà, eq 270.

    The ``blocks`` of F [SI] are those of ``transition``.
    """
    carry(M, blocks, dt)
    carry(M.T, blocks, dt)


@compilable
def add_noise(M: Array, law: Any, dt: float, lost: int, model_walk: Array) -> None:
    """Add to the covariance ``M`` (17, 17) [SI] what ``dt`` [s] of noise add. Solà, eq 261-265.

    Of what is ``lost`` [NO_FORCE, NO_RATE] the bias may be anything soon; where the rotors' model
    stands in, ``model_walk`` (2,) [m/s^3/sqrt(Hz), rad/s^2/sqrt(Hz)].
    """
    force = law.accel_noise * law.accel_noise * dt
    turn = law.gyro_noise * law.gyro_noise * dt
    lost_accel_walk, lost_gyro_walk = law.lost_accel_walk, law.lost_gyro_walk
    if lost & MODELLED:
        lost_accel_walk, lost_gyro_walk = model_walk[0], model_walk[1]
    accel_walk = lost_accel_walk if lost & NO_FORCE else law.accel_bias_walk
    gyro_walk = lost_gyro_walk if lost & NO_RATE else law.gyro_bias_walk
    for i in range(3):
        M[V + i, V + i] += force
        M[TH + i, TH + i] += turn
        M[BA + i, BA + i] += accel_walk * accel_walk * dt
        M[BG + i, BG + i] += gyro_walk * gyro_walk * dt
    M[BARO, BARO] += law.barometer.bias_walk * law.barometer.bias_walk * dt
    if law.pose.delay_sigma > 0.0:
        M[DELAY, DELAY] += law.pose.delay_walk * law.pose.delay_walk * dt


@compilable
def mean_of(x: Any, row: Array, before: Array) -> tuple[Vec3, Vec3]:
    """Mean force [m/s^2, FRD] and rate [rad/s, FRD] of two readings, without the biases.

    The readings are ``row`` (10,) [SI] and the one ``before`` (10,) [SI], or the same.
    """
    return _mean_of(x, row, before, 0), _mean_of(x, row, before, 1)


@compilable
def _mean_of(x: Any, row: Array, before: Array, half: int) -> Vec3:
    """The mean of one ``half`` [1], each counted from its own zero.

    What is used again after readings that were lost has the bias of before, and what rotors have
    made of its rate meanwhile says nothing of it: that runs away.
    """
    at, back = 3 * half, not int(row[LOST]) & (1 << half)
    a, b, bias = three(row, FORCE + at), three(before, FORCE + at), three(x.bias, at)
    if back and x.lost & (1 << half):
        bias = three(x.kept_bias, at)
    if back and half and int(before[LOST]) & RATE_MADE:
        b = a
    return (
        0.5 * (a[0] + b[0]) - bias[0],
        0.5 * (a[1] + b[1]) - bias[1],
        0.5 * (a[2] + b[2]) - bias[2],
    )


@compilable
def step_to(x: Any, law: Any, row: Array, before: Array, M: Array) -> None:
    """Predict to the time of the reading ``row`` (10,) [SI], which follows ``before`` (10,) [SI].

    Covariance ``M`` (17, 17) [SI]. Where readings are missing, in steps short enough.
    """
    gap = max(row[TIME] - x.time, 0.0)
    lost = NOTHING if gap > law.imu_gap else int(row[LOST])
    watch_biases(x, M, lost)
    f, w = mean_of(x, row, before)
    steps = max(1, math.ceil(gap / law.imu_gap - 1e-6))
    dt = gap / steps
    p, v, q = three(x.p, 0), three(x.v, 0), four(x.q)
    a = (0.0, 0.0, 0.0)
    for i in range(3):
        M[V + i, V + i] += row[MISSED]
        M[TH + i, TH + i] += row[MISSED + 1]
    for _ in range(steps):
        R = matrix_from_quaternion(q)
        p, v, q, a = integrated(p, v, q, f, w, dt)
        blocks = transition(R, f, w, dt)
        propagate(M, blocks, dt)
        add_noise(M, law, dt, lost, x.model_walk)
        if x.drifts:
            carry(x.shared, blocks, dt)
        if x.compass:
            carry(x.with_offset, blocks, dt)
    if lost & FORCE_MADE:
        _fade(x, M, math.exp(-gap / MADE_LASTS))
    for i in range(3):
        x.p[i], x.v[i], x.acceleration[i] = p[i], v[i], a[i]
        x.rate[i] = row[RATE + i] - x.bias[3 + i]
    put_four(x.q, q)
    x.time = max(row[TIME], x.time)


@compilable
def _fade(x: Any, M: Array, left: float) -> None:
    """Of what a modelled force is off a share [1] is ``left``: gusts do not last.

    Else a tilt could not be told from it where satellites alone measure how the vehicle moves.
    ``M`` (17, 17) [SI] is the covariance.
    """
    for i in range(3):
        x.bias[i] = x.kept_bias[i] + left * (x.bias[i] - x.kept_bias[i])
        for j in range(ERRORS):
            M[BA + i, j] *= left
            M[j, BA + i] *= left
        for j in range(FRAME):
            x.shared[BA + i, j] *= left
        for j in range(FIELD):
            x.with_offset[BA + i, j] *= left


@compilable
def watch_biases(x: Any, M: Array, lost: int) -> None:
    """Keep the biases when readings are ``lost`` [NO_FORCE, NO_RATE], and take them up again.

    ``M`` (17, 17) [SI] is the covariance. They are taken up when the readings are back.
    """
    changed = lost ^ x.lost
    if not changed:
        return
    x.lost = lost
    for i in range(6):
        k, half = BA + i, NO_FORCE if i < 3 else NO_RATE
        if not changed & half:
            continue
        if lost & half:
            x.kept_bias[i], x.kept_variance[i] = x.bias[i], M[k, k]
        else:
            x.bias[i] = x.kept_bias[i]
            reset_covariance(x, M, k, x.kept_variance[i])


@compilable
def reset_covariance(x: Any, M: Array, k: int, variance: float) -> None:
    """Give error ``k`` [1] a ``variance`` [SI, of x] of its own, in ``M`` (ERRORS, ERRORS) [SI]."""
    M[k, :] = 0.0
    M[:, k] = 0.0
    x.shared[k, :] = 0.0
    x.with_offset[k, :] = 0.0
    M[k, k] = variance


@compilable
def advance(x: Any, law: Any, until: float) -> None:
    """Move the state on through all readings up to ``until`` [s]."""
    while x.first < x.end:
        row = x.imu[x.first % IMU_CAPACITY]
        if row[TIME] > until and x.end - x.first < IMU_CAPACITY - 2:
            return
        step_to(x, law, row, x.imu[(x.first - 1) % IMU_CAPACITY], x.covariance)
        x.first += 1


@compilable
def present(x: Any, now: float) -> tuple[Vec3, Vec3, Vec4, Vec3, Vec3]:
    """Position, velocity, attitude, rate and specific force at ``now`` [s].

    All readings since the state's time are integrated anew, with the newest biases. After the last
    reading, that one is held.
    """
    p, v, q = three(x.p, 0), three(x.v, 0), four(x.q)
    t, last = x.time, x.imu[(x.first - 1) % IMU_CAPACITY]
    for k in range(x.first, x.end):
        row = x.imu[k % IMU_CAPACITY]
        f, w = mean_of(x, row, last)
        p, v, q, _ = integrated(p, v, q, f, w, row[TIME] - t)
        t, last = row[TIME], row
    f, w = mean_of(x, last, last)
    if now > t:
        p, v, q, _ = integrated(p, v, q, f, w, now - t)
    return p, v, q, w, f


@compilable
def distance(x: Any, rows: int) -> float:
    """Chi-square of the residual: how unlikely the measurement is.

    Leaves behind the Cholesky factor of its covariance and that part of the gain which needs it.
    """
    M, H, L, W = x.covariance, x.H, x.factor, x.gain
    for i in range(ERRORS):
        for k in range(rows):
            total = 0.0
            for j in range(ERRORS):
                total += M[i, j] * H[k, j]
            W[i, k] = total
    for k in range(rows):
        for m in range(k + 1):
            total = x.variance[k] if k == m else 0.0
            for j in range(ERRORS):
                total += H[k, j] * W[j, m]
            for j in range(m):
                total -= L[k, j] * L[m, j]
            L[k, m] = math.sqrt(total) if k == m else total / L[m, m]
    squared = 0.0
    for k in range(rows):
        total = x.residual[k]
        for j in range(k):
            total -= L[k, j] * x.residual[j]
        x.residual[k] = total / L[k, k]
        squared += x.residual[k] * x.residual[k]
    return squared


@compilable
def correct(x: Any, rows: int) -> None:
    """Take in the measurement that ``distance`` has judged. Solà, eq 275, 276 and 283.

    P - K S K^T is P - W W^T with W = P H^T L^-T. Of P, one half is computed and the other one set.
    A difference between them, which rounding makes, would not become smaller by any measurement,
    and grow with the fourth power of time.
    """
    M, L, W = x.covariance, x.factor, x.gain
    for i in range(ERRORS):
        error = 0.0
        for k in range(rows):
            total = W[i, k]
            for j in range(k):
                total -= L[k, j] * W[i, j]
            W[i, k] = total / L[k, k]
            error += W[i, k] * x.residual[k]
        x.error[i] = error
    if x.drifts:
        _correct_considered(x, x.shared, rows)
    if x.compass:
        _correct_considered(x, x.with_offset, rows)
    for i in range(ERRORS):
        for j in range(i + 1):
            total = M[i, j]
            for k in range(rows):
                total -= W[i, k] * W[j, k]
            M[i, j] = M[j, i] = total
        # Rounding must not make a variance negative.
        M[i, i] = max(M[i, i], 0.0)
    inject(x)


@compilable
def _correct_considered(x: Any, X: Array, rows: int) -> None:
    """Multiply the covariance ``X`` (17, n) with what is considered by I - K H; K is W L^-1."""
    H, L, W = x.H, x.factor, x.gain
    for c in range(X.shape[1]):
        for k in range(rows):
            total = 0.0
            for j in range(ERRORS):
                total += H[k, j] * X[j, c]
            for j in range(k):
                total -= L[k, j] * x.innovated[j]
            x.innovated[k] = total / L[k, k]
        for i in range(ERRORS):
            for k in range(rows):
                X[i, c] -= W[i, k] * x.innovated[k]


@compilable
def varies(x: Any) -> bool:
    """Whether every variance is one; NaN and less than nothing are none."""
    found = 0
    for i in range(ERRORS):
        if x.covariance[i, i] >= 0.0:
            found += 1
    return found == ERRORS


@compilable
def inject(x: Any) -> None:
    """Move the error into the nominal state. Solà, eq 283; the reset's Jacobian (287) is left out.

    Half of the attitude's correction of 1e-3 rad would turn its covariance by as much.
    """
    error = x.error
    for i in range(3):
        x.p[i] += error[P + i]
        x.v[i] += error[V + i]
        x.rate[i] -= error[BG + i]
    for i in range(6):
        x.bias[i] += error[BA + i]
    x.baro_bias += error[BARO]
    x.pose_delay += error[DELAY]
    put_four(x.q, turned(four(x.q), error[TH], error[TH + 1], error[TH + 2]))
