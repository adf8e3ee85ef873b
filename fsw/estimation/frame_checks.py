"""What is odd about an exact frame: what cannot be, has jumped or repeats itself.

It is compared with what the last estimate makes of it, and with the frame before. Compiled, because
it is asked in every tick.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any, Final

from fsw.compiled import compilable, kernel, machine_code
from fsw.estimation.pose_imu_agreement import EMPTY_WINDOW, Window
from fsw.geometry.quaternion import conjugate, multiply, rotation_vector
from fsw.geometry.rotation import matrix_from_quaternion, rotate, yaw_of
from fsw.model.airframe import GRAVITY
from fsw.signals import Mat3, Vec2, Vec3, Vec4

POSE, INERTIAL, JOINTS = 1, 2, 4  # parts of a frame
# From one frame to the next, beside what the last estimate predicts. Rotors turn the body by
# 17 rad/s^2; the rest is noise, and what hits the vehicle.
_PLACE_JUMP: Final = 0.1  # m
PLACE_BACK: Final = 0.02  # m, from where the inertial unit has carried the pose on to
_SPEED_JUMP: Final = 1.5  # m/s
_TURN_JUMP: Final = 0.3  # rad
_RATE_JUMP: Final = 5.0  # rad/s
_FORCE_JUMP: Final = 100.0  # m/s^2
_JOINT_JUMP: Final = 0.15  # rad
_JOINT_RATE_JUMP: Final = 12.0  # rad/s
_PLACE_LIMIT: Final = 1e5  # m; farther, faster: no vehicle of this kind
_SPEED_LIMIT: Final = 100.0  # m/s
_RATE_LIMIT: Final = 100.0  # rad/s, of body and joints
_FORCE_LIMIT: Final = 1000.0  # m/s^2
_STEADY_DT: Final = 0.02  # s; frames farther apart are not compared
# What a vehicle does while frames are missing.
_STRONGEST: Final = 50.0  # m/s^2
_QUICKEST: Final = 50.0  # rad/s^2, of the body

Reading = tuple[Vec3, Vec3, Vec4, Vec3, Vec3, Vec2, Vec2]
"""A frame without its time: place, velocity, attitude, gyro, accelerometer, joints and rates."""


@compilable
def unbelievable(
    p: Vec3,
    v: Vec3,
    q: Vec4,
    w: Vec3,
    f: Vec3,
    arm: Vec2,
    rates: Vec2,
    p0: Vec3,
    v0: Vec3,
    R0: Mat3,
    w0: Vec3,
    f0: float,
    arm0: Vec2,
    rates0: Vec2,
    dt: float,
    sigma: float,
) -> tuple[int, int, Mat3, float]:
    """Parts that cannot be, and those that are too far from the last estimate, ``dt`` [s] older.

    Beside them the attitude's rotation [1, body to NED] and its yaw [rad]. The estimate's place is
    known to ``sigma`` [m], which is 0 while poses are used.

    Readings ``p`` [m, NED], ``v`` [m/s, NED], ``q`` [1], ``w`` [rad/s, FRD], ``f`` [m/s^2, FRD],
    ``arm`` [rad], ``rates`` [rad/s]; of the estimate ``p0`` [m, NED], ``v0`` [m/s, NED], ``R0`` [1,
    body to NED], ``w0`` [rad/s, FRD], ``f0`` [m/s^2, along -z of the body], ``arm0`` [rad] and
    ``rates0`` [rad/s].
    """  # fmt: skip
    never, far, R = 0, 0, matrix_from_quaternion(q)
    norm2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
    place = max(abs(p[0]), abs(p[1]), abs(p[2]))
    speed = max(abs(v[0]), abs(v[1]), abs(v[2]))
    finite = math.isfinite(p[0] + p[1] + p[2] + v[0] + v[1] + v[2] + norm2)
    if not (finite and 0.5 < norm2 < 2.0 and place < _PLACE_LIMIT and speed < _SPEED_LIMIT):
        never |= POSE
    else:
        trace = 0.0
        for i in range(9):
            trace += R[i] * R0[i]
        jump, change = 0.0, 0.0
        for i in range(3):
            jump = max(jump, abs(p[i] - p0[i] - dt * v0[i]))
            change = max(change, abs(v[i] - v0[i]))
        turn = math.sqrt(w0[0] * w0[0] + w0[1] * w0[1] + w0[2] * w0[2]) * dt + _TURN_JUMP
        turn += 0.5 * _QUICKEST * dt * dt
        apart = 0.5 * (trace - 1.0) < math.cos(min(turn, math.pi))
        room = _PLACE_JUMP + 0.5 * _STRONGEST * dt * dt
        if sigma > 0.0:
            room = min(room, PLACE_BACK + 5.0 * sigma)
        if jump > room or change > _SPEED_JUMP + _STRONGEST * dt or apart:
            far |= POSE
    rate = max(abs(w[0]), abs(w[1]), abs(w[2]))
    finite = math.isfinite(w[0] + w[1] + w[2] + f[2])
    if not (finite and rate < _RATE_LIMIT and abs(f[2]) < _FORCE_LIMIT):
        never |= INERTIAL
    else:
        change = max(abs(w[0] - w0[0]), abs(w[1] - w0[1]), abs(w[2] - w0[2]))
        if change > _RATE_JUMP + _QUICKEST * dt or abs(-f[2] - f0) > _FORCE_JUMP:
            far |= INERTIAL
    finite = math.isfinite(arm[0] + arm[1] + rates[0] + rates[1])
    if not (finite and max(abs(rates[0]), abs(rates[1])) < _RATE_LIMIT):
        never |= JOINTS
    else:
        jump = max(abs(arm[0] - arm0[0] - dt * rates0[0]), abs(arm[1] - arm0[1] - dt * rates0[1]))
        change = max(abs(rates[0] - rates0[0]), abs(rates[1] - rates0[1]))
        if jump > _JOINT_JUMP + 10.0 * dt or change > _JOINT_RATE_JUMP:
            far |= JOINTS
    return never, far, R, yaw_of(R)


@compilable
def compared(
    p: Vec3,
    v: Vec3,
    q: Vec4,
    w: Vec3,
    f: Vec3,
    arm: Vec2,
    p0: Vec3,
    v0: Vec3,
    q0: Vec4,
    w0: Vec3,
    f0: Vec3,
    arm0: Vec2,
    dt: float,
    turn: Vec3,
    speed: Vec3,
) -> tuple[int, bool, Vec3, Vec3]:
    """Parts of a frame that are far from those of the one before, ``dt`` [s] older.

    Beside them whether pose and inertial unit can be compared, and the sums ``turn`` [rad, FRD] and
    ``speed`` [m/s, NED] of a window with this frame in it. Readings ``p`` [m, NED],
    ``v`` [m/s, NED], ``q`` [1], ``w`` [rad/s, FRD], ``f`` [m/s^2, FRD], ``arm`` [rad]; of the frame
    before ``p0`` [m, NED], ``v0`` [m/s, NED], ``q0`` [1], ``w0`` [rad/s, FRD], ``f0`` [m/s^2, FRD]
    and ``arm0`` [rad].
    """  # fmt: skip
    rough = 0
    step, change, spin, push = 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        step = max(step, abs(p[i] - p0[i] - dt * v0[i]))
        change = max(change, abs(v[i] - v0[i]))
        spin = max(spin, abs(w[i] - w0[i]))
        push = max(push, abs(f[i] - f0[i]))
    angle = rotation_vector(multiply(conjugate(q0), q))
    turned_by = math.sqrt(angle[0] * angle[0] + angle[1] * angle[1] + angle[2] * angle[2])
    quick = _STRONGEST * dt
    if not (step < _PLACE_JUMP and change < _SPEED_JUMP + quick and turned_by < _TURN_JUMP):
        rough |= POSE
    if not (spin < _RATE_JUMP + _QUICKEST * dt and push < _FORCE_JUMP):
        rough |= INERTIAL
    if not max(abs(arm[0] - arm0[0]), abs(arm[1] - arm0[1])) < _JOINT_JUMP + 10.0 * dt:
        rough |= JOINTS
    ax, ay, az = rotate(matrix_from_quaternion(q), f)
    turn = (
        turn[0] + angle[0] - dt * w[0],
        turn[1] + angle[1] - dt * w[1],
        turn[2] + angle[2] - dt * w[2],
    )
    speed = (
        speed[0] + v[0] - v0[0] - dt * ax,
        speed[1] + v[1] - v0[1] - dt * ay,
        speed[2] + v[2] - v0[2] - dt * (az + GRAVITY),
    )
    total = turn[0] + turn[1] + turn[2] + speed[0] + speed[1] + speed[2]
    comparable = math.isfinite(total) and not rough & POSE
    return rough, comparable, turn, speed


@compilable
def repeating(new: Reading, last: Reading) -> int:
    """Parts of a ``new`` [SI] reading that are the ``last`` [SI] one's, while others are not.

    To the last bit. Of a pose place and velocity suffice: what turns on the spot is never so still.
    Of the joints one that moves does.
    """
    pose = new[0] == last[0] and new[1] == last[1]
    inertial = new[3] == last[3] and new[4] == last[4]
    if pose and inertial:
        return 0  # a frame that came twice, or a vehicle that lies still
    joints = False
    for k in range(2):
        if new[6][k] != 0.0 and new[5][k] == last[5][k] and new[6][k] == last[6][k]:
            joints = True
    return (POSE if pose else 0) | (INERTIAL if inertial else 0) | (JOINTS if joints else 0)


@compilable
def next_window(window: Window, new: Reading, last: Reading, apart: float) -> tuple[int, Window]:
    """Parts that are far from the last frame's, and the window with the new frame in it.

    Readings ``new`` [SI] and ``last`` [SI], that many seconds ``apart`` [s].
    """
    if not 0.0 < apart <= _STEADY_DT:
        return 0, Window(0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0, 0)
    p, v, q, w, f, arm, _ = new
    p0, v0, q0, w0, f0, arm0, _ = last
    rough, comparable, turn, speed = compared(
        p, v, q, w, f, arm, p0, v0, q0, w0, f0, arm0, apart, window.turn, window.speed
    )
    # A pose that repeats itself says nothing about the others.
    if not comparable or v == v0:
        return rough, Window(0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0, 0)
    same_rate = window.same_rate + 1 if w == w0 else 0
    same_force = window.same_force + 1 if f == f0 else 0
    return rough, Window(window.frames + 1, turn, speed, same_rate, same_force)


@kernel
def looked_at(
    new: Reading,
    last: Reading,
    apart: float,
    window: Window,
    p0: Vec3,
    v0: Vec3,
    R0: Mat3,
    w0: Vec3,
    f0: float,
    arm0: Vec2,
    rates0: Vec2,
    dt: float,
    sigma: float,
) -> tuple[int, int, Mat3, float, int, int, tuple[int, Vec3, Vec3, int, int]]:
    """``unbelievable``, ``repeating`` and ``next_window`` in one call.

    Readings ``new`` and ``last`` [SI], ``apart`` [s]; of the estimate, which is ``dt`` [s] old and
    whose place is known to ``sigma`` [m], ``p0`` [m, NED], ``v0`` [m/s, NED], ``R0`` [1, body to
    NED], ``w0`` [rad/s, FRD], ``f0`` [m/s^2, along -z of the body], ``arm0`` [rad] and ``rates0``
    [rad/s].
    """
    p, v, q, w, f, arm, rates = new
    never, far, R, yaw = unbelievable(
        p, v, q, w, f, arm, rates, p0, v0, R0, w0, f0, arm0, rates0, dt, sigma
    )
    rough, after = next_window(window, new, last, apart)
    sums = (after.frames, after.turn, after.speed, after.same_rate, after.same_force)
    return never, far, R, yaw, repeating(new, last), rough, sums


@cache
def compiled_look() -> Callable[..., Any]:
    """``looked_at``, compiled when it is first wanted."""
    none, arm, level = (0.0, 0.0, 0.0), (0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    R = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    read = none, none, level, none, none, arm, arm
    estimate = none, none, R, none, 9.81, arm, arm
    return machine_code(looked_at, read, read, 0.002, EMPTY_WINDOW, *estimate, 0.002, 0.0)
