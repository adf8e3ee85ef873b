"""Which parts of an exact sensor frame are believed, and what stands in for the others.

In flight, a frame is compared with what the last estimate makes of it: a vehicle cannot be
elsewhere after 2 ms. What is no number, cannot be, has jumped or repeats itself is not used: the
pose is then carried on by the inertial unit, rates follow from the pose, joints from their torques.
What stays where it jumped to is the truth, after a while; what cannot be never is.

What drifts off, is late or is stuck for itself shows in how the pose changes: that is
``pose_imu_agreement.py``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, NamedTuple

from fsw.estimation.estimator import estimate_state
from fsw.estimation.frame_checks import INERTIAL, JOINTS, PLACE_BACK, POSE, compiled_look
from fsw.estimation.pose_imu_agreement import (
    AGREED,
    EMPTY_WINDOW,
    PROBATION_US,
    WINDOW_FRAMES,
    Agreement,
    Window,
)
from fsw.estimation.sensor_fault import Sensor, SensorFault, sentence
from fsw.geometry.quaternion import conjugate, multiply, normalised, rotation_vector, turned
from fsw.geometry.rotation import matrix_from_quaternion, quaternion_from_matrix, rotate, yaw_of
from fsw.model.airframe import GRAVITY
from fsw.signals import SensorFrame, StateEstimate, Vec2, Vec3, Vec4

_NAMES: Final = ((POSE, Sensor.POSE), (INERTIAL, Sensor.IMU), (JOINTS, Sensor.ENCODERS))
# Of the parts in this order: frames in a row, until what has jumped is the truth; and frames that
# are equal to the last bit while the others change, until that is no chance.
_STAYS: Final = (100, 25, 25)
_REPEATS: Final = (1, 5, 5)
_CALM: Final = 5  # frames in a row near each other, after some that were not
_LONG_AWAY_US: Final = 100_000  # after which a pose that comes back is on probation
_SHOWN: Final = 50  # frames, for which a pose repeats itself until that is worth a sentence
_RATE_SHARE: Final = 0.3  # of the newest rate from two poses
_LONGEST: Final = 1.0  # s, moved on at once
_QUIET_US: Final = 10_000_000  # without a bad frame, until one is worth a sentence again
_NEVER_US: Final = -_QUIET_US
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
    steady: int = 0  # ones in a row that were near the one before, since it is not used
    fault: SensorFault = SensorFault.NONE


_GOOD: Final = PartTrust()


class Shadow(NamedTuple):
    """Where the inertial unit alone says that the vehicle is, while a pose is on probation."""

    since_us: int
    p: Vec3  # m, NED
    v: Vec3  # m/s, NED
    q: Vec4  # body to NED

    def apart(self, p: Vec3, now_us: int) -> bool:
        """Whether a place ``p`` [m, NED] at ``now_us`` [us] cannot be where this is."""
        t = 1e-6 * (now_us - self.since_us)
        return math.dist(p, self.p) > PLACE_BACK + 2.5 * _FORCE_ERROR * t * t


class FrameTrust(NamedTuple):
    """What is carried from frame to frame."""

    last: SensorFrame | None = None
    pose: PartTrust = PartTrust()
    inertial: PartTrust = PartTrust()
    joints: PartTrust = PartTrust()
    returned_us: int = 0  # how long the pose was away that is now another one; 0: it is the same
    bad_us: tuple[int, int, int] = (_NEVER_US,) * 3  # when a bad frame of each part came last
    window: Window = EMPTY_WINDOW  # the running one
    agreement: Agreement = AGREED
    shadow: Shadow | None = None  # of a pose that came back after long

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
        while. So is what repeats itself for long; for shorter it is a matter of the failsafe table.
        """
        parts, times, sentences = (self.pose, self.inertial, self.joints), [], []
        for (_, sensor), part, last_us in zip(_NAMES, parts, self.bad_us, strict=True):
            now = part.unused > 0 and (
                part.fault is not SensorFault.STUCK or part.repeats >= _SHOWN or part.repeats == 0
            )
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


def believed(
    trust: FrameTrust, s: SensorFrame, x: StateEstimate, arm_acceleration: Callable[[], Vec2]
) -> tuple[FrameTrust, StateEstimate]:
    """The estimate from what is believed of a frame ``s``, after the estimate ``x``.

    ``arm_acceleration`` tells what the torques make of the joints [rad/s^2], where it is needed.
    """
    dt = min(max(1e-6 * (s.t_us - x.t_us), 0.0), _LONGEST)
    p, v, w, q, qd, force = s.p_WB, s.v_WB, s.gyro_B, s.q_arm, s.qd_arm, s.accel_B
    _, p0, v0, R0, w0, _, q0, qd0, force0 = x
    sigma = trust.position_sigma(s.t_us) if trust.pose.unused else 0.0
    new, known = (p, v, s.q_WB, w, force, q, qd), trust.last
    last, apart = new, 0.0  # a first frame repeats nothing, and opens no window
    if known is not None:
        last = (known.p_WB, known.v_WB, known.q_WB, known.gyro_B, known.accel_B,
                known.q_arm, known.qd_arm)  # fmt: skip
        apart = 1e-6 * (s.t_us - known.t_us)
    never, far, R, yaw, stuck, rough, sums = compiled_look()(
        new, last, apart, trust.window, p0, v0, R0, w0, force0, q0, qd0, dt, sigma
    )
    window, agreement = Window(*sums), trust.agreement
    if window.frames >= WINDOW_FRAMES:
        agreement, window = agreement.after(window, s.t_us), EMPTY_WINDOW
    odd = agreement.doubted
    if not (never or far or stuck or trust.returned_us or trust.doubted or odd or trust.shadow):
        after = FrameTrust(s, _GOOD, _GOOD, _GOOD, 0, trust.bad_us, window, agreement)
        return after, StateEstimate(s.t_us, p, v, R, w, yaw, q, qd, -force[2])
    olds = trust.pose, trust.inertial, trust.joints
    pose, inertial, joints = [
        _part(
            old,
            s.t_us,
            agreement.fault if odd is sensor else SensorFault.NONE,
            bool(never & bit),
            bool(far & bit),
            bool(stuck & bit),
            bool(rough & bit),
            k,
        )
        for k, ((bit, sensor), old) in enumerate(zip(_NAMES, olds, strict=True))
    ]
    if pose.unused or inertial.unused:
        agreement = agreement._replace(pose_failed_us=-1 if inertial.unused else s.t_us)
    away = s.t_us - trust.pose.since_us if trust.pose.unused and not pose.unused else 0
    shadow = None if inertial.unused else trust.shadow
    if shadow is not None:
        shadow = _carried(shadow, s, dt) if s.t_us - shadow.since_us < PROBATION_US else None
    if away >= _LONG_AWAY_US and not inertial.unused:
        shadow = _from_there(s, x, yaw, dt)
    if shadow is not None and pose.unused == 0 and shadow.apart(p, s.t_us):
        # It is late: it has been followed for a while, and leads elsewhere than accelerations do.
        agreement = agreement.without_pose()
        pose = PartTrust(1, s.t_us, fault=SensorFault.DISAGREES)
    if shadow is not None and pose.unused == 1 and pose.fault is SensorFault.DISAGREES:
        away, x = 1, _at(x, shadow)
        dt, shadow = 0.0, None
    after = FrameTrust(s, pose, inertial, joints, away, trust.bad_us, window, agreement, shadow)
    return after, _filled(after, s, x, dt, arm_acceleration)


def _from_there(s: SensorFrame, x: StateEstimate, yaw: float, dt: float) -> Shadow:
    """Place and heading of a pose that came back; speed and tilt as the inertial unit led on."""
    half = 0.5 * (yaw - x.yaw)
    c, d = math.cos(2.0 * half), math.sin(2.0 * half)
    (vx, vy, vz), before = x.v_WB, quaternion_from_matrix(x.R_WB)
    turn = multiply((math.cos(half), 0.0, 0.0, math.sin(half)), before)
    carried = _carried(Shadow(s.t_us, s.p_WB, (c * vx - d * vy, d * vx + c * vy, vz), turn), s, dt)
    return carried._replace(p=s.p_WB)


def _at(x: StateEstimate, shadow: Shadow) -> StateEstimate:
    R = matrix_from_quaternion(shadow.q)
    return x._replace(p_WB=shadow.p, v_WB=shadow.v, R_WB=R, yaw=yaw_of(R))


def _carried(shadow: Shadow, s: SensorFrame, dt: float) -> Shadow:
    """The shadow ``dt`` [s] later."""
    return Shadow(
        shadow.since_us, *_integrated(shadow.p, shadow.v, shadow.q, s.gyro_B, s.accel_B, dt)
    )


def _integrated(
    p: Vec3, v: Vec3, q: Vec4, w: Vec3, a_B: Vec3, dt: float
) -> tuple[Vec3, Vec3, Vec4]:
    turn = turned(q, dt * w[0], dt * w[1], dt * w[2])
    ax, ay, az = rotate(matrix_from_quaternion(turn), a_B)
    az += GRAVITY
    (px, py, pz), (vx, vy, vz) = p, v
    p = (px + dt * (vx + 0.5 * dt * ax), py + dt * (vy + 0.5 * dt * ay),
         pz + dt * (vz + 0.5 * dt * az))  # fmt: skip
    return p, (vx + dt * ax, vy + dt * ay, vz + dt * az), turn


def _part(
    old: PartTrust,
    now_us: int,
    odd: SensorFault,
    never: bool,
    far: bool,
    stuck: bool,
    rough: bool,
    place: int,
) -> PartTrust:
    repeats = old.repeats + 1 if stuck else 0
    steady = old.steady + 1 if old.unused and not (rough or never) else 0
    if never:
        fault = SensorFault.IMPLAUSIBLE
    elif repeats >= _REPEATS[place]:
        fault = SensorFault.STUCK
    elif far and min(old.unused, steady) < _STAYS[place]:
        fault = SensorFault.JUMP
    elif old.fault is SensorFault.JUMP and old.unused > 1 and steady < _CALM:
        fault = SensorFault.JUMP  # what jumps to and fro is near at times
    elif odd:
        fault = odd
    else:
        return PartTrust(repeats=repeats)
    since = old.since_us if old.unused else now_us
    return PartTrust(old.unused + 1, since, repeats, steady, fault)


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
        a_B = (0.0, 0.0, -force) if trust.inertial.unused else s.accel_B
        a_B = a_B if math.isfinite(a_B[0] + a_B[1]) else (0.0, 0.0, -force)
        p, v, q = _integrated(x.p_WB, x.v_WB, before, w, a_B, dt)
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
