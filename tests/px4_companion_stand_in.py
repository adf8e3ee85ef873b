"""A stand-in for PX4 as a companion computer sees it: modes, streams, and a model of its control.

What it accepts and answers is what a real one did, PX4 v1.17 at a70a558393: DO_SET_MODE gets two
answers, HEARTBEAT comes once a second and CURRENT_MODE when it changes, Offboard needs a stream, is
left 1 s after the last setpoint with "Failsafe activated" and entered again by the next one, unless
its pilot has chosen another mode, SET_MESSAGE_INTERVAL is answered 0,
ODOMETRY comes 125 times a second at most with its velocity in NED (child frame 1), DO_SET_ACTUATOR
acts at once.

Its control is PX4's in structure, with the gains that it has: position P, velocity P, I and D on
the measured acceleration, thrust vector, attitude P, rates PID, yaw torque through a low-pass;
the outer loop every second step. Rotors that cannot give all keep the thrust first, then roll and
pitch, then yaw, as PX4's with airmode do.
Pushed as `pandion px4 identify` pushes, it was found to be 66 1/s^2, 11.4 1/s and 45 ms, and a real
PX4 with the same gains 73, 12.5 and 46.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import cast

import numpy as np

from messages.frames import FrameWriter, Losses
from messages.stream_reader import StreamReader
from tests.px4_stand_in import GRAVITY, Px4StandIn, Vector, Wish, vee

ATTITUDE_QUATERNION, TARGET, TIMESYNC, STATUSTEXT, ACK = 31, 84, 111, 253, 77
EXTENDED_SYS_STATE, BATTERY_STATUS, ODOMETRY, HEARTBEAT, COMMAND_LONG = 245, 147, 331, 0, 76
POSITION, TAKEOFF, HOLD, LAND, OFFBOARD = (3, 0), (4, 2), (4, 3), (4, 6), (6, 0)
ARM, SET_MODE, SET_ACTUATOR, SET_INTERVAL, NAV_TAKEOFF = 400, 176, 187, 511, 22
STREAM_LOSS_S = 1.0  # COM_OF_LOSS_T
CURRENT_MODE = 436
KNOWN = (CURRENT_MODE, ATTITUDE_QUATERNION, ODOMETRY, EXTENDED_SYS_STATE, BATTERY_STATUS)
FASTEST_US = {ODOMETRY: 8000, ATTITUDE_QUATERNION: 4000}
SINKS = 0.75  # m/s, in Position without sticks
YAW_MARGIN = 1.15  # of full thrust: so much may yaw ask before it is cut, at the cost of thrust


@dataclass(frozen=True)
class Gains:
    """PX4's parameters, as `pandion px4 params` sets them."""

    xy_p: float = 1.8
    xy_vel_p: float = 5.0
    xy_vel_i: float = 1.0
    xy_vel_d: float = 0.6
    z_p: float = 1.5
    z_vel_p: float = 8.0
    z_vel_i: float = 2.0
    tilt_p: float = 7.0
    yaw_p: float = 1.5
    rate: float = 25.0  # 1/s, from an error of roll and pitch rates to angular acceleration
    rate_i: float = 4.9  # 1/s^2
    yaw_rate: float = 5.0  # rad/s
    yaw_rate_i: float = 2.5  # 1/s^2
    yaw_cutoff: float = 12.6  # rad/s, of its torque
    most_integral: tuple[float, float, float] = (7.3, 7.3, 0.55)  # rad/s^2: 0.3 of full torque
    rate_d: float = 0.7  # from angular acceleration to the same


@dataclass
class Target:
    p: Vector
    v: Vector
    a: Vector
    yaw: float
    yaw_rate: float


@dataclass
class Px4Companion(Px4StandIn):
    """PX4 with a companion's link; ``said`` is what it has for the companion."""

    gains: Gains = field(default_factory=Gains)
    child_frame: int = 1  # of ODOMETRY's velocity: 1 the world's, 12 the body's
    loss_mode: tuple[int, int] = HOLD  # by COM_OBL_RC_ACT: 5 is Hold, 0 is Position
    accepts_offboard: bool = True
    armed: bool = False
    mode: tuple[int, int] = HOLD
    flies: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        self.said = b""
        self.ear, self.mouth = StreamReader(), FrameWriter(1, 1)
        self.intervals: dict[int, int] = {TIMESYNC: 100_000, HEARTBEAT: 1_000_000}
        self.due: dict[int, int] = {}
        self.target: Target | None = None
        self.target_us = -1
        self.targets = 0
        self.joints: tuple[float, ...] = (0.0,) * self.airframe.joints
        self.hold: tuple[Vector, float] | None = None
        self.takeoff_to = 1.5  # m
        self.failsafe = False  # Offboard is meant, and the stream is lost
        self.deaf = False  # what the companion sends gets lost
        self.mute = False  # what it sends to the companion does
        self.commands: list[tuple[int, tuple[float, ...]]] = []
        self.texts: list[str] = []
        self.round_trips = 0
        self._z = np.zeros(3)
        self._rate_i = np.zeros(3)
        self._last_rate = np.zeros(3)
        self._rate_dot = np.zeros(3)
        self._yaw_torque = 0.0  # rad/s^2
        self._force = np.array([0.0, 0.0, -GRAVITY])
        self._wanted_R, self._thrust = np.eye(3), 0.0
        self._acc = np.zeros(3)

    def airborne(self) -> None:
        """Flying in Hold from the beginning."""
        self.armed = self.flies = True
        self.mode, self.skipped = HOLD, 0
        self._thrust = self.airframe.mass * GRAVITY

    # ---------------------------------------------------------------- its companion

    def switch(self, mode: tuple[int, int]) -> bool:
        """What its pilot does; False where it does not accept it."""
        if mode == OFFBOARD and not (self.accepts_offboard and self._streams()):
            return False
        self.failsafe = False
        if mode != self.mode:
            self.mode, self.hold = mode, None
            if CURRENT_MODE in self.intervals:
                self._say(CURRENT_MODE, self._custom, self._custom, 0)
        return True

    @property
    def _custom(self) -> int:
        return self.mode[0] << 16 | self.mode[1] << 24

    def hear_companion(self, data: bytes) -> None:
        if self.deaf:
            return
        for frame, _ in self.ear.cut(data, Losses()):
            values = cast("tuple[float, ...]", frame.payload_values)
            if frame.message_id == TARGET:
                assert int(values[12]) == 0, "every part is used"
                assert int(values[15]) == 1, "local NED"
                p, v, a = (np.array(values[k : k + 3]) for k in (1, 4, 7))
                self.target = Target(p, v, a, values[10], values[11])
                self.target_us, self.targets = self._last_us, self.targets + 1
            elif frame.message_id == COMMAND_LONG:
                self._command(int(values[7]), values[:7], frame.component_id)
            elif frame.message_id == TIMESYNC:
                answered, sent = int(values[0]), int(values[1])
                if answered == 0:
                    self._say(TIMESYNC, 1000 * self._last_us, sent)
                else:
                    self.round_trips += 1

    def _command(self, number: int, params: tuple[float, ...], component: int) -> None:
        self.commands.append((number, params))
        result = 0
        if number == SET_MODE:
            self._answer(number, 0, component)
            result = 0 if self.switch((int(params[1]), int(params[2]))) else 1
        elif number == SET_ACTUATOR:
            self.joints = tuple(
                old if math.isnan(new) else new
                for old, new in zip(self.joints, params[:6], strict=False)
            )
        elif number == SET_INTERVAL:
            message = int(params[0])
            result = 0 if message in KNOWN else 4
            if message in KNOWN:
                self.intervals[message] = max(int(params[1]), FASTEST_US.get(message, 0))
        elif number == ARM:
            self.armed = params[0] > 0.5
        elif number == NAV_TAKEOFF:
            self.switch(TAKEOFF)
        else:
            result = 3
        self._answer(number, result, component)

    def _answer(self, number: int, result: int, component: int) -> None:
        self._say(ACK, number, result, 0, 0, 1, component)

    def _streams(self) -> bool:
        return self.target_us >= 0 and 1e-6 * (self._last_us - self.target_us) < STREAM_LOSS_S

    def _say(self, message: int, *values: float | bytes) -> None:
        if not self.mute:
            self.said += self.mouth.frame(message, *values)

    def _text(self, severity: int, text: str) -> None:
        self.texts.append(text)
        self._say(STATUSTEXT, severity, text.encode(), 0, 0)

    def _speak(self, t_us: int) -> None:
        for message, interval in self.intervals.items():
            if t_us < self.due.get(message, 0):
                continue
            self.due[message] = t_us + interval - t_us % interval
            if message == ATTITUDE_QUATERNION:
                self._say(message, t_us // 1000, *quaternion(self.R), *self._rate, *(0.0,) * 4)
            elif message == ODOMETRY:
                v = self.v if self.child_frame == 1 else self.R.T @ self.v
                head = (t_us, *self.p, *quaternion(self.R), *v, *self._rate)
                self._say(message, *head, *(0.0,) * 42, 1, self.child_frame, 0, 8, 0)
            elif message == EXTENDED_SYS_STATE:
                self._say(message, 0, 2 if self.flies else 1)
            elif message == TIMESYNC:
                self._say(message, 0, 1000 * t_us)
            elif message == BATTERY_STATUS:
                cells = (16200, *(65535,) * 9)
                self._say(message, 0, 0, 32767, *cells, -1, 0, 1, 1, 100, 0, 0, *(0,) * 4, 0, 0)
            elif message == HEARTBEAT:
                base = 1 | (128 if self.armed else 0)
                self._say(message, self._custom, 2, 12, base, 4, 3)

    # ---------------------------------------------------------------- its loops

    def _step(self, values: tuple[float, ...]) -> bytes:
        self._force = np.array(values[1:4])
        wish = Wish(self.armed, (0.0, 0.0, 0.0), self.joints)
        self.operator = lambda _: wish
        answer = super()._step(values)
        if self.mode == OFFBOARD and self.armed and not self._streams():
            self._text(2, "Failsafe activated")
            self.switch(self.loss_mode)
            self.failsafe = True
        elif self.failsafe and self._streams():
            self.switch(OFFBOARD)
        self._speak(self._last_us)
        return answer

    def _motors(self, wish: Wish, dt: float) -> list[float]:
        if self.steps % 2 == 0:
            self._position(2.0 * dt)
        return self._allocate(self._torque(dt))

    def _position(self, dt: float) -> None:
        g = self.gains
        target = self._target(dt)
        self._acc += 0.5 * (self.R @ self._force + np.array([0.0, 0.0, GRAVITY]) - self._acc)
        p, v, i = (
            np.array([g.xy_p, g.xy_p, g.z_p]),
            np.array([g.xy_vel_p, g.xy_vel_p, g.z_vel_p]),
            np.array([g.xy_vel_i, g.xy_vel_i, g.z_vel_i]),
        )
        error = p * (target.p - self.p) + target.v - self.v
        d = np.array([g.xy_vel_d, g.xy_vel_d, 0.0])
        a = target.a + v * error + self._z - d * self._acc
        self._z = np.clip(self._z + i * error * dt, -3.0, 3.0)
        down = np.array([-a[0], -a[1], GRAVITY])
        down /= np.linalg.norm(down)
        x = np.array([math.cos(target.yaw), math.sin(target.yaw), 0.0])
        y = np.cross(down, x)
        y /= np.linalg.norm(y)
        self._wanted_R = np.column_stack((np.cross(y, down), y, down))
        hover = self.airframe.mass * GRAVITY
        self._thrust = max(hover * (1.0 - a[2] / GRAVITY) / max(down[2], 0.5), 0.0)
        self._yaw_rate = target.yaw_rate

    _yaw_rate = 0.0

    def _target(self, dt: float) -> Target:
        if self.mode == OFFBOARD and self.target is not None:
            return self.target
        zero = np.zeros(3)
        yaw = math.atan2(self.R[1, 0], self.R[0, 0])
        if self.hold is None:
            self.hold = self.p.copy(), yaw
        place, yaw = self.hold
        v = zero
        if self.mode == TAKEOFF:
            climbed = place[2] - 0.5 * dt
            place = np.array([*place[:2], max(climbed, -self.takeoff_to)])
            v = np.array([0.0, 0.0, -0.5 if climbed > -self.takeoff_to else 0.0])
            self.flies = self.flies or self.p[2] < -0.6
            if self.p[2] < -self.takeoff_to + 0.1:
                self.switch(HOLD)
        elif self.mode == POSITION:
            place, v = place + np.array([0.0, 0.0, SINKS * dt]), np.array([0.0, 0.0, SINKS])
        if self.hold is not None:
            self.hold = place, yaw
        return Target(place, v, zero, yaw, 0.0)

    def _torque(self, dt: float) -> Vector:
        g = self.gains
        tilt = vee(self.R.T @ self._wanted_R)
        wanted = np.array([g.tilt_p, g.tilt_p, g.yaw_p]) * tilt
        wanted[2] += self._yaw_rate
        if dt > 0.0:
            self._rate_dot += 0.5 * ((self._rate - self._last_rate) / dt - self._rate_dot)
        self._last_rate = self._rate
        error = wanted - self._rate
        more = np.array([g.rate_i, g.rate_i, g.yaw_rate_i]) * error * dt
        self._rate_i = np.clip(self._rate_i + more, *np.outer((-1.0, 1.0), g.most_integral))
        bandwidth = np.array([g.rate, g.rate, g.yaw_rate])
        lead = np.array([g.rate_d, g.rate_d, 0.0])
        turning = bandwidth * error + self._rate_i - lead * self._rate_dot
        self._yaw_torque += dt / (dt + 1.0 / g.yaw_cutoff) * (turning[2] - self._yaw_torque)
        turning[2] = self._yaw_torque
        return np.array(self.airframe.inertia) * turning

    def _allocate(self, torque: Vector) -> list[float]:
        air = self.airframe
        arms = np.array([2.0 * air.arm, 2.0 * air.arm, 4.0 * air.yaw_ratio]) * air.thrust_max
        shares = allocated(self._thrust / (4.0 * air.thrust_max), *(torque / arms))
        return [float(one) for one in shares]


def allocated(thrust: float, roll: float, pitch: float, yaw: float) -> Vector:
    """Shares of full thrust of the rotors rear, left, front, right of shares on each axis.

    Beyond an end, thrust is moved first, then yaw, then thrust is taken; the rest is cut.
    """
    level, turn_by = np.ones(4), np.array([1.0, -1.0, 1.0, -1.0])
    shares = thrust + np.array([-pitch, roll, pitch, -roll])
    for share in (1.0, 0.5):
        shares = shares + share * moved_inside(shares, level, 1.0)
    shares = shares + yaw * turn_by
    for share in (1.0, 0.5):
        shares = shares + share * moved_inside(shares, turn_by, YAW_MARGIN)
    taken = moved_inside(shares, level, 1.0)
    if taken.max() <= 0.0:
        shares = shares + taken
        shares = shares + 0.5 * moved_inside(shares, level, 1.0)
    return cast("Vector", np.clip(shares, 0.0, 1.0))


def moved_inside(shares: Vector, along: Vector, most: float) -> Vector:
    """How far to go along a direction of ones so that both ends are passed by as much."""
    beyond = along * (np.maximum(-shares, 0.0) - np.maximum(shares - most, 0.0))
    return cast("Vector", (min(beyond.min(), 0.0) + max(beyond.max(), 0.0)) * along)


def quaternion(R: Vector) -> tuple[float, float, float, float]:
    """w, x, y, z of a rotation of less than half a turn."""
    w = 0.5 * math.sqrt(max(1.0 + R[0, 0] + R[1, 1] + R[2, 2], 1e-12))
    x, y, z = (R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1])
    return w, x / (4.0 * w), y / (4.0 * w), z / (4.0 * w)
