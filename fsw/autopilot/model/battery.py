r"""What the battery must be like by now: a model, which a sensor corrects where there is one.

A rotor that hovers needs the induced power of actuator-disc theory over its figure of merit,

.. math:: P = \frac{1}{\eta} \sqrt{\frac{f^3}{2 \rho A}}

and the voltage is a straight line over the charge, less the drop at the inner resistance.
"""

from __future__ import annotations

import math
from dataclasses import replace

from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.signals import BatteryReading, BatteryState, BatteryWarning, RotorVector
from vehicles.description import Battery

_AIR_DENSITY = 1.225  # kg/m^3
_AS_PER_AH = 3600.0
# s, in which the current of late forgets: a climb of some seconds is not how it goes on.
_USUAL_TIME = 30.0
# Readings are whole per cent. As they are they would undo what the model knows to be used since,
# and a level would come and go.
_ROUNDING = 0.005
_ROSE = 0.02  # above a level's limit, where it is over: another battery, or a model that was wrong

Levels = tuple[float, float, float]
"""Shares of the capacity below which the charge is low, critical, and an emergency."""


def charge_of(remaining: float, levels: Levels) -> BatteryWarning:
    """Charge level at a ``remaining`` share [1] of the capacity; NaN is an emergency."""
    if remaining >= levels[0]:
        return BatteryWarning.OK
    if remaining >= levels[1]:
        return BatteryWarning.LOW
    return BatteryWarning.CRITICAL if remaining >= levels[2] else BatteryWarning.EMERGENCY


def _level(before: BatteryWarning, remaining: float, levels: Levels) -> BatteryWarning:
    """The level after ``before``: the next one at once, the last one with some charge to spare."""
    now = charge_of(remaining, levels)
    return now if now >= before else min(before, charge_of(remaining - _ROSE, levels))


def drained(
    airframe: Airframe, levels: Levels, state: BatteryState, thrust: RotorVector, dt: float
) -> BatteryState:
    """The battery after ``dt`` [s] of ``thrust`` [N] of each rotor."""
    model = airframe.battery
    power = model.idle_power
    for f, radius in zip(thrust, airframe.rotor_radius, strict=False):
        disc = math.pi * radius * radius
        power += f * math.sqrt(max(f, 0.0) / (2.0 * _AIR_DENSITY * disc)) / model.efficiency
    current = power / max(state.voltage, 1.0)
    share = min(dt / _USUAL_TIME, 1.0)
    usual = state.usual_current or current
    usual += share * (current - usual)
    consumed = state.consumed + current * dt / _AS_PER_AH
    remaining = max(1.0 - consumed / model.capacity, 0.0)
    return BatteryState(
        voltage=_voltage(model, remaining, current) + state.voltage_error,
        current=current,
        consumed=consumed,
        remaining=remaining,
        charge=_level(state.charge, remaining, levels),
        usual_current=usual,
        time_left=_AS_PER_AH * remaining * model.capacity / max(usual, 1e-3),
        voltage_error=state.voltage_error,
    )


def corrected(
    model: Battery, levels: Levels, state: BatteryState, reading: BatteryReading
) -> BatteryState:
    """The battery as it has been measured; the model goes on from there.

    Of all that is rounded to the reading, what is nearest to the model.
    """
    low, high = reading.remaining - _ROUNDING, reading.remaining + _ROUNDING
    remaining = max(low, min(state.remaining, high, 1.0), 0.0)
    return replace(
        state,
        voltage=reading.voltage,
        consumed=(1.0 - remaining) * model.capacity,
        remaining=remaining,
        charge=_level(state.charge, remaining, levels),
        voltage_error=reading.voltage - _voltage(model, remaining, state.current),
    )


def _voltage(model: Battery, remaining: float, current: float) -> float:
    """Voltage [V] at a ``remaining`` share [1] and a ``current`` [A]."""
    at_rest = model.empty + (model.full - model.empty) * remaining
    return at_rest - model.resistance * current
