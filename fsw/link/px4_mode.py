"""Our modes in PX4's numbers, so that ground stations name them and offer their buttons."""

from __future__ import annotations

from typing import Final

from fsw.signals import Mode

_MAIN_AUTO: Final = 4
_MAIN_OFFBOARD: Final = 6
_AUTO_TAKEOFF: Final = 2
_AUTO_LOITER: Final = 3
_AUTO_LAND: Final = 6

_MODES: Final[dict[Mode, tuple[int, int]]] = {
    # A disarmed vehicle has no flight mode of its own; PX4 shows the one it would start in.
    Mode.DISARMED: (_MAIN_AUTO, _AUTO_LOITER),
    Mode.TAKEOFF: (_MAIN_AUTO, _AUTO_TAKEOFF),
    Mode.HOLD: (_MAIN_AUTO, _AUTO_LOITER),
    Mode.TRAJECTORY: (_MAIN_OFFBOARD, 0),
    Mode.LAND: (_MAIN_AUTO, _AUTO_LAND),
    # Terminated, rotors off: PX4 has no mode for it; system_status says it is an emergency.
    Mode.FAULT: (_MAIN_AUTO, _AUTO_LAND),
}


def custom_mode(mode: Mode) -> int:
    """PX4's custom_mode: main mode in bits 16 to 23, sub mode in bits 24 to 31."""
    main, sub = _MODES[mode]
    return main << 16 | sub << 24
