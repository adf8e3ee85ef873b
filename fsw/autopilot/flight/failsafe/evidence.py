"""When a condition of the failsafe table is active, where a row does not say it in a line."""

from __future__ import annotations

import math
from typing import Final

from fsw.autopilot.estimation.faults.sensor_fault import SensorFault
from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.flight.safety.uncertain_clearance import SHORTFALL
from fsw.autopilot.flight.situation import Situation
from fsw.autopilot.flight.state import LostSensor
from fsw.autopilot.measurements import Sensor
from fsw.autopilot.periods import TICK_US
from fsw.autopilot.signals import Mode

PLAN_STALE_PERIODS: Final = 3
INVALID_TICKS: Final = 10_000 // TICK_US  # without an estimate
# A filter that starts anew has poses that agree long before.
BLIND_TICKS: Final = 250_000 // TICK_US
# Of a second's, that are too many. A gap of 50 ms, in which the rotors hold their last
# command, is 25 of 2 ms, of which at least 12 are in the same second.
MISSED_TICKS: Final = 10
JUMP_SHOWN_US: Final = 1_000_000  # for which a jump of time is a condition
FALLING_US: Final = 1_000_000  # in which what rotors do not carry falls plainly, or stands
JUMP_US: Final = 500_000  # of the wall clock in a second, that is no slewing
CONTACT_LOST_S: Final = 1.0  # without contact while it is asked for
SURFACE_OFF: Final = 0.06  # m, from where it was announced
SLIP: Final = 0.3  # m/s along the surface, beside the plan
WEIGHED: Final = 1.05  # what a payload is weighed within
_HALF_LOST_US: Final = 1_000_000  # in which a half that has jumped may be believed again
_LACKING_US: Final = 500_000  # without room enough; hidden markers, 0.2 s, are none


def plan_age_us(context: Situation) -> int:
    """Since the running plan began, or the vehicle was taken over."""
    return context.estimate.t_us - context.state.plan.since_us


def plans(context: Situation) -> bool:
    """Whether in flight a plan is flown, or should be."""
    vehicle = context.state.vehicle
    return vehicle.unloaded is None and vehicle.mode is not Mode.DESCEND


def plan_is_stale(context: Situation) -> bool:
    """The running plan (or taking over) began more than three periods ago."""
    stale_us = PLAN_STALE_PERIODS * context.config.planner.period_us
    return plan_age_us(context) > stale_us and plans(context)


def planner_is_lost(context: Situation) -> bool:
    """No plan has begun for COM_PLN_LOSS_T."""
    unloaded = context.state.vehicle.unloaded is not None
    return not unloaded and plan_age_us(context) > context.limits.planner_loss_us


def setpoints_are_lost(context: Situation) -> bool:
    """In Offboard, or while its failsafe lasts, no setpoint for COM_OF_LOSS_T."""
    vehicle = context.state.vehicle
    if Mode.OFFBOARD is not vehicle.mode and (
        Mode.OFFBOARD is not vehicle.failsafe_from
        or Condition.SETPOINTS_LOST not in vehicle.conditions
    ):
        return False
    timeout_us = context.limits.setpoint_timeout_us
    return not context.state.offboard.is_fresh(context.estimate.t_us, timeout_us)


def station_silent_us(context: Situation) -> int:
    """Time since a ground station was heard."""
    return context.estimate.t_us - context.state.vehicle.gcs_heard_us


def datalink_is_lost(context: Situation) -> bool:
    """There was a ground station, and it has been silent for COM_DL_LOSS_T."""
    if context.state.vehicle.gcs_heard_us < 0:
        return False  # there never was one
    return station_silent_us(context) >= context.limits.station_timeout_us


def lacks_room(context: Situation) -> bool:
    """For half a second walls have left less than clearances should grow by."""
    kept = context.state.kept
    lasts = context.estimate.t_us - kept.sufficient_us >= _LACKING_US
    return kept.shortfall > SHORTFALL and lasts


def force_on_tool(context: Situation) -> float:
    """The normal force [N], as it is observed or by how fast the tool met its surface."""
    k = context.state.record.pressing
    return float(max(k.pressed, k.blow))


def presses_too_hard(context: Situation) -> bool:
    """The tool may be pressed upon by more than its surface allows."""
    k = context.state.record.pressing
    return bool(k.near and force_on_tool(context) + k.unsure > k.most)


def surface_has_moved(context: Situation) -> bool:
    """The tool meets its surface far from where it was announced."""
    pressing = context.state.record.pressing
    return bool(pressing.near and abs(pressing.moved) > SURFACE_OFF)


def tool_slips(context: Situation) -> bool:
    """The tool moves along its surface faster than any reference leads it."""
    pressing = context.state.record.pressing
    return bool(pressing.contact) and math.hypot(*pressing.slip.tolist()) > SLIP


def is_unaided(context: Situation) -> bool:
    """No position could be used for COM_AID_LOSS_T."""
    return context.state.aiding.unaided_us >= context.limits.aiding_loss_us


def is_blind(context: Situation) -> bool:
    """Nothing is known but what was known: sensors say what is not a number, for example."""
    return context.state.invalid_ticks >= BLIND_TICKS


def attitude_is_lost(context: Situation) -> bool:
    """Roll or pitch is uncertain by more than COM_ATT_LOSS, or nothing is known."""
    known = context.state.aiding.attitude_sigma <= context.limits.attitude_loss
    return not known or is_blind(context)


def position_is_off(context: Situation, most: float) -> bool:
    """Positions are missing, and the estimate has drifted by more than ``most`` [m] perhaps."""
    return is_unaided(context) and not context.state.aiding.position_sigma <= most


def position_is_disputed(context: Situation) -> bool:
    """The estimate is off by COM_POS_LOW_EPH, or positions say so: refused, or by their jumps."""
    aiding, most = context.state.aiding, context.limits.position_low
    if math.hypot(*aiding.unproven) > most:
        return True
    return is_unaided(context) and not max(aiding.position_sigma, aiding.elsewhere) <= most


def lost_sensors(context: Situation) -> tuple[LostSensor, ...]:
    """Those that have been of no use for COM_SENS_LOSS_T, but for those that give the position."""
    since_us = context.estimate.t_us - context.limits.sensor_loss_us
    return tuple([one for one in context.state.aiding.lost if one.since_us <= since_us])


def inertial_is_lost(context: Situation) -> bool:
    """The inertial unit was of no use for a while, and no pose holds the attitude.

    Satellites and rotors hold it for longer where only one half of the unit is lost.
    """
    aiding, now_us = context.state.aiding, context.estimate.t_us
    if aiding.holds_attitude(context.limits.aiding_loss_us):
        return False
    return any(
        one.sensor is Sensor.IMU
        and now_us - one.since_us > (0 if one.fault is SensorFault.STALE else _HALF_LOST_US)
        for one in lost_sensors(context)
    )


def stands_on_ground(context: Situation) -> bool:
    """In flight, rotors have carried for a second too little to fly: the ground does the rest.

    Where a descent is commanded the land detector finds it first, and loops are open by then.
    """
    since_us = context.state.safety.light_us
    return since_us >= 0 and context.estimate.t_us - since_us >= FALLING_US


def tilt_is_lost(context: Situation) -> bool:
    """Roll or pitch has been above FD_FAIL_R or FD_FAIL_P for the time of each, PX4's."""
    safety = context.state.safety
    if safety.rolled_us < 0 and safety.pitched_us < 0:
        return False
    limits, now_us = context.limits, context.estimate.t_us
    over = 0 <= safety.rolled_us <= now_us - limits.roll_failure_us
    return over or 0 <= safety.pitched_us <= now_us - limits.pitch_failure_us


def way_home_s(context: Situation) -> float:
    """Time to return and land from here [s], with RTL_TIME_FACTOR and RTL_TIME_MARGIN."""
    home, limits = context.state.vehicle.home, context.limits
    if home is None:
        return 0.0
    (x, y, z), (hx, hy, hz) = context.estimate.p_WB, home.p
    cruise = context.config.steering.cruise_speed
    top = min(z, hz - limits.return_height)
    wait = max(limits.return_wait, 0.0)
    seconds = (math.hypot(x - hx, y - hy) + z - top) / cruise + wait
    seconds += max(hz - top, 0.0) / limits.land_speed
    return limits.return_time_factor * seconds + limits.return_time_margin
