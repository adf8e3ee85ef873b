"""What is done in flight when the ground station, the set-points or the battery give out.

Parameters say what, in PX4's names and numbers. Faults of the vehicle itself are in
``fsw.vehicle.faults``.
"""

from __future__ import annotations

from typing import Final

from fsw.signals import BatteryState, Charge, Mode, Severity, StatusText
from fsw.vehicle.modes import Event

_STATION_LOST: Final = {1: Event.HOLD, 2: Event.GO_HOME, 3: Event.LAND}  # NAV_DLL_ACT
_SETPOINTS_LOST: Final = {3: Event.GO_HOME, 4: Event.LAND, 5: Event.HOLD}  # COM_OBL_RC_ACT
_LOW_BATTERY: Final = {  # COM_LOW_BAT_ACT
    (2, Charge.CRITICAL): Event.LAND,
    (2, Charge.EMERGENCY): Event.LAND,
    (3, Charge.CRITICAL): Event.GO_HOME,
    (3, Charge.EMERGENCY): Event.LAND,
}
_CHARGE_TEXTS: Final = {
    Charge.LOW: (Severity.WARNING, "battery low"),
    Charge.CRITICAL: (Severity.CRITICAL, "battery critical"),
    Charge.EMERGENCY: (Severity.EMERGENCY, "battery nearly empty"),
}
# Modes that an operator flies; the others fly by themselves and go on.
_GUIDED: Final = (Mode.TAKEOFF, Mode.HOLD, Mode.ORBIT, Mode.OFFBOARD)


def station_lost(action: int, mode: Mode) -> Event | None:
    """What to do in flight without a ground station; None: go on."""
    return _STATION_LOST.get(action) if mode in _GUIDED else None


def setpoints_lost(action: int) -> Event:
    """What to do when set-points stop while they steer: to go on is impossible."""
    return _SETPOINTS_LOST.get(action, Event.HOLD)


def battery_low(action: int, charge: Charge, mode: Mode) -> Event | None:
    """What to do in flight at a level of charge; None: go on."""
    event = _LOW_BATTERY.get((action, charge))
    done = mode is Mode.LAND or (mode is Mode.RETURN and event is Event.GO_HOME)
    return None if done else event


def battery_text(battery: BatteryState) -> StatusText:
    """What is said of a level below OK."""
    severity, what = _CHARGE_TEXTS[battery.charge]
    return StatusText(severity, f"{what}: {100.0 * battery.remaining:.0f} % left")
