"""A ground station for one flight of the matrix: it asks for a mode and notes texts and modes."""

from __future__ import annotations

import socket
import threading
import time
from dataclasses import dataclass
from typing import Any, Final

from fsw.autopilot.signals import Mode
from fsw.link.wire.identity import MODE_BY_PX4
from messages import dialect

_BEAT_S: Final = 0.5
_SETPOINT_S: Final = 0.05
_ASKS_AT_S: Final = 1.0  # after the first heartbeat
_GCS: Final = dialect.MAV_TYPE_GCS
_NO_AUTOPILOT: Final = dialect.MAV_AUTOPILOT_INVALID
_ARMED: Final = dialect.MAV_MODE_FLAG_SAFETY_ARMED
_TERMINATED: Final = dialect.MAV_STATE_FLIGHT_TERMINATION
_LOCAL_NED: Final = dialect.MAV_FRAME_LOCAL_NED
_POSITION_ONLY: Final = 0x0DF8  # type mask of SET_POSITION_TARGET_LOCAL_NED
_HEIGHT: Final = 1.425  # m, of the base
_NAN: Final = float("nan")
_MODES: Final = {(int(main), int(sub)): mode for (main, sub), mode in MODE_BY_PX4.items()}
_WAYPOINT: Final = dialect.MAV_CMD_NAV_WAYPOINT
_MISSION: Final = ((0.0, 0.8), (0.0, -0.8), (0.0, 0.8))  # m, north and east


@dataclass(frozen=True, slots=True)
class Noted:
    """A text, or a mode that began."""

    at_s: float  # on the monotonic clock
    severity: int = 99
    text: str = ""
    mode: Mode | None = None
    terminated: bool = False


class Station(threading.Thread):
    """Talks to one vehicle until it is closed."""

    def __init__(self, mode: str) -> None:
        """Ask for a mode of the matrix one second after the vehicle's first heartbeat."""
        super().__init__(daemon=True)
        self.noted: list[Noted] = []
        self._wanted, self._commands = mode, _COMMANDS[mode]
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(0.02)
        self._link: Any = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
        self._link.robust_parsing = True
        self._vehicle: tuple[str, int] | None = None
        self._first_s: float | None = None
        self._asked = 0
        self._mode: tuple[Mode | None, bool] = (None, False)
        self._ended = False

    @property
    def port(self) -> int:
        """UDP port of the station."""
        return int(self._socket.getsockname()[1])

    def close(self) -> None:
        """Stop and release the port."""
        self._ended = True
        self.join()
        self._socket.close()

    def run(self) -> None:
        """See :class:`Station`."""
        beat_s = setpoint_s = 0.0
        while not self._ended:
            self._hear()
            now_s = time.monotonic()
            if self._vehicle is None or self._first_s is None:
                continue
            if now_s - beat_s >= _BEAT_S:
                beat_s = now_s
                self._send(self._link.heartbeat_encode(_GCS, _NO_AUTOPILOT, 0, 0, 0))
                self._ask(now_s - self._first_s)
            if self._wanted == "offboard" and now_s - setpoint_s >= _SETPOINT_S:
                setpoint_s = now_s
                self._send(
                    self._link.set_position_target_local_ned_encode(
                        0, 1, 1, _LOCAL_NED, _POSITION_ONLY, 0.0, 0.5, -_HEIGHT, *(0.0,) * 8
                    )
                )

    def _hear(self) -> None:
        try:
            datagram, self._vehicle = self._socket.recvfrom(2048)
        except (TimeoutError, ConnectionRefusedError):
            return
        for message in self._link.parse_buffer(datagram) or []:
            name = message.get_type()
            now_s = time.monotonic()
            if name == "HEARTBEAT" and message.get_srcComponent() == 1:
                self._first_s = now_s if self._first_s is None else self._first_s
                self._note_mode(now_s, message)
            elif name == "STATUSTEXT":
                self.noted.append(Noted(now_s, int(message.severity), message.text))
            elif name in ("MISSION_REQUEST_INT", "MISSION_REQUEST"):
                self._send(self._item(message.seq))

    def _note_mode(self, now_s: float, beat: Any) -> None:
        main, sub = beat.custom_mode >> 16 & 0xFF, beat.custom_mode >> 24
        armed = beat.base_mode & _ARMED
        mode = _MODES.get((main, sub)) if armed else Mode.DISARMED  # which PX4 has no number for
        terminated = beat.system_status == _TERMINATED
        now = mode, terminated
        if now != self._mode:
            self._mode = now
            self.noted.append(Noted(now_s, mode=mode, terminated=terminated))

    def _ask(self, since_s: float) -> None:
        """Ask for the mode, twice in case that a datagram is lost."""
        if since_s < _ASKS_AT_S or self._asked >= 2:
            return
        self._asked += 1
        for number, params in self._commands:
            self._send(self._link.command_int_encode(1, 1, _LOCAL_NED, number, 0, 0, *params))
        if self._wanted == "mission" and self._asked == 1:
            self._send(self._link.mission_count_encode(1, 1, len(_MISSION), 0))

    def _item(self, number: int) -> Any:
        north, east = (round(1e4 * value) for value in _MISSION[number])
        return self._link.mission_item_int_encode(
            1, 1, number, _LOCAL_NED, _WAYPOINT, 0, 1, 0.0, 0.0, 0.0, _NAN, north, east, -1.2, 0
        )

    def _send(self, message: Any) -> None:
        assert self._vehicle is not None
        self._socket.sendto(message.pack(self._link), self._vehicle)


_SET_MODE: Final = dialect.MAV_CMD_DO_SET_MODE
_ARM: Final = dialect.MAV_CMD_COMPONENT_ARM_DISARM
_HOME: Final = dialect.MAV_CMD_DO_SET_HOME
_START: Final = dialect.MAV_CMD_MISSION_START
_ORBIT: Final = dialect.MAV_CMD_DO_ORBIT
_TAKEOFF: Final = dialect.MAV_CMD_NAV_TAKEOFF


def _mode(main: int, sub: int = 0) -> tuple[int, tuple[Any, ...]]:
    return (_SET_MODE, (1.0, float(main), float(sub), 0.0, 0, 0, 0.0))


# MAV_CMD and the seven parameters of a COMMAND_INT; positions in 1e-4 m.
_COMMANDS: Final[dict[str, list[tuple[int, tuple[Any, ...]]]]] = {
    "hold": [_mode(4, 3)],
    "trajectory": [],
    "workspace": [],
    "press": [],
    "offboard": [_mode(6)],
    "mission": [(_START, (0.0, 0.0, 0.0, 0.0, 0, 0, 0.0))],
    "orbit": [(_ORBIT, (0.6, 0.4, _NAN, _NAN, -6000, 0, -_HEIGHT))],
    "takeoff": [
        (_ARM, (1.0, 0.0, 0.0, 0.0, 0, 0, 0.0)),
        (_TAKEOFF, (0.0, 0.0, 0.0, _NAN, 0, 0, -1.6)),
    ],
    "land": [_mode(4, 6)],
    "return": [(_HOME, (0.0, 0.0, 0.0, 0.0, 0, 10000, -0.32)), _mode(4, 5)],
}
