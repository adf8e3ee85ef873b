"""What PX4 and a companion computer say to each other; wire order, see messages.frames."""

from __future__ import annotations

import math
from typing import Final, cast

from fsw.autopilot.signals import JointVector, Setpoint, Vec3
from fsw.link.wire.decode import Numbers
from messages import message_ids
from messages.frames import Frame, FrameWriter
from messages.message_ids import SYSTEM_ID

COMPANION: Final = 191  # MAV_COMP_ID_ONBOARD_COMPUTER
PX4: Final = (SYSTEM_ID, 1)  # who it is: system and component

OFFBOARD: Final = (6, 0)  # PX4's main and sub mode
HOLD: Final = (4, 3)
MODES: Final[dict[tuple[int, int], str]] = {
    (1, 0): "Manual",
    (2, 0): "Altitude",
    (3, 0): "Position",
    (3, 2): "Position Slow",
    (4, 1): "Ready",
    (4, 2): "Takeoff",
    HOLD: "Hold",
    (4, 4): "Mission",
    (4, 5): "Return",
    (4, 6): "Land",
    (4, 8): "Follow",
    (4, 9): "Precision Landing",
    (5, 0): "Acro",
    OFFBOARD: "Offboard",
    (7, 0): "Stabilized",
    (10, 0): "Termination",
}

SET_MODE: Final = 176  # MAV_CMD
SET_ACTUATOR: Final = 187
SET_INTERVAL: Final = 511
ARM_DISARM: Final = 400

ON_GROUND: Final = 1  # MAV_LANDED_STATE
_AUTOPILOT_PX4, _NO_AUTOPILOT, _ONBOARD_COMPUTER = 12, 8, 18  # MAV_AUTOPILOT, MAV_TYPE
_ARMED, _CUSTOM_MODE, _ACTIVE = 128, 1, 4  # MAV_MODE_FLAG, MAV_STATE
_LOCAL_NED: Final = 1  # MAV_FRAME
_BODY_FRAMES: Final = (8, 12)  # BODY_NED, BODY_FRD
_USE_ALL: Final = 0  # of POSITION_TARGET_TYPEMASK
ACTUATORS: Final = 6  # of a DO_SET_ACTUATOR


class CompanionWriter:
    """Builds what a companion computer sends to PX4."""

    def __init__(self) -> None:
        self._writer = FrameWriter(SYSTEM_ID, COMPANION)

    def heartbeat(self) -> bytes:
        """A second's sign of life."""
        values = (0, _ONBOARD_COMPUTER, _NO_AUTOPILOT, 0, _ACTIVE, 3)
        return self._writer.frame(message_ids.HEARTBEAT, *values)

    def target(self, t_us: int, wanted: Setpoint) -> bytes:
        """SET_POSITION_TARGET_LOCAL_NED with everything in it."""
        numbers = (*wanted.p, *wanted.v, *wanted.a, wanted.yaw, wanted.yaw_rate)
        values = (t_us // 1000 & 0xFFFFFFFF, *numbers, _USE_ALL, *PX4, _LOCAL_NED)
        return self._writer.frame(message_ids.SET_POSITION_TARGET_LOCAL_NED, *values)

    def command(self, number: int, *params: float) -> bytes:
        """COMMAND_LONG; parameters that are left out are zero."""
        seven = (*params, *(0.0,) * (7 - len(params)))
        return self._writer.frame(message_ids.COMMAND_LONG, *seven, number, *PX4, 0)

    def mode(self, mode: tuple[int, int]) -> bytes:
        """The command to fly in another of PX4's modes."""
        return self.command(SET_MODE, _CUSTOM_MODE, *map(float, mode))

    def interval(self, message_id: int, period_us: int) -> bytes:
        """The command to stream a message."""
        return self.command(SET_INTERVAL, float(message_id), float(period_us))

    def joints(self, shares: tuple[float, ...]) -> bytes:
        """DO_SET_ACTUATOR with the positions of servos, -1 to 1; the others stay."""
        six = (*shares[:ACTUATORS], *(math.nan,) * (ACTUATORS - len(shares)))
        return self.command(SET_ACTUATOR, *six, 0.0)

    def time_sync(self, answered_ns: int, sent_ns: int) -> bytes:
        """TIMESYNC: a question has no answer yet, 0."""
        return self._writer.frame(message_ids.TIMESYNC, answered_ns, sent_ns)


def is_of_px4(frame: Frame) -> bool:
    """Whether the autopilot itself has sent it: PX4 forwards what others say."""
    return (frame.system_id, frame.component_id) == PX4


def state_of(heartbeat: Numbers) -> tuple[bool, tuple[int, int]] | None:
    """Whether it is armed, and its mode; None of another autopilot's HEARTBEAT."""
    custom, _, autopilot, base, _, _ = heartbeat
    if autopilot != _AUTOPILOT_PX4:
        return None
    return bool(int(base) & _ARMED), mode_of(int(custom))


def mode_of(custom: int) -> tuple[int, int]:
    """PX4's main and sub mode of a custom mode."""
    return custom >> 16 & 0xFF, custom >> 24 & 0xFF


def mode_name(mode: tuple[int, int]) -> str:
    """What PX4 calls a mode."""
    return MODES.get(mode, f"mode {mode[0]}/{mode[1]}")


def velocity_frame(odometry: Numbers) -> str:
    """The frame of the velocity in an ODOMETRY: "world" or "body"; empty: neither.

    Nor does an ODOMETRY whose position is in another frame than local NED mean anything here.
    """
    frame, child = int(odometry[56]), int(odometry[57])
    if frame != _LOCAL_NED:
        return ""
    return "world" if child == _LOCAL_NED else "body" if child in _BODY_FRAMES else ""


def shares_of(ranges: tuple[tuple[float, float], ...], angles: JointVector) -> tuple[float, ...]:
    """Positions of servos, -1 to 1 of their ``ranges`` [rad], for joints at ``angles`` [rad]."""
    shares = []
    for (least, most), angle in zip(ranges, angles, strict=True):
        end = most if angle >= 0.0 else -least
        shares.append(min(max(angle / end, -1.0), 1.0) if end > 0.0 else 0.0)
    return tuple(shares)


def vector(values: Numbers, at: int) -> Vec3:
    """Three numbers of a message."""
    return cast(Vec3, tuple(values[at : at + 3]))
