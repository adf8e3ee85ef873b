"""Numbers that the code writes out of MAVLink's enumerations, against the generated dialect."""

from __future__ import annotations

from dataclasses import replace
from functools import reduce
from operator import or_
from types import ModuleType
from typing import Any, Final

import pytest

from fsw.autopilot import measurements
from fsw.autopilot.flight.estimate import estimator_report
from fsw.autopilot.model import airframe
from fsw.link.wire import (
    decode,
    decode_commands,
    decode_sensors,
    decode_setpoints,
    encode_dialect,
    encode_health,
    encode_place,
    encode_standard,
    fence_items,
    identity,
    mission_items,
    outgoing,
)
from messages import dialect, message_ids
from sitl.link import decode as sitl_decode
from sitl.link import encode as sitl_encode
from sitl.link import encode_sensors, failures
from sitl.sensors import gnss as sitl_gnss

# What stands in a module, and of which entries it is made: one, several bits (a set joined by |),
# or one after the other.
_IMU: Final = "XACC|YACC|ZACC|XGYRO|YGYRO|ZGYRO"
_P, _V, _A = (
    "X_IGNORE|Y_IGNORE|Z_IGNORE",
    "VX_IGNORE|VY_IGNORE|VZ_IGNORE",
    "AX_IGNORE|AY_IGNORE|AZ_IGNORE",
)
_RATES: Final = "BODY_ROLL_RATE_IGNORE|BODY_PITCH_RATE_IGNORE|BODY_YAW_RATE_IGNORE"
_MASK, _ATTITUDE_MASK = "POSITION_TARGET_TYPEMASK", "ATTITUDE_TARGET_TYPEMASK"
_SENSORS, _HIL = "MAV_SYS_STATUS", "HIL_SENSOR_UPDATED"
TABLE: Final[list[tuple[ModuleType, str, str, str]]] = [
    (decode, "_LOCAL_NED", "MAV_FRAME", "LOCAL_NED"),
    (
        decode,
        "_LOCAL_FRAMES",
        "MAV_FRAME",
        "LOCAL_NED LOCAL_OFFSET_NED BODY_NED BODY_OFFSET_NED BODY_FRD",
    ),
    (decode, "_POSITION_IGNORED", _MASK, _P),
    (decode, "_VELOCITY_IGNORED", _MASK, _V),
    (decode, "_ACCELERATION_IGNORED", _MASK, _A),
    (decode, "_YAW_IGNORED", _MASK, "YAW_IGNORE"),
    (decode, "_KEEP_IN", "PANDION_SHAPE_FLAGS", "KEEP_IN"),
    (decode_commands, "_UNCHANGED", "ORBIT_YAW_BEHAVIOUR", "UNCHANGED"),
    (decode_commands, "_SPEED_TYPES", "SPEED_TYPE", "AIRSPEED GROUNDSPEED"),
    (decode_sensors, "_INERTIAL", _HIL, _IMU),
    (decode_sensors, "_MAGNETIC", _HIL, "XMAG|YMAG|ZMAG"),
    (decode_sensors, "_PRESSURE", _HIL, "ABS_PRESSURE"),
    (decode_sensors, "_RESET", _HIL, "RESET"),
    (decode_sensors, "_LOCAL_NED", "MAV_FRAME", "LOCAL_NED"),
    (decode_sensors, "_DRIFTING", "MAV_ESTIMATOR_TYPE", "VISION VIO LIDAR"),
    (decode_sensors, "_DOWNWARD", "MAV_SENSOR_ROTATION", "PITCH_270"),
    (measurements, "_LEVEL_FIX", "GPS_FIX_TYPE", "2D_FIX"),
    (decode_setpoints, "_LOCAL_NED", "MAV_FRAME", "LOCAL_NED"),
    (decode_setpoints, "_BODY_NED", "MAV_FRAME", "BODY_NED"),
    (decode_setpoints, "_LOCAL_OFFSET_NED", "MAV_FRAME", "LOCAL_OFFSET_NED"),
    (decode_setpoints, "_ALONG_HEADING", "MAV_FRAME", "BODY_NED BODY_OFFSET_NED BODY_FRD"),
    (decode_setpoints, "_TERRAIN", "MAV_FRAME", "GLOBAL_TERRAIN_ALT GLOBAL_TERRAIN_ALT_INT"),
    (decode_setpoints, "_GROUP", _MASK, _P),
    (decode_setpoints, "_HORIZONTAL", _MASK, "X_IGNORE|Y_IGNORE"),
    (decode_setpoints, "_ACCELERATION", _MASK, _A),
    (decode_setpoints, "_FORCE", _MASK, "FORCE_SET"),
    (decode_setpoints, "_YAW", _MASK, "YAW_IGNORE"),
    (decode_setpoints, "_YAW_RATE", _MASK, "YAW_RATE_IGNORE"),
    (decode_setpoints, "_RATES", _ATTITUDE_MASK, _RATES),
    (decode_setpoints, "_THRUST", _ATTITUDE_MASK, "THROTTLE_IGNORE"),
    (decode_setpoints, "_ATTITUDE", _ATTITUDE_MASK, "ATTITUDE_IGNORE"),
    (encode_dialect, "_LOCAL_NED", "MAV_FRAME", "LOCAL_NED"),
    (encode_health, "_GYRO", _SENSORS, "SENSOR_3D_GYRO"),
    (encode_health, "_ACCELEROMETER", _SENSORS, "SENSOR_3D_ACCEL"),
    (encode_health, "_HEADING", _SENSORS, "SENSOR_3D_MAG"),
    (encode_health, "_PLACE", _SENSORS, "SENSOR_GPS"),
    (encode_health, "_EXTERNAL_POSE", _SENSORS, "SENSOR_VISION_POSITION"),
    (encode_health, "_RATE_CONTROL", _SENSORS, "SENSOR_ANGULAR_RATE_CONTROL"),
    (encode_health, "_ATTITUDE", _SENSORS, "SENSOR_ATTITUDE_STABILIZATION"),
    (encode_health, "_YAW", _SENSORS, "SENSOR_YAW_POSITION"),
    (encode_health, "_HEIGHT", _SENSORS, "SENSOR_Z_ALTITUDE_CONTROL"),
    (encode_health, "_POSITION", _SENSORS, "SENSOR_XY_POSITION_CONTROL"),
    (encode_health, "_MOTORS", _SENSORS, "SENSOR_MOTOR_OUTPUTS"),
    (encode_health, "_FENCE", _SENSORS, "GEOFENCE"),
    (encode_health, "_AHRS", _SENSORS, "AHRS"),
    (encode_health, "_BATTERY", _SENSORS, "SENSOR_BATTERY"),
    (encode_health, "_PREARM", _SENSORS, "PREARM_CHECK"),
    (encode_health, "_LOGGING", _SENSORS, "LOGGING"),
    (encode_health, "_LIPO", "MAV_BATTERY_TYPE", "LIPO"),
    (encode_health, "_FOR_EVERYTHING", "MAV_BATTERY_FUNCTION", "ALL"),
    (
        encode_health,
        "_ESTIMATED",
        "ESTIMATOR",
        "ATTITUDE|VELOCITY_HORIZ|VELOCITY_VERT|POS_HORIZ_REL|POS_HORIZ_ABS|POS_VERT_ABS",
    ),
    (
        identity,
        "_CAPABILITIES",
        "MAV_PROTOCOL_CAPABILITY",
        "MISSION_FLOAT|PARAM_FLOAT|MISSION_INT|COMMAND_INT|PARAM_ENCODE_BYTEWISE|FTP|"
        "SET_ATTITUDE_TARGET|SET_POSITION_TARGET_LOCAL_NED|FLIGHT_TERMINATION|MAVLINK2|"
        "MISSION_FENCE|MISSION_RALLY",
    ),
    (identity, "_UNRELEASED", "FIRMWARE_VERSION_TYPE", "DEV"),
    (encode_place, "_LOCAL_NED", "MAV_FRAME", "LOCAL_NED"),
    (encode_place, "_BODY_FRD", "MAV_FRAME", "BODY_FRD"),
    (encode_place, "_MOCAP", "MAV_ESTIMATOR_TYPE", "MOCAP"),
    (encode_place, "_AUTOPILOT", "MAV_ESTIMATOR_TYPE", "AUTOPILOT"),
    (encode_standard, "_LOCKSTEP", "HIL_ACTUATOR_CONTROLS_FLAGS", "LOCKSTEP"),
    (airframe, "_MULTIROTOR", "MAV_TYPE", "GENERIC_MULTIROTOR"),
    (encode_standard, "_ARMED", "MAV_MODE_FLAG", "SAFETY_ARMED"),
    (encode_standard, "_CUSTOM_MODE", "MAV_MODE_FLAG", "CUSTOM_MODE_ENABLED"),
    (encode_standard, "_AUTO", "MAV_MODE_FLAG", "AUTO_ENABLED"),
    (encode_standard, "_GUIDED", "MAV_MODE_FLAG", "GUIDED_ENABLED"),
    (encode_standard, "_STABILISED", "MAV_MODE_FLAG", "STABILIZE_ENABLED"),
    (encode_standard, "_UNINIT", "MAV_STATE", "UNINIT"),
    (encode_standard, "_STANDBY", "MAV_STATE", "STANDBY"),
    (encode_standard, "_ACTIVE", "MAV_STATE", "ACTIVE"),
    (encode_standard, "_CRITICAL", "MAV_STATE", "CRITICAL"),
    (encode_standard, "_TERMINATED", "MAV_STATE", "FLIGHT_TERMINATION"),
    (encode_standard, "_LOCAL_NED", "MAV_FRAME", "LOCAL_NED"),
    (encode_standard, "_GLOBAL", "MAV_FRAME", "GLOBAL"),
    (encode_standard, "_BODY_NED", "MAV_FRAME", "BODY_NED"),
    (encode_standard, "_ACCEL_AND_GYRO", "HIGHRES_IMU_UPDATED", _IMU),
    (encode_standard, "_ON_GROUND", "MAV_LANDED_STATE", "ON_GROUND"),
    (encode_standard, "_IN_AIR", "MAV_LANDED_STATE", "IN_AIR"),
    (encode_standard, "_TAKEOFF", "MAV_LANDED_STATE", "TAKEOFF"),
    (encode_standard, "_LANDING", "MAV_LANDED_STATE", "LANDING"),
    (
        encode_standard,
        "_IGNORE_ALL",
        _MASK,
        f"{_P}|{_V}|{_A}|YAW_IGNORE|YAW_RATE_IGNORE",
    ),
    (encode_standard, "_RATES_IGNORED", _ATTITUDE_MASK, _RATES),
    (encode_standard, "_ATTITUDE_IGNORED", _ATTITUDE_MASK, "ATTITUDE_IGNORE"),
    (fence_items, "RETURN_POINT", "MAV_CMD", "NAV_FENCE_RETURN_POINT"),
    (fence_items, "POLYGON_INCLUSION", "MAV_CMD", "NAV_FENCE_POLYGON_VERTEX_INCLUSION"),
    (fence_items, "POLYGON_EXCLUSION", "MAV_CMD", "NAV_FENCE_POLYGON_VERTEX_EXCLUSION"),
    (fence_items, "CIRCLE_INCLUSION", "MAV_CMD", "NAV_FENCE_CIRCLE_INCLUSION"),
    (fence_items, "CIRCLE_EXCLUSION", "MAV_CMD", "NAV_FENCE_CIRCLE_EXCLUSION"),
    (message_ids, "AUTOPILOT", "MAV_COMP_ID", "AUTOPILOT1"),
    (message_ids, "PANDION", "MAV_COMP_ID", "USER1"),
    (message_ids, "PATH_PLANNER", "MAV_COMP_ID", "PATHPLANNER"),
    (mission_items, "GLOBAL_FRAMES", "MAV_FRAME", "GLOBAL GLOBAL_INT"),
    (mission_items, "HOME_FRAMES", "MAV_FRAME", "GLOBAL_RELATIVE_ALT GLOBAL_RELATIVE_ALT_INT"),
    (mission_items, "LOCAL_NED", "MAV_FRAME", "LOCAL_NED"),
    (mission_items, "LOCAL_OFFSET_NED", "MAV_FRAME", "LOCAL_OFFSET_NED"),
    (mission_items, "LOCAL_FRAMES", "MAV_FRAME", "LOCAL_NED LOCAL_OFFSET_NED"),
    (mission_items, "UNSUPPORTED_FRAME", "MAV_MISSION", "UNSUPPORTED_FRAME"),
    (mission_items, "UNSUPPORTED", "MAV_MISSION", "UNSUPPORTED"),
    (mission_items, "INVALID", "MAV_MISSION", "INVALID"),
    (mission_items, "INVALID_PARAM1", "MAV_MISSION", "INVALID_PARAM1"),
    (mission_items, "DENIED", "MAV_MISSION", "DENIED"),
    (identity, "_NOT_SELECTABLE", "MAV_MODE_PROPERTY", "NOT_USER_SELECTABLE"),
    (outgoing, "GENERIC", "MAV_AUTOPILOT", "GENERIC"),
    (outgoing, "PX4", "MAV_AUTOPILOT", "PX4"),
    (estimator_report, "NO_FIX", "GPS_FIX_TYPE", "NO_FIX"),
    (estimator_report, "ATTITUDE", "ESTIMATOR", "ATTITUDE"),
    (estimator_report, "LEVEL_VELOCITY", "ESTIMATOR", "VELOCITY_HORIZ"),
    (estimator_report, "VERTICAL_VELOCITY", "ESTIMATOR", "VELOCITY_VERT"),
    (estimator_report, "RELATIVE", "ESTIMATOR", "POS_HORIZ_REL"),
    (estimator_report, "ABSOLUTE", "ESTIMATOR", "POS_HORIZ_ABS"),
    (estimator_report, "HEIGHT", "ESTIMATOR", "POS_VERT_ABS"),
    (estimator_report, "ABOVE_GROUND", "ESTIMATOR", "POS_VERT_AGL"),
    (estimator_report, "PREDICTED_RELATIVE", "ESTIMATOR", "PRED_POS_HORIZ_REL"),
    (estimator_report, "PREDICTED_ABSOLUTE", "ESTIMATOR", "PRED_POS_HORIZ_ABS"),
    (estimator_report, "SATELLITES_DOUBTED", "ESTIMATOR", "GPS_GLITCH"),
    (estimator_report, "ACCELERATION_DOUBTED", "ESTIMATOR", "ACCEL_ERROR"),
    (sitl_decode, "_ARMED", "MAV_MODE_FLAG", "SAFETY_ARMED"),
    (sitl_encode, "_LOCAL_NED", "MAV_FRAME", "LOCAL_NED"),
    (sitl_encode, "_MOTION_CAPTURE", "MAV_ESTIMATOR_TYPE", "MOCAP"),
    (sitl_encode, "_ACCEL_AND_GYRO", _HIL, _IMU),
    (sitl_encode, "_GENERIC", "MAV_TYPE", "GENERIC"),
    (sitl_encode, "_NO_AUTOPILOT", "MAV_AUTOPILOT", "INVALID"),
    (sitl_encode, "_HIL", "MAV_MODE_FLAG", "HIL_ENABLED"),
    (sitl_encode, "_ACTIVE", "MAV_STATE", "ACTIVE"),
    (sitl_encode, "_FOR_EVERYTHING", "MAV_BATTERY_FUNCTION", "ALL"),
    (sitl_encode, "_LIPO", "MAV_BATTERY_TYPE", "LIPO"),
    (sitl_encode, "_WARNING", "MAV_SEVERITY", "WARNING"),
    (encode_sensors, "INERTIAL", _HIL, _IMU),
    (encode_sensors, "MAGNETIC", _HIL, "XMAG|YMAG|ZMAG"),
    (encode_sensors, "BAROMETRIC", _HIL, "ABS_PRESSURE|PRESSURE_ALT|TEMPERATURE"),
    (encode_sensors, "_LOCAL_NED", "MAV_FRAME", "LOCAL_NED"),
    (encode_sensors, "_BODY_FRD", "MAV_FRAME", "BODY_FRD"),
    (encode_sensors, "VIO", "MAV_ESTIMATOR_TYPE", "VIO"),
    (encode_sensors, "_MOTION_CAPTURE", "MAV_ESTIMATOR_TYPE", "MOCAP"),
    (encode_sensors, "_LASER", "MAV_DISTANCE_SENSOR", "LASER"),
    (encode_sensors, "_DOWNWARD", "MAV_SENSOR_ROTATION", "PITCH_270"),
    (sitl_gnss, "RTK_FIXED", "GPS_FIX_TYPE", "RTK_FIXED"),
    (sitl_gnss, "PLAIN_FIX", "GPS_FIX_TYPE", "3D_FIX"),
    (failures, "_WORKS", "FAILURE_TYPE", "OK"),
    (message_ids, "CMD_LAND", "MAV_CMD", "NAV_LAND"),
    (message_ids, "CMD_TAKEOFF", "MAV_CMD", "NAV_TAKEOFF"),
    (message_ids, "CMD_DO_SET_MODE", "MAV_CMD", "DO_SET_MODE"),
    (message_ids, "CMD_REBOOT_SHUTDOWN", "MAV_CMD", "PREFLIGHT_REBOOT_SHUTDOWN"),
    (message_ids, "CMD_ARM_DISARM", "MAV_CMD", "COMPONENT_ARM_DISARM"),
    (message_ids, "CMD_INJECT_FAILURE", "MAV_CMD", "INJECT_FAILURE"),
    (message_ids, "ACCEPTED", "MAV_RESULT", "ACCEPTED"),
    (message_ids, "TEMPORARILY_REJECTED", "MAV_RESULT", "TEMPORARILY_REJECTED"),
    (message_ids, "DENIED", "MAV_RESULT", "DENIED"),
    (message_ids, "UNSUPPORTED", "MAV_RESULT", "UNSUPPORTED"),
    (message_ids, "IN_PROGRESS", "MAV_RESULT", "IN_PROGRESS"),
]
MESSAGES: Final = [name for name in vars(message_ids) if hasattr(dialect, f"MAVLINK_MSG_ID_{name}")]
# Units and kinds of failures: our name, and MAVLink's where that is another one.
_UNITS: Final = {
    "gyro": "SENSOR_GYRO",
    "accel": "SENSOR_ACCEL",
    "mag": "SENSOR_MAG",
    "baro": "SENSOR_BARO",
    "gps": "SENSOR_GPS",
    "optical flow": "SENSOR_OPTICAL_FLOW",
    "vio": "SENSOR_VIO",
    "distance": "SENSOR_DISTANCE_SENSOR",
    "battery": "SYSTEM_BATTERY",
    "motor": "SYSTEM_MOTOR",
    "joint": "SYSTEM_SERVO",
    "mavlink": "SYSTEM_MAVLINK_SIGNAL",
}


def entry(enum: str, name: str) -> int:
    number: int = getattr(dialect, f"{enum}_{name}")
    return number


@pytest.mark.parametrize(
    ("module", "name", "enum", "entries"),
    TABLE,
    ids=[f"{module.__name__}.{name}" for module, name, *_ in TABLE],
)
def test_a_number_is_that_of_the_dialect(
    module: ModuleType, name: str, enum: str, entries: str
) -> None:
    written: Any = getattr(module, name)
    bits = [reduce(or_, [entry(enum, bit) for bit in one.split("|")]) for one in entries.split()]
    if isinstance(written, frozenset | tuple):
        assert set(written) == set(bits)
    else:
        assert [written] == bits


@pytest.mark.parametrize("name", MESSAGES)
def test_a_message_has_its_number(name: str) -> None:
    assert getattr(message_ids, name) == getattr(dialect, f"MAVLINK_MSG_ID_{name}")


def test_most_message_numbers_are_compared() -> None:
    assert len(MESSAGES) > 85


def test_failures_have_mavlinks_numbers() -> None:
    for number, unit in failures._UNITS.items():
        assert number == entry("FAILURE_UNIT", _UNITS[unit])
    for number, kind in failures._KINDS.items():
        assert number == entry("FAILURE_TYPE", kind.upper())


@pytest.mark.parametrize(
    ("rotors", "name"),
    [(4, "QUADROTOR"), (5, "GENERIC_MULTIROTOR"), (6, "HEXAROTOR"), (8, "OCTOROTOR")],
)
def test_the_type_of_a_vehicle_is_that_of_its_rotors(rotors: int, name: str) -> None:
    vehicle = replace(airframe.AIRFRAME, rotors=rotors)
    assert vehicle.mav_type == getattr(dialect, f"MAV_TYPE_{name}")
