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


_WORDS = {
    SensorFault.NONE: "in use",
    SensorFault.NOT_FINITE: "not finite",
    SensorFault.IMPLAUSIBLE: "implausible",
    SensorFault.FUTURE: "time stamp in the future",
    SensorFault.REPEATED: "time stamp repeated",
    SensorFault.TOO_OLD: "too late",
    SensorFault.STUCK: "stuck",
    SensorFault.JUMP: "jump rejected",
    SensorFault.STALE: "silent",
    SensorFault.RATE_TOO_LOW: "rate too low",
    SensorFault.DISAGREES: "inconsistent with the other sensors",
    SensorFault.NO_FIX: "no fix",
    SensorFault.NOISY: "noisier than stated",
}


def fault_name(fault: SensorFault) -> str:
    """What telemetry and log call a fault; empty for none."""
    return "" if fault is SensorFault.NONE else fault.name.lower().replace("_", " ")


def sentence(sensor: Sensor, fault: SensorFault) -> str:
    """What the operator reads."""
    return f"{sensor.value} {_WORDS[fault]}"
