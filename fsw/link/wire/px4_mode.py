"""Our modes in PX4's numbers, so that ground stations name them and offer their buttons."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from fsw.signals import FlightSnapshot, Mode

_MAIN_POSITION: Final = 3
_MAIN_AUTO: Final = 4
_MAIN_OFFBOARD: Final = 6
_AUTO_TAKEOFF: Final = 2
_AUTO_LOITER: Final = 3
_AUTO_MISSION: Final = 4
_AUTO_RTL: Final = 5
_AUTO_LAND: Final = 6
_AUTO_EXTERNAL1: Final = 11  # PX4's place for modes that are not its own
_POSITION_ORBIT: Final = 1

_NOT_SELECTABLE: Final = 2  # MAV_MODE_PROPERTY: entered by a command of its own

_MODES: Final[dict[Mode, tuple[int, int]]] = {
    # A disarmed vehicle has no flight mode of its own; PX4 shows the one it would start in.
    Mode.DISARMED: (_MAIN_AUTO, _AUTO_LOITER),
    Mode.TAKEOFF: (_MAIN_AUTO, _AUTO_TAKEOFF),
    Mode.HOLD: (_MAIN_AUTO, _AUTO_LOITER),
    Mode.MISSION: (_MAIN_AUTO, _AUTO_MISSION),
    Mode.RETURN: (_MAIN_AUTO, _AUTO_RTL),
    Mode.LAND: (_MAIN_AUTO, _AUTO_LAND),
    Mode.OFFBOARD: (_MAIN_OFFBOARD, 0),
    Mode.ORBIT: (_MAIN_POSITION, _POSITION_ORBIT),
    Mode.TRAJECTORY: (_MAIN_AUTO, _AUTO_EXTERNAL1),
    # Terminated, rotors off: PX4 has no mode for it; system_status says it is an emergency.
    Mode.FAULT: (_MAIN_AUTO, _AUTO_LAND),
}


@dataclass(frozen=True, slots=True)
class AvailableMode:
    """One row of AVAILABLE_MODES."""

    name: str
    custom_mode: int
    standard_mode: int  # MAV_STANDARD_MODE, 0 where it is none of those
    properties: int = 0  # MAV_MODE_PROPERTY


def shown_mode(snapshot: FlightSnapshot) -> Mode:
    """The mode for ground stations: while disarmed the one that arming would lead to."""
    return snapshot.standby if snapshot.mode is Mode.DISARMED else snapshot.mode


def custom_mode(mode: Mode) -> int:
    """PX4's custom_mode: main mode in bits 16 to 23, sub mode in bits 24 to 31."""
    main, sub = _MODES[mode]
    return main << 16 | sub << 24


# What a ground station may offer, in the order of AVAILABLE_MODES.
AVAILABLE_MODES: Final = (
    AvailableMode("Hold", custom_mode(Mode.HOLD), 0),
    AvailableMode("Takeoff", custom_mode(Mode.TAKEOFF), 8),
    AvailableMode("Mission", custom_mode(Mode.MISSION), 6),
    # Not 5, safe recovery, as PX4 has it: QGroundControl 4.4 then renames the mode, and does not
    # find what its own Return button is looking for.
    AvailableMode("Return", custom_mode(Mode.RETURN), 0),
    AvailableMode("Land", custom_mode(Mode.LAND), 7),
    AvailableMode("Offboard", custom_mode(Mode.OFFBOARD), 0),
    AvailableMode("Orbit", custom_mode(Mode.ORBIT), 2, _NOT_SELECTABLE),
    AvailableMode("Trajectory", custom_mode(Mode.TRAJECTORY), 0),
)
