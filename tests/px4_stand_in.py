"""A stand-in for PX4 at the other end of a simulator: its conversation as it was recorded.

It connects by TCP, sends COMMAND_LONG 511 and HEARTBEAT, leaves the first steps unanswered, and
then answers every HIL_SENSOR with one HIL_ACTUATOR_CONTROLS of the same stamp: flags 1, mode 1 or
129, all controls 0 while disarmed, motors in steps of 0.001 and servos in steps of 0.002.
`tests/sitl/test_px4_recordings.py` checks that against recordings of a real one.

Its control is its own, and small: a filter and a cascade that hover. Nothing about PX4's control
follows from it.
"""

from __future__ import annotations

import math
import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import cast

import numpy as np

from messages.frames import Frame, FrameWriter, Losses
from messages.stream_reader import StreamReader

HEARTBEAT, COMMAND_LONG, CONTROLS, HIL_SENSOR, HIL_GPS, ODOMETRY = 0, 76, 93, 107, 113, 331
HIL_STATE_QUATERNION, SET_MESSAGE_INTERVAL, PX4 = 115.0, 511, 12
LOCKSTEP_FLAG, CUSTOM_MODE, ARMED = 1, 1, 128
INERTIAL = 0x3F
SKIPPED = 10  # steps, as recorded; 8 to 14 were seen
GRAVITY = 9.81
EARTH_M = 6_371_000.0
GATE_M = 0.03  # of an innovation; more is refused, but for so many in a row
AGAIN = 20

Vector = np.ndarray


@dataclass
class Wish:
    """What its operator wants at a time of the simulation."""

    armed: bool = False
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m, NED
    joints: tuple[float, ...] = (0.0, 0.0)  # -1…1


Operator = Callable[[float], Wish]
"""What is wanted at a time [s] since the first HIL_SENSOR."""


@dataclass
class Airframe:
    """The vehicle as its parameters describe it."""

    mass: float  # kg
    inertia: tuple[float, float, float]  # kg m^2
    arm: float  # m
    yaw_ratio: float  # m
    thrust_max: float  # N, of a rotor
    joints: int = 2


@dataclass
class Px4StandIn:
    """PX4's end of the conversation, without sockets: bytes in, bytes out."""

    airframe: Airframe
    operator: Operator = lambda time_s: Wish()
    skipped: int = SKIPPED
    writer: FrameWriter = field(default_factory=lambda: FrameWriter(1, 1))
    steps: int = 0
    answered: int = 0
    seen: set[int] = field(default_factory=set)  # messages
    updated: list[int] = field(default_factory=list)  # fields_updated of each step

    def __post_init__(self) -> None:
        self._reader, self._losses = StreamReader(), Losses()
        self._first_us = self._last_us = 0
        self.p, self.v = np.zeros(3), np.zeros(3)
        self.R = np.eye(3)
        self._fixed = False
        self._origin: tuple[float, float, float] | None = None
        self._sum = np.zeros(3)  # integral of the position error, m s
        self._rate = np.zeros(3)
        self._bias = np.zeros(3)  # of the accelerometer, m/s^2
        self._refused = 0  # places in a row

    def greeting(self) -> bytes:
        """What it says once it is connected."""
        interval = (HIL_STATE_QUATERNION, 5000.0, *(0.0,) * 5, SET_MESSAGE_INTERVAL, 0, 0, 0)
        beat = (0, 0, PX4, 0, 0, 3)
        return self.writer.frame(COMMAND_LONG, *interval) + self.writer.frame(HEARTBEAT, *beat)

    def hear(self, data: bytes) -> bytes:
        """What it answers to some bytes of the simulator."""
        answers = b""
        for frame, _ in self._reader.cut(data, self._losses):
            self.seen.add(frame.message_id)
            values = cast("tuple[float, ...]", frame.payload_values)
            if frame.message_id == ODOMETRY:
                self._correct(np.array(values[1:4]), rotation(values[4:8]))
            elif frame.message_id == HIL_GPS:
                self._locate(frame)
            elif frame.message_id == HIL_SENSOR and values[15] == 0:
                answers += self._step(values)
        return answers

    def _step(self, values: tuple[float, ...]) -> bytes:
        t_us, updated = int(values[0]), int(values[14])
        self._first_us = self._first_us or t_us
        dt = 1e-6 * (t_us - (self._last_us or t_us))
        self._last_us = t_us
        self.updated.append(updated)
        self.steps += 1
        if updated & INERTIAL == INERTIAL:
            self._predict(np.array(values[1:4]), np.array(values[4:7]), dt)
        if self.steps <= self.skipped:
            return b""
        self.answered += 1
        wish = self.operator(1e-6 * (t_us - self._first_us))
        motors = self._motors(wish, dt) if wish.armed else [0.0] * 4
        joints = [0.002 * round(one / 0.002) for one in wish.joints] if wish.armed else []
        controls = [round(one, 3) for one in (*motors, *joints)]
        controls += [0.0] * (16 - len(controls))
        mode = CUSTOM_MODE | (ARMED if wish.armed else 0)
        return self.writer.frame(CONTROLS, t_us, LOCKSTEP_FLAG, *controls, mode)

    # Its estimate: dead reckoning that vision or satellites correct.
    def _predict(self, force: Vector, rate: Vector, dt: float) -> None:
        self._rate = rate
        self.R = self.R @ turn(rate * dt)
        self.v = self.v + (self.R @ (force - self._bias) + np.array([0.0, 0.0, GRAVITY])) * dt
        self.p = self.p + self.v * dt

    def _correct(self, p: Vector, R: Vector | None) -> None:
        if not self._fixed:
            self.p, self._fixed = p, True
            self.R = self.R if R is None else R
            self.v = np.zeros(3)
            return
        error = p - self.p
        self._refused = self._refused + 1 if np.linalg.norm(error) > GATE_M else 0
        if 0 < self._refused < AGAIN:
            return
        self.p = self.p + 0.15 * error
        self.v = self.v + 0.5 * error
        self._bias = self._bias - 0.3 * self.R.T @ error
        if R is not None:
            self.R = self.R @ turn(0.1 * vee(self.R.T @ R))

    def _locate(self, frame: Frame) -> None:
        values = cast("tuple[float, ...]", frame.payload_values)
        latitude, longitude, altitude = 1e-7 * values[1], 1e-7 * values[2], 1e-3 * values[3]
        here = (latitude, longitude, altitude)
        self._origin = self._origin or here
        north = math.radians(latitude - self._origin[0]) * EARTH_M
        east = math.radians(longitude - self._origin[1]) * EARTH_M
        east *= math.cos(math.radians(self._origin[0]))
        self._correct(np.array([north, east, self._origin[2] - altitude]), None)

    # Its control: position, attitude, rates, allocation.
    def _motors(self, wish: Wish, dt: float) -> list[float]:
        air = self.airframe
        error = np.clip(np.array(wish.place) - self.p, -1.0, 1.0)
        near = np.abs(error) < 0.15
        self._sum = self._sum + near * error * dt
        acceleration = 2.0 * error - 2.4 * self.v + 0.6 * self._sum
        wanted = acceleration - np.array([0.0, 0.0, GRAVITY])
        thrust = air.mass * float(-wanted @ self.R[:, 2])
        down = -wanted / np.linalg.norm(wanted)
        tilt = self.R.T @ np.cross(self.R[:, 2], down)
        yaw = math.atan2(self.R[1, 0], self.R[0, 0])
        turning = np.array([8.0 * tilt[0], 8.0 * tilt[1], -1.5 * yaw])
        torque = np.array(air.inertia) * np.array([14.0, 14.0, 5.0]) * (turning - self._rate)
        x, y, z = torque / np.array([2.0 * air.arm, 2.0 * air.arm, 4.0 * air.yaw_ratio])
        quarter = thrust / 4.0
        # 1 rear, 2 left, 3 front, 4 right; those in front and behind turn against those beside.
        forces = (quarter - y + z, quarter + x - z, quarter + y + z, quarter - x - z)
        return [min(max(force / air.thrust_max, 0.0), 1.0) for force in forces]


def turn(angle: Vector) -> Vector:
    """The rotation by a rotation vector [rad]."""
    size = float(np.linalg.norm(angle))
    x, y, z = angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if size < 1e-9:
        return np.eye(3) + cross
    a, b = math.sin(size) / size, (1.0 - math.cos(size)) / size**2
    return np.eye(3) + a * cross + b * cross @ cross


def vee(R: Vector) -> Vector:
    """The rotation vector of a small rotation."""
    return 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])


def rotation(q: tuple[float, ...]) -> Vector:
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


class Connected(threading.Thread):
    """A stand-in over TCP, until the simulator hangs up or it is told to."""

    def __init__(self, stand_in: Px4StandIn, port: int) -> None:
        super().__init__(daemon=True)
        self.stand_in = stand_in
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=30.0)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def run(self) -> None:
        self._socket.sendall(self.stand_in.greeting())
        while True:
            try:
                data = self._socket.recv(4096)
                if not data:
                    return
                answers = self.stand_in.hear(data)
                if answers:
                    self._socket.sendall(answers)
            except OSError:
                return

    def hang_up(self) -> None:
        """Leave, as PX4 does when it is ended."""
        self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
