"""Topics under PX4's names that its tools draw: Flight Review, PlotJuggler, pyulog's KML.

They follow from the others, so that nothing in here is needed to replay a flight. Fields and units
are PX4's; a field whose value is not known here is left out, or NaN where a tool asks for it.

Source: PX4's message definitions, msg/*.msg.
"""

from __future__ import annotations

from typing import Final

from messages.ulog import Field, Topic, floats

FAST: Final = "100 Hz; every tick with `LOG_PROFILE` 1"
TORQUE: Final = "100 Hz"
SETPOINTS: Final = "20 Hz"
SETPOINTS_IN_FLIGHT: Final = "in flight, 20 Hz"
PLACE: Final = "5 Hz"
SECOND: Final = "every second"


def _bools(*names: str, note: str = "") -> tuple[Field, ...]:
    return tuple(Field(name, "bool", note=note) for name in names)


VEHICLE_TORQUE_SETPOINT: Final = Topic(
    "vehicle_torque_setpoint",
    "Torque that the rotor commands give",
    TORQUE,
    (Field("xyz", "float", 3, "-1 to 1 of the largest, body"),),
)
VEHICLE_THRUST_SETPOINT: Final = Topic(
    "vehicle_thrust_setpoint",
    "Thrust that the rotor commands give",
    SETPOINTS,
    (Field("xyz", "float", 3, "-1 to 1 of the largest, body; z is negative"),),
)
VEHICLE_ATTITUDE_SETPOINT: Final = Topic(
    "vehicle_attitude_setpoint",
    "Attitude whose thrust gives the acceleration in force",
    SETPOINTS_IN_FLIGHT,
    (
        Field("q_d", "float", 4, "[w, x, y, z], body to NED"),
        *floats("yaw_sp_move_rate", note="rad/s"),
        Field("thrust_body", "float", 3, "-1 to 1 of the largest"),
    ),
)
VEHICLE_RATES_SETPOINT: Final = Topic(
    "vehicle_rates_setpoint",
    "Body rates with which the running plan turns its thrust",
    SETPOINTS_IN_FLIGHT,
    (
        *floats("roll", "pitch", "yaw", note="rad/s, body"),
        Field("thrust_body", "float", 3, "-1 to 1 of the largest"),
    ),
)
VEHICLE_GLOBAL_POSITION: Final = Topic(
    "vehicle_global_position",
    "Estimate of the body origin on Earth",
    PLACE,
    (
        Field("lat", "double", note="deg"),
        Field("lon", "double", note="deg"),
        *floats("alt", note="m above mean sea level"),
        *floats("eph", "epv", note="m, standard deviation; NaN: exact states"),
    ),
)
VEHICLE_GPS_POSITION: Final = Topic(
    "vehicle_gps_position",
    "What the receiver said last; without one the estimate, with 0 satellites",
    PLACE,
    (
        Field("latitude_deg", "double", note="deg"),
        Field("longitude_deg", "double", note="deg"),
        Field("altitude_msl_m", "double", note="m"),
        *floats("eph", "epv", note="m, standard deviation"),
        *floats("hdop", "vdop", note="not known: NaN"),
        *floats("s_variance_m_s", note="m/s, standard deviation"),
        *floats("vel_m_s", note="m/s, level"),
        Field("fix_type", "uint8_t", note="GPS_FIX_TYPE"),
        Field("satellites_used", "uint8_t", note="255: not said"),
    ),
)
BATTERY_STATUS: Final = Topic(
    "battery_status",
    "Battery, as modelled and corrected by what is measured of it",
    SECOND,
    (
        *floats("voltage_v", note="V, under load"),
        *floats("current_a", note="A"),
        *floats("discharged_mah", note="mA h"),
        *floats("remaining", note="share of the capacity"),
        *floats("time_remaining_s", note="s; NaN: not known"),
        Field("warning", "uint8_t", note="0 none, 1 low, 2 critical, 3 emergency"),
    ),
)
VEHICLE_IMU_STATUS: Final = Topic(
    "vehicle_imu_status",
    "Vibration of the inertial unit, as PX4 computes it: 1 % of each change is added",
    SECOND,
    (
        *floats("accel_vibration_metric", note="m/s^2"),
        *floats("gyro_vibration_metric", note="rad/s"),
    ),
)
FAILSAFE_FLAGS: Final = Topic(
    "failsafe_flags",
    "Active conditions under PX4's names; all of them by their own are in `vehicle_status`",
    "on change of a fault and every second",
    (
        *_bools("attitude_invalid", "local_altitude_invalid"),
        *_bools("local_position_invalid", "local_velocity_invalid"),
        *_bools("auto_mission_missing", note="none was uploaded"),
        *_bools("offboard_control_signal_lost", note="no setpoint in time"),
        *_bools("gcs_connection_lost"),
        Field("battery_warning", "uint8_t", note="as in `battery_status`"),
        *_bools("battery_low_remaining_time", "geofence_breached"),
        *_bools("fd_critical_failure", note="tilt beyond recovery"),
        *_bools("fd_motor_failure"),
    ),
)
CPULOAD: Final = Topic(
    "cpuload",
    "The tick's share of its period, and memory; of real time alone",
    SECOND,
    (
        *floats("load", note="median execution time over the period"),
        *floats("ram_usage", note="largest so far over the machine's"),
    ),
)
PX4_TOPICS: Final = (
    VEHICLE_TORQUE_SETPOINT,
    VEHICLE_THRUST_SETPOINT,
    VEHICLE_ATTITUDE_SETPOINT,
    VEHICLE_RATES_SETPOINT,
    VEHICLE_GLOBAL_POSITION,
    VEHICLE_GPS_POSITION,
    BATTERY_STATUS,
    VEHICLE_IMU_STATUS,
    FAILSAFE_FLAGS,
    CPULOAD,
)
