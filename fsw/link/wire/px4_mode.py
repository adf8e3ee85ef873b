"""Flight modes in PX4's numbering."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from fsw.autopilot.flight.modes import MODES
from fsw.autopilot.signals import FlightSnapshot, Mode

_NOT_SELECTABLE: Final = 2  # MAV_MODE_PROPERTY: entered by a command of its own
# A disarmed vehicle has no flight mode of its own; PX4 shows the one it would start in. Terminated,
# rotors off: PX4 has no mode for it; system_status says that it is an emergency.
_SHOWN_AS: Final = {Mode.DISARMED: Mode.HOLD, Mode.FAULT: Mode.LAND}

MODE_BY_PX4: Final = {
    (float(m.px4.main), float(m.px4.sub)): mode for mode, m in MODES.items() if m.px4.offered
}
MODE_BY_STANDARD: Final = {
    float(m.px4.standard or m.px4.also_standard): mode
    for mode, m in MODES.items()
    if m.px4.selectable and (m.px4.standard or m.px4.also_standard)
}


@dataclass(frozen=True, slots=True)
class AvailableMode:
    """One row of AVAILABLE_MODES."""

    name: str
    custom_mode: int
    standard_mode: int  # MAV_STANDARD_MODE, 0 where it is none of those
    properties: int  # MAV_MODE_PROPERTY


def shown_mode(snapshot: FlightSnapshot) -> Mode:
    """The mode for ground stations: while disarmed the one that arming would lead to."""
    return snapshot.intended_mode if snapshot.mode is Mode.DISARMED else snapshot.mode


def custom_mode(mode: Mode) -> int:
    """PX4's custom_mode: main mode in bits 16 to 23, sub mode in bits 24 to 31."""
    px4 = MODES[_SHOWN_AS.get(mode, mode)].px4
    return px4.main << 16 | px4.sub << 24


# What a ground station may offer, in the order of AVAILABLE_MODES.
AVAILABLE_MODES: Final = tuple(
    AvailableMode(
        mode.value.capitalize(),
        custom_mode(mode),
        kind.px4.standard,
        0 if kind.px4.selectable else _NOT_SELECTABLE,
    )
    for mode, kind in MODES.items()
    if kind.px4.offered
)
