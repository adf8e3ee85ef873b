"""Which parts of an exact sensor frame are believed, and what stands in for the others.

In flight, a frame is compared with what the last estimate makes of it: a vehicle cannot be
elsewhere after 2 ms. What is no number, cannot be, has jumped or repeats itself is not used: the
pose is then carried on by the inertial unit, rates follow from the pose, joints from their torques.
What stays where it jumped to is the truth, after a while; what cannot be never is.

What drifts off, is late or is stuck for itself shows in how the pose changes (``Agreement``).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any, Final, NamedTuple

from fsw.compiled import compilable, kernel, machine_code
from fsw.estimation.estimator import estimate_state
from fsw.estimation.sensor_fault import Sensor, SensorFault, sentence
from fsw.geometry.quaternion import conjugate, multiply, normalised, rotation_vector, turned
from fsw.geometry.rotation import matrix_from_quaternion, quaternion_from_matrix, rotate, yaw_of
from fsw.geometry.vectors import norm
from fsw.model.airframe import GRAVITY
from fsw.signals import Mat3, SensorFrame, StateEstimate, Vec2, Vec3, Vec4

POSE, INERTIAL, JOINTS = 1, 2, 4  # parts of a frame
_NAMES: Final = ((POSE, Sensor.POSE), (INERTIAL, Sensor.IMU), (JOINTS, Sensor.ENCODERS))
# Of the parts in this order: frames in a row, until what has jumped is the truth; and frames that
# are equal to the last bit while the others change, until that is no chance.
_STAYS: Final = (100, 25, 25)
_REPEATS: Final = (1, 5, 5)
_CALM: Final = 5  # frames in a row near each other, after some that were not
# From one frame to the next, beside what the last estimate predicts. Rotors turn the body by
# 17 rad/s^2; the rest is noise, and what hits the vehicle.
_PLACE_JUMP: Final = 0.1  # m
_PROBATION_US: Final = 5_000_000  # of a pose that was not used, or was away for
_LONG_AWAY_US: Final = 100_000
_PLACE_BACK: Final = 0.02  # m, from where the inertial unit has carried the pose on to
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
# Changes of the pose are compared with the inertial unit over so many frames. Poses that are noisy
# by 5 mrad and 20 mm/s are still within this.
WINDOW_FRAMES: Final = 25
_TURN_APART: Final = 0.02  # rad
_SPEED_APART: Final = 0.07  # m/s
# What is constant to the last bit, and the pose shows a change from one window to the next.
_TURN_SEEN: Final = 1e-8  # rad
_SPEED_SEEN: Final = 1e-6  # m/s
_BAD: Final = 2  # windows in a row until a sensor is doubted
_GOOD_AGAIN: Final = 5  # until it is believed again; twice as many each time
_MOST_GOOD: Final = 100
_SHOWN: Final = 50  # frames, for which a pose repeats itself until that is worth a sentence
_STEADY_DT: Final = 0.02  # s; frames farther apart are not compared
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
    steady: int = 0  # ones in a row that were near the one before, since it is not used
    fault: SensorFault = SensorFault.NONE


_GOOD: Final = PartTrust()
_NO_SUM: Final[Vec3] = (0.0, 0.0, 0.0)


class Window(NamedTuple):
    """Sums over some frames."""

    frames: int = 0
    turn: Vec3 = _NO_SUM  # rad, of the pose, FRD, minus that of the gyro
    speed: Vec3 = _NO_SUM  # m/s, NED, of the pose minus that of the accelerometer
    same_rate: int = 0  # frames with the gyro's last reading
    same_force: int = 0  # the same of the accelerometer


_EMPTY: Final = Window()


class Agreement(NamedTuple):
    """Whether pose and inertial unit say the same of how the vehicle moves.

    A gyro that disagrees alone is wrong, an accelerometer as well; where both do the pose is, and
    so it is where it has failed lately.
    """

    turn: int = 0  # windows in a row in which the gyro disagreed
    speed: int = 0  # the same of the accelerometer
    good: int = 0  # windows in a row in which neither did
    doubted: Sensor | None = None
    fault: SensorFault = SensorFault.NONE
    again: int = _GOOD_AGAIN  # good windows that it takes to be believed
    # When the pose was not used last; -1: never, or the inertial unit failed since.
    pose_failed_us: int = -1
    last: Window | None = None

    def after(self, window: Window, now_us: int) -> Agreement:
        """The judgement after a whole window, at ``now_us`` [us]."""
        turn, speed = norm(window.turn), norm(window.speed)
        last = window if self.last is None else self.last
        still = window.same_rate >= WINDOW_FRAMES and math.dist(window.turn, last.turn) > _TURN_SEEN
        held = (
            window.same_force >= WINDOW_FRAMES and math.dist(window.speed, last.speed) > _SPEED_SEEN
        )
        turns = self.turn + 1 if still or not turn < _TURN_APART else 0
        speeds = self.speed + 1 if held or not speed < _SPEED_APART else 0
        good = 0 if turns or speeds else self.good + 1
        after = self._replace(turn=turns, speed=speeds, good=good, last=window)
        if still or held:
            return after._doubting(Sensor.IMU, SensorFault.STUCK)
        if max(turns, speeds) >= _BAD:
            lately = self.pose_failed_us >= 0 and now_us - self.pose_failed_us <= _PROBATION_US
            of_pose = lately or min(turns, speeds) >= _BAD
            sensor = Sensor.POSE if of_pose else Sensor.IMU
            return after._doubting(sensor, SensorFault.DISAGREES)
        if self.doubted is not None and good >= self.again:
            again = min(2 * self.again, _MOST_GOOD)
            return Agreement(again=again, pose_failed_us=self.pose_failed_us, last=window)
        return after

    def after_calm(self, windows: int, last: Window) -> Agreement:
        """``after`` some ``windows`` of which ``is_calm`` is true, the ``last`` of them given."""
        return self._replace(turn=0, speed=0, good=self.good + windows, last=last)

    def without_pose(self) -> Agreement:
        """The judgement after a pose has been found to be late."""
        return self._replace(good=0)._doubting(Sensor.POSE, SensorFault.DISAGREES)

    def _doubting(self, sensor: Sensor, fault: SensorFault) -> Agreement:
        if self.doubted is not None:
            return self
        return self._replace(doubted=sensor, fault=fault)


_AGREED: Final = Agreement()


class Shadow(NamedTuple):
    """Where the inertial unit alone says that the vehicle is, while a pose is on probation."""

    since_us: int
    p: Vec3  # m, NED
    v: Vec3  # m/s, NED
    q: Vec4  # body to NED

    def apart(self, p: Vec3, now_us: int) -> bool:
        """Whether a place ``p`` [m, NED] at ``now_us`` [us] cannot be where this is."""
        t = 1e-6 * (now_us - self.since_us)
        return math.dist(p, self.p) > _PLACE_BACK + 2.5 * _FORCE_ERROR * t * t


class FrameTrust(NamedTuple):
    """What is carried from frame to frame."""

    last: SensorFrame | None = None
    pose: PartTrust = PartTrust()
    inertial: PartTrust = PartTrust()
    joints: PartTrust = PartTrust()
    returned_us: int = 0  # how long the pose was away that is now another one; 0: it is the same
    bad_us: tuple[int, int, int] = (_NEVER_US,) * 3  # when a bad frame of each part came last
    window: Window = _EMPTY  # the running one
    agreement: Agreement = _AGREED
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
            room = min(room, _PLACE_BACK + 5.0 * sigma)
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


Reading = tuple[Vec3, Vec3, Vec4, Vec3, Vec3, Vec2, Vec2]
"""A frame without its time: place, velocity, attitude, gyro, accelerometer, joints and rates."""


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
def is_calm(frames: int, turn: Vec3, speed: Vec3, same_rate: int, same_force: int) -> bool:
    """Whether neither sensor disagrees in a window of these sums, nor could be stuck.

    ``turn`` [rad, FRD], ``speed`` [m/s, NED].
    """
    near = norm(turn) < _TURN_APART and norm(speed) < _SPEED_APART
    return near and same_rate < frames and same_force < frames


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
def _machine_code() -> Callable[..., Any]:
    """``looked_at``, compiled when it is first wanted."""
    none, arm, level = (0.0, 0.0, 0.0), (0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    R = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    read = none, none, level, none, none, arm, arm
    estimate = none, none, R, none, 9.81, arm, arm
    return machine_code(looked_at, read, read, 0.002, _EMPTY, *estimate, 0.002, 0.0)


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
    never, far, R, yaw, stuck, rough, sums = _machine_code()(
        new, last, apart, trust.window, p0, v0, R0, w0, force0, q0, qd0, dt, sigma
    )
    window, agreement = Window(*sums), trust.agreement
    if window.frames >= WINDOW_FRAMES:
        agreement, window = agreement.after(window, s.t_us), _EMPTY
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
        shadow = _carried(shadow, s, dt) if s.t_us - shadow.since_us < _PROBATION_US else None
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
