"""What the parameters choose to be done about a condition."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from fsw.autopilot.flight.failsafe.conditions import Action
from fsw.autopilot.flight.failsafe.evidence import position_is_off
from fsw.autopilot.flight.situation import Situation
from fsw.autopilot.parameters.registry import BY_NAME
from fsw.autopilot.signals import BatteryWarning, Mode

BREAKER: Final = 121212  # of CBRK_FLIGHTTERM, PX4's number


# By what the parameters say of their values.
_CHOSEN: Final = {
    "None": Action.NONE,
    "Disabled": Action.WARN,
    "Warning": Action.WARN,
    "Hold": Action.HOLD,
    "Retreat along the normal, then hold": Action.RETREAT,
    "Return": Action.RETURN,
    "Land": Action.LAND,
    "Terminate": Action.TERMINATE,
}


def by(name: str) -> Callable[[Situation], Action]:
    """The action that a parameter chooses; hold, by a number that is none of its own."""
    parameter = BY_NAME[name]
    choices = {number: _CHOSEN[what] for number, what in parameter.choices}
    return lambda context: choices.get(int(parameter.read(context.config)), Action.HOLD)


_ON_DATALINK_LOST: Final = by("NAV_DLL_ACT")
on_actuator_failure: Final = by("COM_ACT_FAIL_ACT")


# Bits of COM_DLL_EXCEPT, PX4's; that of external modes is the one of its COM_RCL_EXCEPT.
_EXCEPTIONS: Final = {
    Mode.MISSION: 1,
    Mode.HOLD: 2,
    Mode.TAKEOFF: 2,
    Mode.OFFBOARD: 4,
    Mode.TRAJECTORY: 8,
}


def on_datalink_lost(context: Situation) -> Action:
    """NAV_DLL_ACT, but for the modes of COM_DLL_EXCEPT."""
    vehicle = context.state.vehicle
    flown = vehicle.failsafe_from or vehicle.mode  # the hold of a failsafe is no hold of a pilot's
    excepted = _EXCEPTIONS.get(flown, 0) & context.limits.station_loss_exceptions
    if not vehicle.flies or excepted:
        return Action.NONE
    return _ON_DATALINK_LOST(context)


def on_battery(context: Situation) -> Action:
    """COM_LOW_BAT_ACT: 0 warn, 2 land when critical, 3 return then and land in an emergency."""
    return {
        (2, BatteryWarning.CRITICAL): Action.LAND,
        (2, BatteryWarning.EMERGENCY): Action.LAND,
        (3, BatteryWarning.CRITICAL): Action.RETURN,
        (3, BatteryWarning.EMERGENCY): Action.LAND,
    }.get((context.limits.low_battery_action, context.state.battery.charge), Action.WARN)


def on_breach(name: str) -> Callable[[Situation], Action]:
    """The action that a parameter chooses, of a controller whose barriers promise no breach."""
    chosen = by(name)

    def action(context: Situation) -> Action:
        return chosen(context) if context.config.keeps_barriers else Action.WARN

    return action


def on_lack_of_room(context: Situation) -> Action:
    """Descend where no position is measured: what is lacking only grows."""
    off = position_is_off(context, context.limits.position_low)
    return Action.DESCEND if off else Action.WARN


_ON_BREACH: Final = on_breach("SAFE_BREACH_ACT")


def on_far_outside(context: Situation) -> Action:
    """Land, where a breach is to be acted on at all."""
    return Action.LAND if _ON_BREACH(context).mode is not None else Action.WARN


def on_tilt_lost(context: Situation) -> Action:
    """Terminate, unless CBRK_FLIGHTTERM is set."""
    broken = context.limits.termination_breaker == BREAKER
    return Action.WARN if broken else Action.TERMINATE


def on_rotor_lost(context: Situation) -> Action:
    """Terminate, or land where CBRK_FLIGHTTERM is set; what others fly without is a failed one."""
    if context.state.damage.spared:
        return on_rotor_failed(context)
    broken = context.limits.termination_breaker == BREAKER
    return Action.LAND if broken else Action.TERMINATE


def on_rotor_failed(context: Situation) -> Action:
    """COM_ACT_FAIL_ACT, and land at least where the heading cannot be held."""
    action = on_actuator_failure(context)
    if action is Action.WARN or not context.state.damage.severe:
        return action
    return action if action.strength > Action.LAND.strength else Action.LAND
