r"""Measurements of the error-state filter: residual, slope over the error, and the gate.

A measurement lies up to one period of the IMU beside the filter's time: the state is moved there by
its own velocity, acceleration and rate. One whose chi-square is beyond its gate
(``tuning.Gates``) is not fused. Each function returns chi-square over gate: fused if 1 or less.

Source: J. Solà, Quaternion kinematics for the error-state Kalman filter, 2017, section 6.1.
"""

from __future__ import annotations

import math
from typing import Any

from fsw.autopilot.estimation.compass import correct_with_offset, distance_with_offset
from fsw.autopilot.estimation.error_state import (
    BA,
    BARO,
    BG,
    DELAY,
    ERRORS,
    TH,
    Filter,
    Law,
    P,
    V,
    correct,
    distance,
    reset_covariance,
    vec3,
    vec4,
)
from fsw.autopilot.estimation.measurement_noise import followed
from fsw.autopilot.geometry.quaternion import conjugate, multiply, rotation_vector, turned
from fsw.autopilot.geometry.rotation import matrix_from_quaternion, rotate, wrap_angle
from fsw.autopilot.signals import Vec3, Vec4
from fsw.compiled import compilable, kernel, machine_code

_MIN_FIELD = 0.02  # Gauss across the vertical; less says nothing about the heading
_KNOWN_VELOCITY = 0.05  # m/s, a standard deviation
# What is not known of a state that poses contradict: standard deviations.
_DOUBTED_SPEED = 0.5  # m/s
_DOUBTED_FORCE = 3.0  # m/s^2
_DOUBTED_RATE = 0.5  # rad/s
# By what differences of innovations are beyond which are expected, variances grow.
_SCALE_FROM = 2.0
_SCALE_LIMIT = 100.0  # ten times the stated deviation: what is beyond is no noise, but garbage
# Of what variances are scaled: place and attitude of a pose, place and velocity of satellites.
POSE, GNSS = 0, 2


@compilable
def _cleared(x: Any, rows: int) -> None:
    for k in range(rows):
        for j in range(ERRORS):
            x.H[k, j] = 0.0


@compilable
def _judged(x: Any, rows: int, gate: float, part: int = 0, scaled: int = -1) -> float:
    """Chi-square over gate of a part of a measurement; fuses what is within it.

    The variance of what is ``scaled`` grows where innovations say that it is larger than stated.
    They say so by how they differ from one to the next: noise is what does not stay. What stays is
    somebody's error, and no reason to believe a measurement less.
    """
    for k in range(rows):
        x.innovation[part, k] = x.residual[k]
        if scaled >= 0:
            x.variance[k] *= max(x.noise_scale[scaled], 1.0)
    ratio = distance(x, rows) / gate
    if ratio <= 1.0:
        correct(x, rows)
    if scaled >= 0:
        _follow_noise(x, rows, part, scaled)
    return ratio


@compilable
def _follow_noise(x: Any, rows: int, part: int, scaled: int) -> None:
    """Let a scale of variances follow how far the newest innovation is from the last one."""
    L, y, squared = x.factor, x.innovated, 0.0
    for k in range(rows):
        total = x.innovation[part, k] - x.innovated_last[scaled, k]
        x.innovated_last[scaled, k] = x.innovation[part, k]
        for j in range(k):
            total -= L[k, j] * y[j]
        y[k] = total / L[k, k]
        squared += y[k] * y[k]
    scale = followed(x.noise_scale[scaled], squared / rows, _SCALE_FROM)
    x.noise_scale[scaled] = min(scale, _SCALE_LIMIT)


@compilable
def position_rows(x: Any, z: Vec3, variance: Vec3, dt: float, delayed: float) -> None:
    """Rows of a position ``z`` [m, NED] of ``variance`` [m^2, NED], ``dt`` [s] after the state.

    ``delayed`` [1] is 1 where its delay is estimated, else 0.
    """
    _cleared(x, 3)
    for i in range(3):
        moving = x.v[i] + dt * x.acceleration[i]
        x.residual[i] = z[i] - (x.p[i] + dt * (x.v[i] + 0.5 * dt * x.acceleration[i]))
        x.H[i, P + i] = 1.0
        x.H[i, V + i] = dt
        x.H[i, DELAY] = -delayed * moving
        x.variance[i] = variance[i]


@compilable
def attitude_rows(x: Any, z: Vec4, variance: Vec3, dt: float, delayed: float) -> None:
    """Rows of an attitude ``z`` [1] of ``variance`` [rad^2, FRD], ``dt`` [s] after the state.

    ``delayed`` [1] is 1 where its delay is estimated, else 0.
    """
    _cleared(x, 3)
    w = vec3(x.rate, 0)
    there = turned(vec4(x.q), dt * w[0], dt * w[1], dt * w[2])
    residual = rotation_vector(multiply(conjugate(there), z))
    for i in range(3):
        x.residual[i] = residual[i]
        x.H[i, TH + i] = 1.0
        x.H[i, BG + i] = -dt
        x.H[i, DELAY] = -delayed * w[i]
        x.variance[i] = variance[i]
    # The rotation between the state and the measurement turns the error's axes, to first order.
    x.H[0, TH + 1], x.H[0, TH + 2] = dt * w[2], -dt * w[1]
    x.H[1, TH + 0], x.H[1, TH + 2] = -dt * w[2], dt * w[0]
    x.H[2, TH + 0], x.H[2, TH + 1] = dt * w[1], -dt * w[0]


@machine_code
@kernel
def fuse_pose(
    filters: Filter,
    laws: Law,
    time: float,
    position: Vec3,
    attitude: Vec4,
    position_variance: Vec3,
    attitude_variance: Vec3,
) -> tuple[float, float]:
    """Fuse a pose stamped ``time`` [s]: chi-square over gate of its two halves.

    ``position`` [m, NED], ``attitude`` [1], ``position_variance`` [m^2, NED] and
    ``attitude_variance`` [rad^2, FRD]. An attitude of infinite variance says nothing: infinite.
    """
    x, law, gates = filters[0], laws[0].tuning, laws[0].gates
    delayed = 1.0 if law.pose_delay_sigma > 0.0 else 0.0
    for i in range(V, V + 3):
        # A delay is seen by the velocity that it is multiplied with. While that is not known, the
        # two explain each other's errors, and run away together.
        if x.covariance[i, i] > _KNOWN_VELOCITY * _KNOWN_VELOCITY:
            delayed = 0.0
    dt = time - x.pose_delay - x.time
    position_rows(x, position, position_variance, dt, delayed)
    first = _judged(x, 3, gates.pose, 0, POSE)
    if not attitude_variance[0] < math.inf:
        for i in range(3):
            x.innovation[1, i] = 0.0
        return first, math.inf
    dt = time - x.pose_delay - x.time
    attitude_rows(x, attitude, attitude_variance, dt, delayed)
    return first, _judged(x, 3, gates.pose, 1, POSE + 1)


@compilable
def velocity_rows(x: Any, z: Vec3, variance: Vec3, dt: float) -> None:
    """Rows of a velocity ``z`` [m/s, NED], ``variance`` [m^2/s^2, NED], ``dt`` [s] after x."""
    _cleared(x, 3)
    for i in range(3):
        x.residual[i] = z[i] - (x.v[i] + dt * x.acceleration[i])
        x.H[i, V + i] = 1.0
        x.variance[i] = variance[i]


@machine_code
@kernel
def fuse_gnss(
    filters: Filter,
    laws: Law,
    time: float,
    position: Vec3,
    velocity: Vec3,
    position_variance: Vec3,
    velocity_variance: Vec3,
) -> tuple[float, float]:
    """Fuse position and velocity of ``time`` [s]: chi-square over gate of each.

    ``position`` [m, NED], ``velocity`` [m/s, NED], ``position_variance`` [m^2, NED],
    ``velocity_variance`` [m^2/s^2, NED].
    """
    x, gates = filters[0], laws[0].gates
    dt = time - x.time
    position_rows(x, position, position_variance, dt, 0.0)
    first = _judged(x, 3, gates.gnss_position, 0, GNSS)
    velocity_rows(x, velocity, velocity_variance, dt)
    return first, _judged(x, 3, gates.gnss_velocity, 1, GNSS + 1)


@compilable
def pressure_rows(x: Any, altitude: float, variance: float, dt: float) -> None:
    """The row of an ``altitude`` [m, up] of ``variance`` [m^2], ``dt`` [s] after the state."""
    _cleared(x, 1)
    x.residual[0] = altitude - (-(x.p[2] + dt * x.v[2]) + x.baro_bias)
    x.H[0, P + 2] = -1.0
    x.H[0, V + 2] = -dt
    x.H[0, BARO] = 1.0
    x.variance[0] = variance


@machine_code
@kernel
def fuse_pressure(
    filters: Filter, laws: Law, time: float, altitude: float, variance: float
) -> float:
    """Fuse an ``altitude`` [m, up] of ``time`` [s] with ``variance`` [m^2]."""
    x, gates = filters[0], laws[0].gates
    pressure_rows(x, altitude, variance, time - x.time)
    return _judged(x, 1, gates.pressure)


@compilable
def heading_rows(x: Any, law: Any, field: Vec3, dt: float) -> bool:
    """The row of a magnetic ``field`` [Gauss, FRD]: its heading alone, ``dt`` [s] after the state.

    False where the field is too steep. Of the field's strength and dip nothing is believed.
    """
    _cleared(x, 1)
    w = vec3(x.rate, 0)
    R = matrix_from_quaternion(turned(vec4(x.q), dt * w[0], dt * w[1], dt * w[2]))
    north, east, down = rotate(R, field)
    level = north * north + east * east
    if not level > _MIN_FIELD * _MIN_FIELD:
        return False
    x.residual[0] = wrap_angle(law.declination - math.atan2(east, north))
    # Turning the body by its axis a turns the field's heading by a_z - z (x a_x + y a_y) / level.
    # Of the field as expected: slopes from the measured one go with its noise, and pull at tilt.
    size = math.sqrt(level)
    north, east = size * math.cos(law.declination), size * math.sin(law.declination)
    for i in range(3):
        x.H[0, TH + i] = R[6 + i] - down * (north * R[i] + east * R[3 + i]) / level
        x.offset_slope[i] = (east * R[i] - north * R[3 + i]) / level
    x.variance[0] = law.mag_noise * law.mag_noise / level
    return True


@machine_code
@kernel
def fuse_heading(filters: Filter, laws: Law, time: float, field: Vec3, believed: bool) -> float:
    """Fuse the heading of a magnetic ``field`` [Gauss, FRD] of ``time`` [s].

    One that is not ``believed``, though it is within its gate, says nothing: infinite.
    """
    x, law, gates = filters[0], laws[0].tuning, laws[0].gates
    if not heading_rows(x, law, field, time - x.time):
        x.innovation[0, 0] = 0.0
        return math.inf
    x.innovation[0, 0] = x.residual[0]
    ratio: float = distance_with_offset(x, law.mag_offset) / gates.heading
    if ratio <= 1.0:
        if not believed:
            return math.inf
        correct_with_offset(x, law.mag_offset)
    return ratio


@compilable
def range_rows(x: Any, law: Any, measured: float, variance: float, dt: float) -> bool:
    """The row of a ``measured`` [m] distance to level ground, ``dt`` [s] after the state.

    ``variance`` [m^2]. False where the vehicle is tilted by more than 45 degrees. It measures the
    height alone: what is not known of the tilt is noise. Over a tilt, a distance that is off would
    tilt the estimate, and the more, the more that is tilted already.
    """
    _cleared(x, 1)
    R = matrix_from_quaternion(vec4(x.q))
    if not R[8] > math.sqrt(0.5):
        return False
    expected = (law.ground - (x.p[2] + dt * x.v[2])) / R[8]
    x.residual[0] = measured - expected
    x.H[0, P + 2] = -1.0 / R[8]
    x.H[0, V + 2] = -dt / R[8]
    # R33 changes by R31 dtheta_y - R32 dtheta_x.
    by_roll, by_pitch = expected * R[7] / R[8], expected * R[6] / R[8]
    M = x.covariance
    tilt = by_roll * by_roll * M[TH, TH] + by_pitch * by_pitch * M[TH + 1, TH + 1]
    x.variance[0] = variance + tilt
    return True


@machine_code
@kernel
def fuse_range(filters: Filter, laws: Law, time: float, measured: float, variance: float) -> float:
    """Fuse a ``measured`` [m] distance to level ground of ``time`` [s] and ``variance`` [m^2]."""
    x, law, gates = filters[0], laws[0].tuning, laws[0].gates
    if not range_rows(x, law, measured, variance, time - x.time):
        x.innovation[0, 0] = 0.0
        return math.inf
    return _judged(x, 1, gates.range)


@compilable
def forget(x: Any, first: int, variance: Vec3) -> None:
    """Give three errors of a state ``x`` [SI] a ``variance`` [SI, of x] anew."""
    for i in range(3):
        reset_covariance(x, x.covariance, first + i, variance[i])


@machine_code
@kernel
def doubt(filters: Filter, place: float, turn: float, held: bool) -> None:
    """Know little more of a state that poses contradict by a ``place`` [m] and a ``turn`` [rad].

    Either the pose's frame has moved, or the inertial unit leads the filter astray: its biases may
    be anything, and velocity and attitude are what they have made of them. But where poses do not
    say how the vehicle is turned, ``held``, their places would be explained by any attitude.
    """
    M = filters[0].covariance
    for i in range(3):
        M[P + i, P + i] += place * place
        M[V + i, V + i] += _DOUBTED_SPEED * _DOUBTED_SPEED
        if not held:
            continue
        M[TH + i, TH + i] += turn * turn
        M[BA + i, BA + i] += _DOUBTED_FORCE * _DOUBTED_FORCE
        M[BG + i, BG + i] += _DOUBTED_RATE * _DOUBTED_RATE
