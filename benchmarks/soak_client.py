"""The busy and unlucky ground station of ``python -m benchmarks soak``."""

from __future__ import annotations

import random
import threading
import time
from dataclasses import dataclass, field
from typing import Any, Final

from fsw.link.endpoints import OpenEndpoint
from messages import dialect

SYSTEM, COMPONENT = 255, 190
ANSWER_S: Final = 1.0  # within which every command must be answered
GAP_S: Final = 0.3  # without a datagram of the vehicle or a turn of the client: is recorded
_EVERY_S: Final = 0.2  # from an answer to the next command
_FAULT_EVERY_S: Final = 10.0
_FAULT_LASTS_S: Final = 1.5
_BEAT_S: Final = 0.5
_TAKES_S: Final = 8.0  # from one takeoff to the next
_PATIENCE_S: Final = 10.0  # without being armed, until the flight software is restarted
_PARAMETERS: Final = ("SYS_FAILURE_EN", "COM_DL_LOSS_T", "BAT_LOW_THR", "JNT_ARMATURE")
_NAN: Final = float("nan")
_UNITS: Final = (
    dialect.FAILURE_UNIT_SENSOR_GYRO,
    dialect.FAILURE_UNIT_SENSOR_ACCEL,
    dialect.FAILURE_UNIT_SENSOR_VIO,
    dialect.FAILURE_UNIT_SYSTEM_MAVLINK_SIGNAL,
)
_KINDS: Final = (
    dialect.FAILURE_TYPE_OFF,
    dialect.FAILURE_TYPE_STUCK,
    dialect.FAILURE_TYPE_SLOW,
    dialect.FAILURE_TYPE_INTERMITTENT,
)

_OF_PLACES: Final = (dialect.MAV_CMD_DO_REPOSITION, dialect.MAV_CMD_NAV_TAKEOFF)

Asked = tuple[int, tuple[float, ...]]  # MAV_CMD and its seven parameters


@dataclass
class Heard:
    """What became of everything that was asked."""

    asked: int = 0
    answered_s: list[float] = field(default_factory=list)
    unanswered: list[tuple[float, int]] = field(default_factory=list)  # since the start, MAV_CMD
    results: dict[int, int] = field(default_factory=dict)  # how often each MAV_RESULT came
    parameters: int = 0  # that were read
    parameters_missing: int = 0
    faults: int = 0
    takeoffs: int = 0
    restarts: int = 0
    airborne_s: float = 0.0
    texts: int = 0
    gaps: list[tuple[float, float]] = field(default_factory=list)  # since the start, how long
    pauses: list[tuple[float, float]] = field(default_factory=list)  # likewise, of the client


class Client(threading.Thread):
    """Flies a vehicle about, asks it everything, and injects failures, until it is closed."""

    def __init__(self, seed: int) -> None:
        """Listen on a port of this machine's own; ``seed`` is the root of all choices."""
        super().__init__(daemon=True)
        self.heard = Heard()
        self._random = random.Random(seed)
        self._endpoint = OpenEndpoint(("127.0.0.1", 0))
        self._link: Any = dialect.MAVLink(None, srcSystem=SYSTEM, srcComponent=COMPONENT)
        self._link.robust_parsing = True
        self._vehicle: tuple[str, int] | None = None
        self._waiting: tuple[int, float] | None = None
        self._parameter: tuple[str, float] | None = None
        self._flies = self._aloft = self._armed = False
        self.first_heard_s = 0.0  # monotonic
        self._refused_s = 0.0  # since when it was not armed though it was to be; 0: it was
        self._seen_s = 0.0  # when it said last whether it flies
        self._beat_s = self._next_s = self._fault_s = self._takes_off_s = self._heard_s = 0.0
        self._fault: tuple[int, float] | None = None  # unit, and when it ends
        self._ended = False
        self._begin_s = self._turn_s = time.monotonic()

    @property
    def port(self) -> int:
        """UDP port of the client."""
        return self._endpoint.port

    @property
    def dropped(self) -> int | None:
        """Datagrams of the vehicle that this client's machine dropped before it could read them."""
        return self._endpoint.dropped

    def close(self) -> None:
        """Stop, and release the port."""
        self._ended = True
        self.join()
        self._endpoint.close()

    def run(self) -> None:
        """See :class:`Client`."""
        while not self._ended:
            now_s = time.monotonic()
            # Where the client stands still, the machine does, and so may the vehicle.
            self._note(self.heard.pauses, self._turn_s, now_s)
            self._turn_s = now_s
            if self._hear(now_s):
                continue  # what has come is read before anything counts as missing
            if self._vehicle is not None:
                self._beat(now_s)
                self._forget(now_s)
                if self._waiting is None and now_s >= self._next_s:
                    self._next_s = now_s + _EVERY_S
                    self._ask(self._failing(now_s) or self._next(now_s), now_s)

    def _hear(self, now_s: float) -> bool:
        """Take a datagram; returns whether there was one."""
        got = self._endpoint.receive_waiting()
        if got is None:
            time.sleep(0.002)
            return False
        datagram, self._vehicle = got
        self.first_heard_s = self.first_heard_s or now_s
        self._note(self.heard.gaps, self._heard_s or now_s, now_s)
        self._heard_s = now_s
        for message in self._link.parse_buffer(datagram) or []:
            self._take(message, now_s)
        return True

    def _note(self, gaps: list[tuple[float, float]], since_s: float, now_s: float) -> None:
        if now_s - since_s >= GAP_S:
            gaps.append((round(now_s - self._begin_s, 2), round(now_s - since_s, 3)))

    def _beat(self, now_s: float) -> None:
        """A heartbeat, and a parameter to read."""
        if now_s - self._beat_s < _BEAT_S:
            return
        self._beat_s = now_s
        invalid = dialect.MAV_AUTOPILOT_INVALID
        self._send(self._link.heartbeat_encode(dialect.MAV_TYPE_GCS, invalid, 0, 0, 0))
        if self._parameter is None:
            name = self._random.choice(_PARAMETERS)
            self._parameter = (name, now_s)
            self._send(self._link.param_request_read_encode(1, 1, name.encode(), -1))

    def _failing(self, now_s: float) -> Asked | None:
        """The end of a failure or the next one, where it is time for it."""
        if self._fault is not None and now_s >= self._fault[1]:
            unit, self._fault = self._fault[0], None
            return _failure(unit, dialect.FAILURE_TYPE_OK)
        if now_s < self._fault_s or not self._flies:
            return None
        self._fault_s = now_s + _FAULT_EVERY_S
        unit = self._random.choice(_UNITS)
        self.heard.faults += 1
        self._fault = (unit, now_s + _FAULT_LASTS_S)
        return _failure(unit, self._random.choice(_KINDS))

    def _next(self, now_s: float) -> Asked:
        draw = self._random.random()
        if not self._flies:
            if now_s < self._takes_off_s:
                return self._random.choice(_ASKED)
            if not self._armed:
                return self._arming(now_s)
            self.heard.takeoffs += 1
            self._takes_off_s = now_s + _TAKES_S
            height = -1.2 - 0.6 * draw
            return _command(dialect.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, _NAN, 0, 0, height)
        if draw < 0.003:  # once in a minute or so; returning lands as well
            return _mode(4, 6)  # land
        if draw < 0.02:
            return self._random.choice((_mode(4, 3), _mode(4, 5), _mode(6), _mode(4, 4)))
        if draw < 0.2:
            place = (self._random.uniform(-1.0, 1.0), self._random.uniform(-1.0, 1.0))
            return (dialect.MAV_CMD_DO_REPOSITION, (-1.0, 1.0, 0.0, _NAN, *place, -1.4))
        return self._random.choice(_ASKED)

    def _arming(self, now_s: float) -> Asked:
        """Arm it; what failed in the last flight is well again, and it has to be told."""
        self._refused_s = self._refused_s or now_s
        if now_s - self._refused_s < _PATIENCE_S:
            return _command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
        self._refused_s = 0.0
        self.heard.restarts += 1
        return _command(dialect.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1.0)

    def _take(self, message: Any, now_s: float) -> None:
        name, heard = message.get_type(), self.heard
        if name == "COMMAND_ACK" and message.target_system == SYSTEM:
            if self._waiting is not None and message.command == self._waiting[0]:
                heard.answered_s.append(now_s - self._waiting[1])
                heard.results[message.result] = heard.results.get(message.result, 0) + 1
                self._waiting = None
        elif name == "PARAM_VALUE" and self._parameter is not None:
            if message.param_id == self._parameter[0]:
                heard.parameters += 1
                self._parameter = None
        elif name == "HEARTBEAT":
            self._armed = bool(message.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
            if self._armed:
                self._refused_s = 0.0
        elif name == "EXTENDED_SYS_STATE":
            if self._aloft:
                heard.airborne_s += now_s - self._seen_s
            self._flies = message.landed_state == dialect.MAV_LANDED_STATE_IN_AIR
            # A take-off and a landing are in the air as well.
            self._aloft = message.landed_state > dialect.MAV_LANDED_STATE_ON_GROUND
            self._seen_s = now_s
        elif name == "STATUSTEXT":
            heard.texts += 1

    def _forget(self, now_s: float) -> None:
        if self._waiting is not None and now_s - self._waiting[1] > ANSWER_S:
            self.heard.unanswered.append((round(now_s - self._begin_s, 2), self._waiting[0]))
            self._waiting = None
        if self._parameter is not None and now_s - self._parameter[1] > ANSWER_S:
            self.heard.parameters_missing += 1
            self._parameter = None

    def _ask(self, asked: Asked, now_s: float) -> None:
        command, params = asked
        self.heard.asked += 1
        self._waiting = (command, now_s)
        if command in _OF_PLACES:
            north, east = (round(1e4 * value) for value in params[4:6])
            frame = dialect.MAV_FRAME_LOCAL_NED
            values = (*params[:4], north, east, params[6])
            self._send(self._link.command_int_encode(1, 1, frame, command, 0, 0, *values))
        else:
            self._send(self._link.command_long_encode(1, 1, command, 0, *params))

    def _send(self, message: Any) -> None:
        assert self._vehicle is not None
        self._endpoint.send(message.pack(self._link), self._vehicle)


def _command(number: int, *params: float) -> Asked:
    return number, (*params, *(0.0,) * (7 - len(params)))


def _mode(main: int, sub: int = 0) -> Asked:
    return _command(dialect.MAV_CMD_DO_SET_MODE, 1.0, main, sub)


def _failure(unit: int, kind: int) -> Asked:
    return _command(dialect.MAV_CMD_INJECT_FAILURE, unit, kind)


_VERSION: Final = dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION
_ATTITUDE: Final = dialect.MAVLINK_MSG_ID_ATTITUDE
_ASKED: Final = (
    _command(dialect.MAV_CMD_REQUEST_MESSAGE, _VERSION),
    _command(dialect.MAV_CMD_REQUEST_MESSAGE, 9999.0),  # that there is none is an answer
    _command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, _ATTITUDE, 50_000.0),
    _command(dialect.MAV_CMD_GET_MESSAGE_INTERVAL, _ATTITUDE),
    _command(dialect.MAV_CMD_RUN_PREARM_CHECKS),
    _command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1.0),
    _command(dialect.MAV_CMD_DO_SET_HOME, 1.0),
    _command(dialect.MAV_CMD_DO_CHANGE_SPEED, 1.0, 0.5, -1.0),
    _command(dialect.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 1.0),  # there is no camera
)
