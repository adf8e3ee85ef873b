"""Which component of the vehicle is ill while a condition lasts, for the health that is reported.

On the ground the arming checks say it. They are about arming, and an armed vehicle has none.
"""

from __future__ import annotations

from typing import Final

from fsw.autopilot.flight.commands.arming import Subject
from fsw.autopilot.flight.failsafe.conditions import Condition

AILMENTS: Final[dict[Condition, Subject]] = {
    Condition.ATTITUDE_LOST: Subject.ATTITUDE,
    Condition.TILT_LOST: Subject.ATTITUDE,
    Condition.POSITION_LOST: Subject.ESTIMATOR,
    Condition.POSITION_LOW: Subject.ESTIMATOR,
    Condition.AIDING_LOST: Subject.ESTIMATOR,
    Condition.ESTIMATE_INVALID: Subject.ESTIMATOR,
    Condition.SENSOR_LOST: Subject.SENSORS,
    Condition.INERTIAL_LOST: Subject.SENSORS,
    Condition.SENSORS_UNDECIDED: Subject.SENSORS,
    Condition.SENSORS_CONTRADICT: Subject.SENSORS,
    Condition.ROTOR_LOST: Subject.ACTUATORS,
    Condition.ROTOR_FAILED: Subject.ACTUATORS,
    Condition.JOINT_FAILED: Subject.ACTUATORS,
    Condition.OUTPUT_NOT_FINITE: Subject.ACTUATORS,
    Condition.LOG_STOPPED: Subject.STORAGE,
    Condition.DISK_FULL: Subject.STORAGE,
    Condition.BATTERY_LOW: Subject.BATTERY,
    Condition.BATTERY_CRITICAL: Subject.BATTERY,
    Condition.BATTERY_EMERGENCY: Subject.BATTERY,
}


def ailments(conditions: tuple[Condition, ...]) -> tuple[str, ...]:
    """Those of the active conditions that make a component ill, by name."""
    return tuple([condition.value for condition in conditions if condition in AILMENTS])
