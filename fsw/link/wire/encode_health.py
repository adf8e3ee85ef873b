"""Health, battery and estimator as standard MAVLink messages; pure, in wire order."""

from __future__ import annotations

import math
from typing import Final

from fsw.autopilot.estimation.faults.sensor_fault import SensorFault, fault_name
from fsw.autopilot.estimation.sensors import SENSORS
from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.measurements import Sensor
from fsw.autopilot.signals import (
    BatteryState,
    BatteryWarning,
    EstimatorReport,
    FlightSnapshot,
    SensorReport,
)
from fsw.link.wire.outgoing import TelemetryContext, WireValues

# MAV_SYS_STATUS_SENSOR bits of what every vehicle has. The bits of the magnetometer and of the
# receiver say whether heading and position are known, which is what clients ask them for; where
# there are such sensors, also whether those are well.
_GYRO, _ACCELEROMETER, _HEADING, _PLACE, _EXTERNAL_POSE = 0x1, 0x2, 0x4, 0x20, 0x80
_RATE_CONTROL, _ATTITUDE, _YAW, _HEIGHT, _POSITION = 0x400, 0x800, 0x1000, 0x2000, 0x4000
_MOTORS, _FENCE, _AHRS, _BATTERY, _PREARM = 0x8000, 0x100000, 0x200000, 0x2000000, 0x10000000
_LOGGING: Final = 0x1000000
_SENSING: Final = _GYRO | _ACCELEROMETER | _HEADING | _PLACE | _AHRS
_CONTROL: Final = _RATE_CONTROL | _ATTITUDE | _YAW | _HEIGHT | _POSITION
_PRESENT: Final = _SENSING | _CONTROL | _MOTORS | _FENCE | _BATTERY | _LOGGING | _PREARM
# Which subsystem an operator should look at; any fault also forbids arming.
_SUSPECT: Final[dict[str, int]] = {
    Condition.PLAN_REFUSED.value: 0,
    Condition.PLAN_STALE.value: _POSITION | _HEIGHT,
    Condition.OUTPUT_NOT_FINITE.value: _MOTORS,
    Condition.ESTIMATE_INVALID.value: _SENSING | _EXTERNAL_POSE,
    Condition.ATTITUDE_LOST.value: _ATTITUDE | _RATE_CONTROL | _AHRS,
    Condition.POSITION_LOST.value: _PLACE | _EXTERNAL_POSE | _POSITION | _HEIGHT,
    Condition.POSITION_LOW.value: _PLACE | _EXTERNAL_POSE,
    Condition.AIDING_LOST.value: _PLACE | _EXTERNAL_POSE,
    Condition.TILT_LOST.value: _ATTITUDE | _RATE_CONTROL,
    Condition.PLANNER_LOST.value: _POSITION | _HEIGHT,
    Condition.FENCE_BREACH.value: _FENCE,
    Condition.ROTOR_LOST.value: _MOTORS,
    Condition.ROTOR_FAILED.value: _MOTORS,
    Condition.JOINT_FAILED.value: _MOTORS,
}
# The same of each sensor that is lost. MAVLink has no bit for encoders: what cannot work without
# them are the drives of the joints.
_LOST: Final[dict[str, int]] = {
    Sensor.IMU.value: _GYRO | _ACCELEROMETER,
    Sensor.ENCODERS.value: _MOTORS,
}
# Those that are there if they are heard.
_HEARD: Final = {kind.sensor.value: kind.status_bit for kind in SENSORS}
# Faults with which a sensor is in use.
_IN_USE: Final = frozenset(
    ("", fault_name(SensorFault.REPEATED), fault_name(SensorFault.RATE_TOO_LOW))
)
_JUMP: Final = fault_name(SensorFault.JUMP)
# MAV_BATTERY_CHARGE_STATE: 0 is undefined, OK is 1.
_CHARGE_STATES: Final = {charge: int(charge) + 1 for charge in BatteryWarning}
_LIPO, _FOR_EVERYTHING = 1, 1  # MAV_BATTERY_TYPE, MAV_BATTERY_FUNCTION
_U16, _U32 = 0xFFFF, 0xFFFFFFFF
_UNKNOWN_CELL: Final = 0xFFFF
_UNKNOWN_TEMPERATURE: Final = 0x7FFF
_UNKNOWN_ENERGY: Final = -1
# ESTIMATOR_STATUS_FLAGS: attitude, both velocities, position relative and absolute, height.
_ESTIMATED: Final = 1 | 2 | 4 | 8 | 16 | 32


def sys_status(snapshot: FlightSnapshot, context: TelemetryContext) -> WireValues:
    """SYS_STATUS: load of the loop, health by subsystem, battery, what was dropped.

    Of the autopilot's own errors 1 are echoes of the vehicle's frames, 2 frames that the signature
    refused, 3 frames of kinds that are of no use here, 4 datagrams that the kernel dropped.
    """
    lost = context.health.losses
    battery = snapshot.battery
    millivolts, centiamperes, percent = _shown(battery)
    sensing, ill = _sensors(snapshot.estimator)
    present = _PRESENT | sensing
    health = present & ~ill
    for failure in snapshot.failures:
        health &= ~(_SUSPECT.get(failure, 0) | _PREARM)
    if Condition.SENSOR_LOST.value in snapshot.failures:
        for sensor in snapshot.sensors_lost:
            health &= ~_LOST.get(sensor, 0)
    if snapshot.arming.failed:
        health &= ~_PREARM
    if battery.charge >= BatteryWarning.CRITICAL:
        health &= ~_BATTERY
    if snapshot.log_failure:
        health &= ~_LOGGING
    margins = snapshot.constraints.margins
    if margins and not min(margins) >= 0.0:
        health &= ~_FENCE
    enabled = present if snapshot.armed else present & ~(_CONTROL | _MOTORS)
    if not margins:
        enabled &= ~_FENCE
    load = round(1000 * min(context.health.inner.load + context.health.mpc.load, 1.0))
    return (
        present,
        enabled,
        health,
        load,
        millivolts,
        centiamperes,
        0,
        min(lost.damaged, _U16),
        *(min(n, _U16) for n in (lost.echoes, lost.refused, lost.unhandled, lost.overflowed)),
        percent,
        *(0, 0, 0),
    )


def _sensors(known: EstimatorReport | None) -> tuple[int, int]:
    """Bits of the sensors that are there, beside those of all, and of those that are not well."""
    if known is None:  # exact states
        return _EXTERNAL_POSE, 0
    there, ill = 0, 0
    for one in known.sensors:
        bit = _HEARD.get(one.name, 0)
        there |= bit
        ill |= 0 if _is_well(one) else bit
    return there, ill


def _is_well(one: SensorReport) -> bool:
    """Whether a sensor is in use; one outlier that was refused does not make it ill for long."""
    if one.fault == _JUMP:
        return max(one.ratio, default=0.0) <= 1.0
    return one.fault in _IN_USE


def battery_status(snapshot: FlightSnapshot, _: TelemetryContext) -> WireValues:
    """BATTERY_STATUS: one pack without voltages of its cells."""
    battery = snapshot.battery
    millivolts, centiamperes, percent = _shown(battery)
    return (
        round(1000.0 * battery.consumed),
        _UNKNOWN_ENERGY,
        _UNKNOWN_TEMPERATURE,
        millivolts,
        *(_UNKNOWN_CELL,) * 9,
        centiamperes,
        0,
        _FOR_EVERYTHING,
        _LIPO,
        percent,
        round(battery.time_left) if battery.time_left < 1e6 else 0,  # not known
        _CHARGE_STATES[battery.charge],
        *(0, 0, 0, 0),
        0,
        0,
    )


def estimator_status(snapshot: FlightSnapshot, _: TelemetryContext) -> WireValues:
    """ESTIMATOR_STATUS: test ratios of the last readings, accuracy, and what is known.

    With exact states there is no filter, hence no innovation to report.
    """
    known = snapshot.estimator
    if known is None:
        invalid = Condition.ESTIMATE_INVALID.value in snapshot.failures
        return (snapshot.t_us, *(math.nan,) * 8, 0 if invalid else _ESTIMATED)
    ratios = known.ratios
    return (
        known.t_us,
        ratios.velocity,
        ratios.place,
        ratios.height,
        ratios.heading,
        ratios.above_ground,
        math.nan,
        known.level_accuracy,
        known.vertical_accuracy,
        known.flags,
    )


def vibration(snapshot: FlightSnapshot, context: TelemetryContext) -> WireValues:
    """VIBRATION as PX4 fills it: high-frequency gyro and accelerometer, clipping of all axes.

    There is one accelerometer.
    """
    gyro, accel = context.health.vibration
    return (snapshot.t_us, 0.0, gyro, accel, context.health.clipped & _U32, 0, 0)


def _shown(battery: BatteryState) -> tuple[int, int, int]:
    """Millivolts, hundredths of an ampere, and percent that are left."""
    return (
        round(1000.0 * battery.voltage),
        round(100.0 * battery.current),
        round(100.0 * battery.remaining),
    )
