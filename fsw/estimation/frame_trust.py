"""Which parts of an exact sensor frame are believed, and what stands in for the others.

In flight, a frame is compared with what the last estimate makes of it: a vehicle cannot be
elsewhere after 2 ms. What is no number, cannot be, has jumped or repeats itself is not used: the
pose is then carried on by the inertial unit, rates follow from the pose, joints from their torques.
A pose that stays where it jumped to is the truth, after a while; what cannot be never is.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Final, NamedTuple

from fsw.compiled import compilable, compiled, machine_code
from fsw.estimation.estimator import estimate_state
from fsw.estimation.sensor_fault import Sensor, SensorFault, sentence
from fsw.geometry.quaternion import conjugate, multiply, normalised, rotation_vector, turned
from fsw.geometry.rotation import matrix_from_quaternion, quaternion_from_matrix, rotate, yaw_of
from fsw.model.airframe import GRAVITY
from fsw.signals import Mat3, SensorFrame, StateEstimate, Vec2, Vec3, Vec4

POSE, INERTIAL, JOINTS = 1, 2, 4  # parts of a frame
_NAMES: Final = ((POSE, Sensor.POSE), (INERTIAL, Sensor.IMU), (JOINTS, Sensor.ENCODERS))
# Of the parts in this order: frames in a row, until what has jumped is the truth; and frames that
# are equal to the last bit while the others change, until that is no chance.
_STAYS: Final = (100, 25, 25)
_REPEATS: Final = (1, 5, 5)
# From one frame to the next, beside what the last estimate predicts. Rotors turn the body by
# 17 rad/s^2; the rest is noise, and what hits the vehicle.
_PLACE_JUMP: Final = 0.1  # m
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
_RATE_SHARE: Final = 0.3  # of the newest rate from two poses
_LONGEST: Final = 1.0  # s, moved on at once
_QUIET_US: Final = 10_000_000  # without a bad frame, until one is worth a sentence again
_NEVER_US: Final = -_QUIET_US
# What a vehicle does while frames are missing.
_STRONGEST: Final = 50.0  # m/s^2
_QUICKEST: Final = 50.0  # rad/s^2, of the body
# Errors of what stands in, standard deviations.
_FORCE_ERROR: Final = 0.2  # m/s^2, of an accelerometer and the attitude that turns it
_BLIND_FORCE: Final = 5.0  # m/s^2, where there is none
_GYRO_ERROR: Final = 0.01  # rad/s
_BLIND_RATE: Final = 1.0  # rad/s


class PartTrust(NamedTuple):
    """One part of the frames."""

    unused: int = 0  # frames in a row that were not used
    since_us: int = -1  # of the first of them
    repeats: int = 0  # equal ones in a row
    fault: SensorFault = SensorFault.NONE


_GOOD: Final = PartTrust()


class FrameTrust(NamedTuple):
    """What is carried from frame to frame."""

    last: SensorFrame | None = None
    pose: PartTrust = PartTrust()
    inertial: PartTrust = PartTrust()
    joints: PartTrust = PartTrust()
    returned_us: int = 0  # how long the pose was away that has just come back; 0: it has not
    bad_us: tuple[int, int, int] = (_NEVER_US,) * 3  # when a bad frame of each part came last

    @property
    def doubted(self) -> bool:
        """Whether something stands in for a part."""
        return bool(self.pose.unused or self.inertial.unused or self.joints.unused)

    def faults(self) -> tuple[tuple[Sensor, PartTrust], ...]:
        """Sensors that are not used, the one that is missed most first."""
        parts = (self.pose, self.inertial, self.joints)
        named = zip((name for _, name in _NAMES), parts, strict=True)
        return tuple([(name, part) for name, part in named if part.unused])

    def reported(self, now_us: int) -> tuple[FrameTrust, tuple[str, ...]]:
        """Sentences about frames that cannot be or have jumped, and the trust that knows of them.

        A first such frame is worth a sentence, whatever stands in for it; the next one is after a
        while. What repeats itself is a matter of time, and of the failsafe table.
        """
        parts, times, sentences = (self.pose, self.inertial, self.joints), [], []
        for (_, sensor), part, last_us in zip(_NAMES, parts, self.bad_us, strict=True):
            now = part.unused > 0 and part.fault is not SensorFault.STUCK
            if now and now_us - last_us >= _QUIET_US:
                sentences.append(sentence(sensor, part.fault))
            times.append(now_us if now else last_us)
        first, second, third = times
        return self._replace(bad_us=(first, second, third)), tuple(sentences)

    def position_sigma(self, now_us: int) -> float:
        """Of the estimate at ``now_us`` [us], a standard deviation [m]."""
        t = _seconds(self.pose, now_us)
        blind = min(t, _seconds(self.inertial, now_us))
        return 0.5 * (_FORCE_ERROR * t * t + _BLIND_FORCE * blind * blind)

    def velocity_sigma(self, now_us: int) -> float:
        """Of the estimate at ``now_us`` [us], a standard deviation [m/s]."""
        t = _seconds(self.pose, now_us)
        return _FORCE_ERROR * t + _BLIND_FORCE * min(t, _seconds(self.inertial, now_us))

    def attitude_sigma(self, now_us: int) -> float:
        """Of the estimate at ``now_us`` [us], a standard deviation [rad]."""
        t = _seconds(self.pose, now_us)
        return _GYRO_ERROR * t + _BLIND_RATE * min(t, _seconds(self.inertial, now_us))


def _seconds(part: PartTrust, now_us: int) -> float:
    return 1e-6 * (now_us - part.since_us) if part.unused else 0.0


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
) -> tuple[int, int, Mat3, float]:
    """Parts that cannot be, and those that are too far from the last estimate, ``dt`` [s] older.

    Beside them the attitude's rotation [1, body to NED] and its yaw [rad].

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


_unbelievable = compiled(unbelievable)


@cache
def _machine_code() -> Callable[..., tuple[int, int, Mat3, float]]:
    """``unbelievable``, compiled when it is first wanted."""
    none, arm, level = (0.0, 0.0, 0.0), (0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    R = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    read = none, none, level, none, none, arm, arm
    return machine_code(_unbelievable, *read, none, none, R, none, 9.81, arm, arm, 0.002)


def believed(
    trust: FrameTrust, s: SensorFrame, x: StateEstimate, arm_acceleration: Callable[[], Vec2]
) -> tuple[FrameTrust, StateEstimate]:
    """The estimate from what is believed of a frame ``s``, after the estimate ``x``.

    ``arm_acceleration`` tells what the torques make of the joints [rad/s^2], where it is needed.
    """
    dt = min(max(1e-6 * (s.t_us - x.t_us), 0.0), _LONGEST)
    p, v, w, q, qd, force = s.p_WB, s.v_WB, s.gyro_B, s.q_arm, s.qd_arm, s.accel_B
    _, p0, v0, R0, w0, _, q0, qd0, force0 = x
    never, far, R, yaw = _machine_code()(
        p, v, s.q_WB, w, force, q, qd, p0, v0, R0, w0, force0, q0, qd0, dt
    )
    known = trust.last
    stuck = 0 if known is None else _repeating(s, known)
    if not (never or far or stuck or trust.returned_us or trust.doubted):
        after = FrameTrust(s, _GOOD, _GOOD, _GOOD, 0, trust.bad_us)
        return after, StateEstimate(s.t_us, p, v, R, w, yaw, q, qd, -force[2])
    olds = trust.pose, trust.inertial, trust.joints
    pose, inertial, joints = [
        _part(old, s.t_us, bool(never & bit), bool(far & bit), bool(stuck & bit), k)
        for k, ((bit, _), old) in enumerate(zip(_NAMES, olds, strict=True))
    ]
    away = s.t_us - trust.pose.since_us if trust.pose.unused and not pose.unused else 0
    after = FrameTrust(s, pose, inertial, joints, away, trust.bad_us)
    return after, _filled(after, s, x, dt, arm_acceleration)


def _repeating(s: SensorFrame, last: SensorFrame) -> int:
    """Parts that are the last frame's to the last bit, while others are not."""
    pose = s.p_WB == last.p_WB and s.v_WB == last.v_WB and s.q_WB == last.q_WB
    inertial = s.gyro_B == last.gyro_B and s.accel_B == last.accel_B
    if pose and inertial:
        return 0  # a frame that came twice, or a vehicle that lies still
    moving = s.qd_arm != (0.0, 0.0)
    joints = moving and s.q_arm == last.q_arm and s.qd_arm == last.qd_arm
    return (POSE if pose else 0) | (INERTIAL if inertial else 0) | (JOINTS if joints else 0)


def _part(
    old: PartTrust, now_us: int, never: bool, far: bool, stuck: bool, place: int
) -> PartTrust:
    repeats = old.repeats + 1 if stuck else 0
    if never:
        fault = SensorFault.IMPLAUSIBLE
    elif repeats >= _REPEATS[place]:
        fault = SensorFault.STUCK
    elif far and old.unused < _STAYS[place]:
        fault = SensorFault.JUMP
    else:
        return PartTrust(repeats=repeats)
    since = old.since_us if old.unused else now_us
    return PartTrust(old.unused + 1, since, repeats, fault)


def _filled(
    trust: FrameTrust,
    s: SensorFrame,
    x: StateEstimate,
    dt: float,
    arm_acceleration: Callable[[], Vec2],
) -> StateEstimate:
    """What is believed of the frame, the rest carried on from the last estimate."""
    w, force = s.gyro_B, -s.accel_B[2]
    p, v, q = s.p_WB, s.v_WB, s.q_WB
    before = quaternion_from_matrix(x.R_WB)
    if trust.inertial.unused:
        w, force = x.w_WB_B, x.specific_force
        if not trust.pose.unused and dt > 0.0:
            w, force = _from_poses(x, before, normalised(q), v, dt)
    if trust.pose.unused:
        turn = turned(before, dt * w[0], dt * w[1], dt * w[2])
        a_B = (0.0, 0.0, -force) if trust.inertial.unused else s.accel_B
        a_B = a_B if math.isfinite(a_B[0] + a_B[1]) else (0.0, 0.0, -force)
        ax, ay, az = rotate(matrix_from_quaternion(turn), a_B)
        az += GRAVITY
        (px, py, pz), (vx, vy, vz) = x.p_WB, x.v_WB
        p = (px + dt * (vx + 0.5 * dt * ax), py + dt * (vy + 0.5 * dt * ay),
             pz + dt * (vz + 0.5 * dt * az))  # fmt: skip
        v, q = (vx + dt * ax, vy + dt * ay, vz + dt * az), turn
    angles, rates = s.q_arm, s.qd_arm
    if trust.joints.unused:
        (q1, q2), (r1, r2), (a1, a2) = x.q_arm, x.qd_arm, arm_acceleration()
        angles, rates = (q1 + dt * r1, q2 + dt * r2), (r1 + dt * a1, r2 + dt * a2)
    found = estimate_state(SensorFrame(s.t_us, p, v, q, w, (0.0, 0.0, -force), angles, rates))
    return found if found is not None else x._replace(t_us=s.t_us)


def _from_poses(x: StateEstimate, q0: Vec4, q: Vec4, v: Vec3, dt: float) -> tuple[Vec3, float]:
    """Rate and specific force, smoothed, from how the pose has changed."""
    turn = rotation_vector(multiply(conjugate(q0), q))
    w = tuple([old + _RATE_SHARE * (t / dt - old) for old, t in zip(x.w_WB_B, turn, strict=True)])
    R = matrix_from_quaternion(q)
    ax, ay, az = [(a - b) / dt for a, b in zip(v, x.v_WB, strict=True)]
    force = -(R[2] * ax + R[5] * ay + R[8] * (az - GRAVITY))
    wx, wy, wz = w
    return (wx, wy, wz), x.specific_force + _RATE_SHARE * (force - x.specific_force)
