"""From the wire values of measurements to samples; pure.

A reading that is not a number is handed on: the estimator names the sensor that says it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Final, cast

from fsw.autopilot.measurements import (
    GnssSample,
    ImuSample,
    JointSample,
    MagneticSample,
    PoseSample,
    PressureSample,
    RangeSample,
    Sample,
    Vec3,
    Vec4,
)
from fsw.autopilot.signals import BatteryReading
from fsw.link.wire.decode import Numbers
from fsw.link.wire.mission_items import Locate
from messages import message_ids
from messages.frames import Frame
from messages.joint_arrays import ENCODERS_AT, ENCODERS_COUNT_AT, joined

# HIL_SENSOR_UPDATED_FLAGS
_INERTIAL: Final = 0x3F
_MAGNETIC: Final = 0x1C0
_PRESSURE: Final = 0x200
_RESET: Final = 0x80000000

_LOCAL_NED: Final = 1  # MAV_FRAME
_DRIFTING: Final = (2, 3, 7)  # MAV_ESTIMATOR_TYPE: vision, visual-inertial, lidar
_DOWNWARD: Final = 25  # MAV_SENSOR_ORIENTATION
_UNKNOWN_EPH: Final = 0xFFFF
_UNKNOWN_VOLTAGE: Final = 0xFFFF
_VOLTAGE_AT, _REMAINING_AT = 3, 17  # of BATTERY_STATUS: voltages[0] is the pack's
_FIX_AT, _SATELLITES_AT = 11, 12  # of HIL_GPS
_NOT_STATED: Final = 0.0  # a variance that the message has no field for
_SEA_LEVEL_HPA: Final = 1013.25
_SEA_LEVEL_K: Final = 288.15
_LAPSE_K_M: Final = 0.0065
_EXPONENT: Final = 0.190263  # of the troposphere


class SampleDecoder:
    """Reads what a vehicle with one origin measures."""

    def __init__(self, locate: Locate, joints: int) -> None:
        """Of a vehicle with so many ``joints``."""
        self._locate, self._count = locate, joints
        self._origin_altitude = locate(0.0, 0.0, 0.0)[2]  # m: the sea is so far below
        self._readers: dict[int, Callable[[Numbers], Sample | None]] = {
            message_ids.ODOMETRY: pose_sample,
            message_ids.HIL_GPS: self._gnss,
            message_ids.DISTANCE_SENSOR: range_sample,
            message_ids.JOINT_ENCODERS: self._joints,
        }

    def samples(self, frames: Iterable[Frame]) -> list[Sample]:
        """What is measured in some frames, in their order."""
        found: list[Sample] = []
        for frame in frames:
            values = cast(Numbers, frame.payload_values)
            if frame.message_id == message_ids.HIL_SENSOR:
                found += self._hil_sensor(values)
                continue
            reader = self._readers.get(frame.message_id)
            one = None if reader is None else reader(values)
            if one is not None:
                found.append(one)
        return found

    def _joints(self, values: Numbers) -> JointSample | None:
        """JOINT_ENCODERS of this arm; those of one of more or fewer joints say nothing of it."""
        if values[ENCODERS_COUNT_AT] != self._count:
            return None
        return JointSample(1e-6 * values[0], joined(values, *ENCODERS_AT, self._count))

    def _hil_sensor(self, values: Numbers) -> list[Sample]:
        """Those of the sensors in a HIL_SENSOR that have something new."""
        time, updated = 1e-6 * values[0], int(values[14])
        found: list[Sample] = []
        if updated & _RESET:
            return found
        if updated & _INERTIAL == _INERTIAL:
            found.append(ImuSample(time, cast(Vec3, values[1:4]), cast(Vec3, values[4:7])))
        if updated & _MAGNETIC == _MAGNETIC:
            found.append(MagneticSample(time, cast(Vec3, values[7:10])))
        if updated & _PRESSURE:
            altitude = pressure_altitude(values[10]) - self._origin_altitude
            found.append(PressureSample(time, altitude, _NOT_STATED))
        return found

    def _gnss(self, values: Numbers) -> GnssSample:
        """HIL_GPS, with a fix or without."""
        time_us, latitude, longitude, altitude, eph, epv, _, north, east, down = values[:10]
        level = _stated(eph)
        return GnssSample(
            1e-6 * time_us,
            self._locate(1e-7 * latitude, 1e-7 * longitude, 1e-3 * altitude),
            (0.01 * north, 0.01 * east, 0.01 * down),
            (level, level, _stated(epv)),
            (_NOT_STATED, _NOT_STATED, _NOT_STATED),
            int(values[_FIX_AT]),
            int(values[_SATELLITES_AT]),
        )


def battery_reading(values: Numbers) -> BatteryReading | None:
    """Voltage and charge of a BATTERY_STATUS; None if it does not know them."""
    millivolts, percent = values[_VOLTAGE_AT], values[_REMAINING_AT]
    if millivolts == _UNKNOWN_VOLTAGE or not 0 <= percent <= 100:
        return None
    return BatteryReading(1e-3 * millivolts, 1e-2 * percent)


def pose_sample(values: Numbers) -> PoseSample | None:
    """ODOMETRY of motion capture or visual odometry; None in another frame than local NED."""
    if values[56] != _LOCAL_NED:
        return None
    covariance = values[14:35]  # upper triangle of (6, 6), row by row
    return PoseSample(
        1e-6 * values[0],
        cast(Vec3, values[1:4]),
        cast(Vec4, values[4:8]),
        (covariance[0], covariance[6], covariance[11]),
        (covariance[15], covariance[18], covariance[20]),
        int(values[58]),
        drifts=values[59] in _DRIFTING,
    )


def range_sample(values: Numbers) -> RangeSample | None:
    """DISTANCE_SENSOR; None out of range or in another direction than down."""
    time_ms, least, most, distance, _, _, orientation, variance = values[:8]
    if orientation != _DOWNWARD or not least <= distance <= most:
        return None
    return RangeSample(1e-3 * time_ms, 0.01 * distance, 1e-4 * variance)


def pressure_altitude(pressure: float) -> float:
    """Altitude [m] in the standard atmosphere of a ``pressure`` [hPa], to 11 km.

    Source: ISO 2533:1975, Standard Atmosphere.
    """
    if not pressure > 0.0:
        return math.nan
    ratio = pressure / _SEA_LEVEL_HPA
    return float(_SEA_LEVEL_K / _LAPSE_K_M * (1.0 - ratio**_EXPONENT))


def _stated(deviation: float) -> float:
    """The variance [m^2] of a deviation [cm]; not a number where none is stated."""
    return math.nan if deviation == _UNKNOWN_EPH else (0.01 * deviation) ** 2
