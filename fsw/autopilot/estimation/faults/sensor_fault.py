"""Sensors, and what can be wrong with what they say, as an operator reads it."""

from __future__ import annotations

from enum import Enum, IntEnum


class Sensor(Enum):
    """A source of measurements."""

    IMU = "IMU"
    POSE = "pose"
    GNSS = "GNSS"
    BAROMETER = "barometer"
    MAGNETOMETER = "magnetometer"
    RANGEFINDER = "rangefinder"
    ENCODERS = "joint encoders"


class SensorFault(IntEnum):
    """Why a reading was not used."""

    NONE = 0
    NOT_FINITE = 1
    IMPLAUSIBLE = 2
    FUTURE = 3
    REPEATED = 4
    TOO_OLD = 5
    STUCK = 6
    JUMP = 7
    STALE = 8
    RATE_TOO_LOW = 9
    DISAGREES = 10
    NO_FIX = 11
    NOISY = 12


_SENTENCES = {
    SensorFault.NONE: "is in use",
    SensorFault.NOT_FINITE: "says what is not a number",
    SensorFault.IMPLAUSIBLE: "says what cannot be",
    SensorFault.FUTURE: "has a time stamp in the future",
    SensorFault.REPEATED: "has a time stamp that does not move on",
    SensorFault.TOO_OLD: "comes too late to be of use",
    SensorFault.STUCK: "is stuck at one reading",
    SensorFault.JUMP: "jumps, and is not believed",
    SensorFault.STALE: "is silent",
    SensorFault.RATE_TOO_LOW: "comes less often than it did",
    SensorFault.DISAGREES: "does not agree with the other sensors",
    SensorFault.NO_FIX: "has no fix",
    SensorFault.NOISY: "is noisier than stated",
}


def fault_name(fault: SensorFault) -> str:
    """What telemetry and log call a fault; empty for none."""
    return "" if fault is SensorFault.NONE else fault.name.lower().replace("_", " ")


def sentence(sensor: Sensor, fault: SensorFault) -> str:
    """What the operator reads."""
    told = _SENTENCES[fault]
    if sensor is Sensor.ENCODERS:  # there are several
        told = told.replace("is ", "are ", 1).replace("says ", "say ", 1).replace("jumps", "jump")
        told = told.replace("comes ", "come ", 1).replace("does ", "do ", 1)
    return f"{sensor.value} {told}"
