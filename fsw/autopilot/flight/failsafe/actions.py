"""What the parameters choose to be done about a condition, in PX4's numbers."""

from __future__ import annotations

from typing import Final

from fsw.autopilot.flight.failsafe.conditions import Action
from fsw.autopilot.flight.failsafe.evidence import FailsafeContext, position_is_off
from fsw.autopilot.signals import BatteryWarning, Mode

BREAKER: Final = 121212  # of CBRK_FLIGHTTERM, PX4's number


def by_number(number: int) -> Action:
    """PX4's actions of GF_ACTION, COM_POS_LOW_ACT and their like; 6 is Pandion's own."""
    return {
        0: Action.NONE,
        2: Action.HOLD,
        3: Action.RETURN,
        4: Action.TERMINATE,
        5: Action.LAND,
        6: Action.RETREAT,
    }.get(number, Action.WARN)


def on_setpoints_lost(context: FailsafeContext) -> Action:
    """COM_OBL_RC_ACT; the mode cannot continue."""
    known = {3: Action.RETURN, 4: Action.LAND, 5: Action.HOLD, 6: Action.TERMINATE}
    return known.get(context.limits.setpoint_loss_action, Action.HOLD)


# Bits of COM_DLL_EXCEPT, PX4's; that of external modes is the one of its COM_RCL_EXCEPT.
_EXCEPTIONS: Final = {
    Mode.MISSION: 1,
    Mode.HOLD: 2,
    Mode.TAKEOFF: 2,
    Mode.OFFBOARD: 4,
    Mode.TRAJECTORY: 8,
}


def on_datalink_lost(context: FailsafeContext) -> Action:
    """NAV_DLL_ACT, but for the modes of COM_DLL_EXCEPT."""
    vehicle, limits = context.state.vehicle, context.limits
    flown = vehicle.failsafe_from or vehicle.mode  # the hold of a failsafe is no hold of a pilot's
    excepted = _EXCEPTIONS.get(flown, 0) & limits.station_loss_exceptions
    if not vehicle.flies or excepted:
        return Action.NONE
    known = {1: Action.HOLD, 2: Action.RETURN, 3: Action.LAND, 5: Action.TERMINATE}
    return known.get(limits.station_loss_action, Action.WARN)


def on_battery(context: FailsafeContext) -> Action:
    """COM_LOW_BAT_ACT: 0 warn, 2 land when critical, 3 return then and land in an emergency."""
    return {
        (2, BatteryWarning.CRITICAL): Action.LAND,
        (2, BatteryWarning.EMERGENCY): Action.LAND,
        (3, BatteryWarning.CRITICAL): Action.RETURN,
        (3, BatteryWarning.EMERGENCY): Action.LAND,
    }.get((context.limits.low_battery_action, context.state.battery.charge), Action.WARN)


def on_breach(context: FailsafeContext, number: int) -> Action:
    """The action where the controller has barriers that promise not to get there."""
    config = context.config
    if config.controller != "blf" or config.soft:
        return Action.WARN
    return by_number(number)


def on_lack_of_room(context: FailsafeContext) -> Action:
    """Descend where no position is measured: what is lacking only grows."""
    off = position_is_off(context, context.limits.position_low)
    return Action.DESCEND if off else Action.WARN


def on_far_outside(context: FailsafeContext) -> Action:
    """Land, where a breach is to be acted on at all."""
    acted_on = on_breach(context, context.limits.breach_action).mode is not None
    return Action.LAND if acted_on else Action.WARN


def on_tilt_lost(context: FailsafeContext) -> Action:
    """Terminate, unless CBRK_FLIGHTTERM is set."""
    broken = context.limits.termination_breaker == BREAKER
    return Action.WARN if broken else Action.TERMINATE


def on_rotor_lost(context: FailsafeContext) -> Action:
    """Terminate, or land where CBRK_FLIGHTTERM is set; what others fly without is a failed one."""
    if context.state.damage.spared:
        return on_rotor_failed(context)
    broken = context.limits.termination_breaker == BREAKER
    return Action.LAND if broken else Action.TERMINATE


def on_rotor_failed(context: FailsafeContext) -> Action:
    """COM_ACT_FAIL_ACT, and land at least where the heading cannot be held."""
    action = on_actuator_failure(context)
    if action is Action.WARN or not context.state.damage.severe:
        return action
    return action if action.strength > Action.LAND.strength else Action.LAND


def on_actuator_failure(context: FailsafeContext) -> Action:
    """COM_ACT_FAIL_ACT, PX4's numbers."""
    known = {1: Action.HOLD, 2: Action.LAND, 3: Action.RETURN, 4: Action.TERMINATE}
    return known.get(context.limits.actuator_failure_action, Action.WARN)
