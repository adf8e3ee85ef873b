"""Every parameter a ground station may change.

A parameter is one number of ``FlightConfig``: an INT32 where it counts or chooses, else a REAL32.
Units are chosen so that every default has at most six decimals: MAVProxy writes no more into its
files. Names that PX4 has too mean what they mean there and have PX4's type; all others avoid
PX4's, because QGroundControl would show PX4's text beside them.

Defaults are not in the table: they are those of the dataclasses.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from operator import attrgetter
from typing import Final, cast

from fsw.autopilot.estimation.sensors import SENSORS
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.parameters.param_type import nearest_decimal
from fsw.autopilot.tuning import Row, Tuning, number_at

ACCEL_RANGE: Final = "EST_ACC_RANGE"
# What the configuration's number is of a parameter's, by the begin of its unit.
_SCALES: Final = {"deg": math.pi / 180.0, "ms": 1e-3, "1e-6": 1e-6}
_IN_MICROSECONDS: Final = 1e6  # numbers whose names say so, of parameters in seconds
# PX4 multiplies these by the step of its filter, 10 ms: densities of white noise times its root.
_PX4_STEP: Final = 0.1  # sqrt(s)


Choices = tuple[tuple[int, str], ...]
"""The values that something can have, with what each means."""

_Choice = tuple[str, str, str, dict[int, str]]
"""A parameter that chooses: its name, the path of its number, meaning, and what each number is."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number a ground station may change in flight."""

    name: str  # at most 16 characters
    path: str  # of the number in FlightConfig
    unit: str
    least: float
    most: float
    meaning: str
    group: str
    scale: float  # the configuration's number is this times the parameter
    integer: bool = False  # an INT32, whose values are ints; else a REAL32
    choices: Choices = ()  # where only some values mean something

    @property
    def default(self) -> float:
        """The value of an untuned vehicle."""
        return self.read(FlightConfig())

    def read(self, config: FlightConfig) -> float:
        """Its value in a configuration."""
        return self.kept(number_at(config, self.path) / self.scale)

    def kept(self, value: float) -> float:
        """A ``value`` [its unit] of its range as the vehicle keeps it, in the parameter's type."""
        return round(value) if self.integer else nearest_decimal(value)

    def has_type_of(self, value: float) -> bool:
        """Whether its type can hold a ``value`` [its unit] exactly, whatever its range."""
        return float(value).is_integer() if self.integer else nearest_decimal(value) == value

    def waits_for_disarming(self, config: FlightConfig) -> bool:
        """Whether its value in a ``config`` may not come while armed: anybody may send it."""
        chosen = dict(self.choices).get(int(self.read(config)))
        return _is_for_disarmed(self.name, self.path) or chosen == _ENDS

    def refusal(self, value: float) -> str | None:
        """Why it cannot have a ``value`` [its unit]; None if the range allows it."""
        if not self.integer:
            value = nearest_decimal(value)
        elif not self.has_type_of(value):
            return f"{self.name} is an INT32 and must be a whole number, {value:g} is refused"
        if self.choices and value not in [number for number, _ in self.choices]:
            known = ", ".join(f"{number} {what}" for number, what in self.choices)
            return f"{self.name} is to be one of {known}; {value:g} is refused"
        if self.least <= value <= self.most:  # NaN is not
            return None
        return f"{self.name} is to be {self.least:g}..{self.most:g}, {value:g} is refused"


# Parameters that only a disarmed vehicle takes: who may let it go farther, what of it keeps clear,
# what makes it fall, how high it flies, how fast it climbs and sinks, whether a return lands, what
# promises are made for, and what is known of sensors, by which the estimate would jump.
_DISARMED: Final = frozenset(
    {"SAFE_OWNER", "PLN_BODY", "CBRK_FLIGHTTERM"}
    | {"RTL_RETURN_ALT", "RTL_DESCEND_ALT", "RTL_LAND_DELAY"}
    | {"LND_SPEED", "TKO_SPEED", "STR_ALT_MAX"}
)
_ASSUMED: Final = ("surroundings.", "estimator.")
_ENDS: Final = "Terminate"
_RETREAT: Final = "Retreat along the normal, then hold"


def _is_for_disarmed(name: str, path: str) -> bool:
    """Whether no value of the parameter may come while armed."""
    return name in _DISARMED or path.startswith(_ASSUMED)


def _exceptions(bits: int) -> str:
    """Modes of COM_DLL_EXCEPT, as a choice."""
    modes = enumerate(("Mission", "Hold", "Offboard", "Trajectory"))
    return " and ".join(mode for k, mode in modes if bits >> k & 1) or "None"


_Pid = tuple[float, float, float, float]  # P, I, D and the limit
_NIL: Final[_Pid] = (0.0, 0.0, 0.0, 0.01)


def _pid(name: str, path: str, unit: str, most: _Pid, what: str, least: _Pid = _NIL) -> list[Row]:
    p, i, d, limit = zip(least, most, strict=True)
    return [
        (f"{name}_P", f"{path}.kp", "1/s^2", *p, f"{what}: proportional gain"),
        (f"{name}_I", f"{path}.ki", "1/s^3", *i, f"{what}: integral gain"),
        (f"{name}_D", f"{path}.kd", "1/s", *d, f"{what}: derivative gain"),
        (f"{name}_MAX", f"{path}.limit", unit, *limit, f"{what}: output limit"),
    ]


def _barrier(name: str, path: str, what: str) -> list[Row]:
    return [
        (f"{name}_ALPHA", f"{path}.alpha", "m/s^2", 0.1, 10.0,
         f"{what}: assumed braking deceleration"),
        (f"{name}_K_S", f"{path}.slope", "1/s", 0.5, 10.0, f"{what}: slope k_S at the boundary"),
        (f"{name}_GAMMA", f"{path}.gamma", "1/s", 0.1, 10.0, f"{what}: CBF decay rate γ"),
        (f"{name}_LAMBDA", f"{path}.lambda_", "m/s", 0.01, 5.0,
         f"{what}: disturbance robustness λ"),
    ]  # fmt: skip


def _of_sensor(name: str, row: Row) -> Row:
    parameter, number, *rest = row
    return cast(Row, (parameter, f"{_EST}.{name}.{number}", *rest))


_TRACKING = "tuning.tracking"
_WEIGHTS = "planner.weights"
_SOFT = "planner.soft"
_EST = "estimator"
_ROWS: Final[dict[str, list[Row | _Choice]]] = {
    "Tracking loop": [
        ("TRK_EFFORT", f"{_TRACKING}.input_weight", "1e-6 s^8", 0.05, 100.0,
         "Horizontal LQR weight on snap; smaller tracks tighter until the rotors saturate"),
        ("TRK_POINT", f"{_TRACKING}.point_below_base", "m", 0.0, 0.3,
         "Distance of the controlled point below the base"),
        ("TRK_Z_EFFORT", f"{_TRACKING}.vertical_input_weight", "1e-6 s^4", 0.05, 10000.0,
         "Vertical LQR weight on acceleration"),
        ("TRK_DIST_TAU", f"{_TRACKING}.disturbance_correlation", "s", 0.01, 1.0,
         "Disturbance model: correlation time"),
        ("TRK_Z_DIST_TAU", f"{_TRACKING}.vertical_disturbance_correlation", "s", 0.01, 10.0,
         "Disturbance model, vertical: correlation time"),
        ("TRK_Z_DIST_MAX", f"{_TRACKING}.vertical_disturbance_limit", "m/s^2", 0.0, 5.0,
         "Observed vertical disturbance that thrust reacts to, maximum"),
        ("TRK_OBS_BW", f"{_TRACKING}.observer_bandwidth", "rad/s", 10.0, 200.0,
         "Disturbance observer bandwidth"),
        ("TRK_WIND_TAU", f"{_TRACKING}.wind_time", "s", 0.5, 60.0, "Wind estimate: time constant"),
        ("TRK_WIND_MAX", f"{_TRACKING}.wind_limit", "m/s^2", 0.0, 1.0,
         "Wind estimate: limit per axis"),
        ("TRK_ERR_MAX", f"{_TRACKING}.position_error_limit", "m", 0.01, 0.5,
         "Position error limit"),
        ("TRK_ACC_MAX", f"{_TRACKING}.acceleration_limit", "m/s^2", 0.5, 5.0,
         "Acceleration command limit"),
        ("TRK_JRK_MAX", f"{_TRACKING}.jerk_limit", "m/s^3", 2.0, 100.0, "Jerk command limit"),
        ("TRK_STOP_SNAP", f"{_TRACKING}.stopping_snap", "m/s^4", 10.0, 1000.0,
         "Snap that a commanded jerk must be stoppable with"),
    ],
    "Planner above PX4": [
        ("PX4_XY_P", "px4.position_gain", "1/s", 0.1, 5.0,
         "PX4's loops as they are believed to be: its MPC_XY_P"),
        ("PX4_XY_V_P", "px4.velocity_gain", "1/s", 0.5, 15.0, "The same: its MPC_XY_VEL_P_ACC"),
        ("PX4_XY_V_I", "px4.velocity_integral", "1/s^2", 0.0, 60.0,
         "The same: its MPC_XY_VEL_I_ACC"),
        ("PX4_XY_V_D", "px4.acceleration_gain", "", 0.0, 2.0, "The same: its MPC_XY_VEL_D_ACC"),
        ("PX4_Z_P", "px4.height_gain", "1/s", 0.1, 5.0, "The same: its MPC_Z_P"),
        ("PX4_Z_V_P", "px4.climb_gain", "1/s", 0.5, 15.0, "The same: its MPC_Z_VEL_P_ACC"),
        ("PX4_Z_V_I", "px4.climb_integral", "1/s^2", 0.0, 10.0, "The same: its MPC_Z_VEL_I_ACC"),
        ("PX4_TILT_KP", "px4.tilt_kp", "1/s^2", 5.0, 1000.0,
         "Stiffness of PX4's attitude loop; plans count on it from the next start on"),
        ("PX4_TILT_KD", "px4.tilt_kd", "1/s", 1.0, 100.0,
         "Damping of PX4's attitude loop; plans count on it from the next start on"),
        ("PX4_DELAY", "px4.delay", "ms", 2.0, 200.0,
         "From a state that is measured to a torque that answers it; plans count on it from the "
         "next start on"),
        ("PX4_OBS_BW", "px4.observer", "rad/s", 1.0, 60.0,
         "Disturbance observer bandwidth above PX4"),
        ("PX4_CANCEL", "px4.cancelled", "", 0.0, 1.0,
         "Share of the observed disturbance that acceleration setpoints cancel"),
    ],
    "Inner loops": [
        *_pid("PID_ATT", "tuning.attitude", "rad/s^2", (500.0, 500.0, 100.0, 200.0),
              "Attitude PID (pid tracking only)"),
        *_pid("PID_HGT", "tuning.height", "m/s^2", (100.0, 100.0, 50.0, 9.0),
              "Height PID (pid tracking only)"),
        *_pid("PID_YAW", "tuning.yaw", "rad/s^2", (50.0, 50.0, 50.0, 5.0), "Yaw PID"),
        *_pid("PID_JNT", "tuning.joint", "rad/s^2", (2000.0, 2000.0, 200.0, 1000.0), "Joint PID",
              (50.0, 0.0, 5.0, 20.0)),
        ("JNT_MARGIN", "tuning.joint_limits.margin", "rad", 0.005, 0.5,
         "Joint references: margin to the joint limits"),
        ("JNT_RATE", "tuning.joint_limits.rate", "rad/s", 0.1, 5.0,
         "Joint references: maximum rate"),
        ("JNT_ACC", "tuning.joint_limits.acceleration", "rad/s^2", 20.0, 500.0,
         "Joint references: maximum acceleration of either link"),
        ("JNT_ARMATURE", "airframe.joint_armature", "kg m^2", 0.0, 0.1,
         "Inertia of each joint's motor behind its gear"),
        ("YAW_THR_MAX", "tuning.yaw_thrust_limit", "N", 0.0, 8.0,
         "Rotor thrust reserved for yaw, maximum"),
        ("CMP_WHOLE", "tuning.compensation.whole", "m", 0.0, 0.5,
         "Arm compensation: full up to this correction"),
        ("CMP_MOST", "tuning.compensation.most", "m", 0.01, 0.5,
         "Arm compensation: correction at most"),
        ("CMP_NEAR", "tuning.compensation.near", "m", 0.0, 0.5,
         "Arm compensation: full up to this recent position error"),
        ("CMP_FAR", "tuning.compensation.far", "m", 0.01, 1.0,
         "Arm compensation: none beyond this recent position error"),
        ("CMP_MEMORY", "tuning.compensation.memory", "s", 0.1, 60.0,
         "Arm compensation: time in which a position error is forgotten"),
    ],
    "Planner": [
        ("PLN_W_TRACK", f"{_WEIGHTS}.tracking", "", 1.0, 1000.0,
         "Weight w_1: end-effector position error"),
        ("PLN_W_TRACK_N", f"{_WEIGHTS}.tracking_terminal", "", 0.0, 5000.0,
         "Terminal weight w_s1: end-effector position error"),
        ("PLN_W_VEL", f"{_WEIGHTS}.velocity", "", 0.0, 1000.0,
         "Weight w_2: end-effector velocity error"),
        ("PLN_W_VEL_N", f"{_WEIGHTS}.velocity_terminal", "", 0.05, 5000.0,
         "Terminal weight w_s2: end-effector velocity error"),
        ("PLN_W_COG", f"{_WEIGHTS}.arm_com", "", 0.0, 1000.0,
         "Weight w_3: offset of the arm's centre of mass"),
        ("PLN_W_COG_N", f"{_WEIGHTS}.arm_com_terminal", "", 0.0, 5000.0,
         "Terminal weight w_s3: offset of the arm's centre of mass"),
        ("PLN_W_POSTURE", f"{_WEIGHTS}.posture", "", 0.0, 100.0,
         "Weight of joint angle error, when joint targets are given"),
        ("PLN_W_HOME", f"{_WEIGHTS}.home", "", 0.0, 100.0,
         "Weight of the way to the home posture, of three joints and more"),
        ("PLN_HOME_LEAD", f"{_WEIGHTS}.home_lead", "s", 0.0, 10.0,
         "Home posture look-ahead time (damps redundant joints)"),
        ("PLN_W_YAW", f"{_WEIGHTS}.yaw", "", 0.0, 100.0, "Weight of the yaw error"),
        ("PLN_YAW_LEAD", f"{_WEIGHTS}.yaw_lead", "s", 0.0, 10.0,
         "Yaw error look-ahead time (damps yaw)"),
        ("PLN_W_INPUT", f"{_WEIGHTS}.inputs", "", 0.0001, 100.0,
         "Input weight (keeps the optimum unique)"),
        ("PLN_TILT_MAX", "planner.limits.tilt", "deg", 2.0, 30.0, "Maximum tilt"),
        ("PLN_AZ_MAX", "planner.limits.vertical", "m/s^2", 0.2, 6.0,
         "Maximum vertical acceleration"),
        ("PLN_YAW_MAX", "planner.limits.yaw_acc", "rad/s^2", 0.01, 1.0,
         "Maximum yaw acceleration of a plan"),
        ("PLN_JNT_MAX", "planner.limits.joint_acc", "rad/s^2", 0.5, 50.0,
         "Maximum joint acceleration"),
        ("PLN_JNT_RATE", "planner.limits.joint_rate", "rad/s", 0.1, 4.0,
         "Maximum joint rate of a plan"),
        ("PLN_JNT_MARGIN", "planner.limits.joint_margin", "rad", 0.0, 0.5,
         "Margin of a plan to the joint limits"),
        ("PLN_JNT_SLACK", "planner.joint_slack", "", 0.0, 1e5, "Joint limit slack penalty"),
        ("PLN_BODY", "planner.body", "What keeps clear of obstacles",
         {0: "Base, joint 2 and end-effector as points", 1: "Full body"}),
        ("PLN_UPS_DIST", "upset_distance", "m", 0.02, 1.0,
         "Position error above which planning restarts from the measured state"),
        ("PLN_UPS_YAW", "upset_yaw", "rad", 0.05, 3.0,
         "Yaw error above which planning restarts from the measured state"),
    ],
    "Barriers": [
        *_barrier("WALL", "planner.walls", "Walls and obstacles"),
        *_barrier("SPH", "planner.workspace", "Workspace sphere"),
        ("BAR_SLACK", "planner.barrier_slack", "", 20.0, 1e5, "Barrier slack penalty"),
        ("SUR_DISTURB", "surroundings.disturbance", "m/s^2", 0.0, 3.0,
         "Assumed disturbance per axis (start-up analysis)"),
        ("SUR_HOLD", "surroundings.disturbance_hold", "s", 0.01, 2.0,
         "Assumed disturbance hold time (start-up analysis)"),
        ("SUR_ACC_TGT", "surroundings.target_acceleration", "m/s^2", 0.0, 3.0,
         "Assumed target acceleration (start-up analysis)"),
        ("SUR_V_TAN", "surroundings.tangential_speed", "m/s", 0.0, 3.0,
         "Assumed speed along the sphere (start-up analysis)"),
        ("SUR_V_ZONE", "surroundings.zone_speed", "m/s", 0.0, 3.0,
         "Maximum speed of a moving zone that is accepted"),
        ("SUR_HANGING", "surroundings.hanging", "m", 0.0, 0.3,
         "Distance of the end-effector below the base (start-up analysis)"),
    ],
    "Other controllers": [
        ("HC_TIGHTEN", "planner.tightening", "m", 0.0, 0.5, "HC controller: additional clearance"),
        ("SC_W_WALL", f"{_SOFT}.wall", "", 0.001, 1000.0,
         "SC controller: wall weight w_4 of eq 29 (larger is weaker)"),
        ("SC_W_WALL_N", f"{_SOFT}.wall_terminal", "", 0.001, 1000.0,
         "SC controller: terminal wall weight w_s4 (larger is weaker)"),
        ("SC_W_SPH", f"{_SOFT}.workspace", "", 0.0, 1000.0,
         "SC controller: sphere weight w_5 of eq 30"),
        ("SC_W_SPH_N", f"{_SOFT}.workspace_terminal", "", 0.0, 1000.0,
         "SC controller: terminal sphere weight w_s5"),
        ("SC_W_CENTRE", f"{_SOFT}.centring", "", 0.0, 10000.0,
         "Naive controller with centring: weight of the distance to the sphere's centre"),
    ],
    "Estimator": [
        (ACCEL_RANGE, f"{_EST}.accel_full_scale", "m/s^2", 1.0, 10000.0,
         "Accelerometer: its range; readings at an end of it are counted in VIBRATION"),
        *[
            _of_sensor(kind.sensor.name.lower(), row) for kind in SENSORS for row in kind.parameters
        ],
        ("EKF2_GYR_NOISE", f"{_EST}.gyro_noise", "rad/s", 0.0001, 0.1,
         "Gyro: noise, in PX4's steps of 10 ms", _PX4_STEP),
        ("EKF2_ACC_NOISE", f"{_EST}.accel_noise", "m/s^2", 0.01, 1.0,
         "Accelerometer: noise, in PX4's steps of 10 ms", _PX4_STEP),
        ("EKF2_GYR_B_NOISE", f"{_EST}.gyro_bias_walk", "rad/s^2", 0.0, 0.01,
         "Gyro: random walk of the bias, in PX4's steps of 10 ms", _PX4_STEP),
        ("EKF2_ACC_B_NOISE", f"{_EST}.accel_bias_walk", "m/s^3", 0.0, 0.1,
         "Accelerometer: random walk of the bias, in PX4's steps of 10 ms", _PX4_STEP),
        ("EKF2_GBIAS_INIT", f"{_EST}.gyro_bias", "rad/s", 0.0, 0.2,
         "Gyro: standard deviation of the bias at the start"),
        ("EKF2_ABIAS_INIT", f"{_EST}.accel_bias", "m/s^2", 0.0, 0.5,
         "Accelerometer: standard deviation of the bias at the start"),
        ("EKF2_ANGERR_INIT", f"{_EST}.tilt", "rad", 0.0, 0.5,
         "Standard deviation of the tilt at a start without a pose"),
    ],
    "Takeoff and landing": [
        ("MIS_TAKEOFF_ALT", "limits.takeoff_climb", "m", 0.3, 10.0, "Default takeoff height"),
        ("TKO_CLIMB_MAX", "limits.takeoff_climb_most", "m", 1.0, 150.0, "Maximum takeoff height"),
        ("TKO_WAIT_T", "limits.takeoff_wait_us", "s", 1.0, 300.0,
         "Takeoff command timeout before arming"),
        ("TKO_SPEED", "limits.climb_speed", "m/s", 0.05, 1.5, "Takeoff speed"),
        ("LND_SPEED", "limits.land_speed", "m/s", 0.05, 0.6, "Landing speed"),
        ("LND_HEIGHT", "limits.landed_height", "m", 0.02, 0.25,
         "Landing detector: maximum height above ground"),
        ("LND_AIRBORNE", "limits.airborne_height", "m", 0.25, 1.0,
         "Landing detector: height above ground that counts as flying"),
        ("LND_V_STILL", "limits.landed_speed", "m/s", 0.01, 0.3, "Landing detector: maximum speed"),
        ("LND_T_STILL", "limits.landed_time_us", "s", 0.1, 5.0,
         "Landing detector: time below both limits"),
        ("LND_IDLE_THR", "limits.idle_thrust", "N", 0.0, 4.0,
         "Rotor idle thrust on the ground when armed"),
    ],
    "Steering": [
        ("STR_CRUISE", "steering.cruise_speed", "m/s", 0.1, 3.0, "Cruise speed"),
        ("STR_V_MAX", "steering.speed", "m/s", 0.1, 3.0, "Maximum speed setpoint"),
        ("STR_ALT_MAX", "steering.highest", "m", 2.0, 1000.0, "Maximum height above the origin"),
        ("STR_ACC_MAX", "steering.acceleration", "m/s^2", 0.2, 2.5,
         "Maximum acceleration of the position setpoint"),
        ("STR_YAW_RATE", "steering.yaw_rate", "rad/s", 0.05, 1.0, "Maximum yaw rate"),
        ("STR_YAW_ACC", "steering.yaw_acceleration", "rad/s^2", 0.01, 0.5,
         "Maximum acceleration of the yaw setpoint"),
        ("STR_JNT_RATE", "steering.joint_speed", "rad/s", 0.05, 3.0,
         "Joint speed for joint setpoints"),
        ("STR_LEASH", "steering.max_lead_distance", "m", 0.1, 0.6,
         "Maximum lead distance of the setpoint over the vehicle"),
        ("RTL_RETURN_ALT", "limits.return_height", "m", 0.5, 50.0, "Return altitude above home"),
        ("RTL_DESCEND_ALT", "limits.return_descent", "m", 0.5, 50.0,
         "Return: altitude above home of the wait before landing"),
        ("RTL_LAND_DELAY", "limits.return_wait", "s", -1.0, 300.0,
         "Return: wait before landing; negative: hold there"),
    ],
    "Failsafes": [
        ("COM_OF_LOSS_T", "limits.setpoint_timeout_us", "s", 0.1, 5.0, "Offboard setpoint timeout"),
        ("COM_OBL_RC_ACT", "limits.setpoint_loss_action", "Offboard loss action",
         {3: "Return", 4: "Land", 5: "Hold", 6: _ENDS}),
        ("COM_DL_LOSS_T", "limits.station_timeout_us", "s", 3.0, 300.0,
         "Ground station heartbeat timeout"),
        ("NAV_DLL_ACT", "limits.station_loss_action",
         "Ground station loss action, in every flight mode but those of COM_DLL_EXCEPT",
         {0: "Disabled", 1: "Hold", 2: "Return", 3: "Land", 5: _ENDS}),
        ("COM_DLL_EXCEPT", "limits.station_loss_exceptions",
         "Modes in which the loss of the ground station is ignored",
         {bits: _exceptions(bits) for bits in range(16)}),
        # Any of their values is true of a vehicle without a radio, and scripts for PX4 set them.
        ("COM_RC_IN_MODE", "limits.radio_input",
         "Manual control input: there is no radio control, and no check of it",
         {1: "Joystick only", 4: "Disabled"}),
        ("COM_RCL_EXCEPT", "limits.radio_loss_exceptions", "", 0.0, 31.0,
         "Modes in which the loss of radio control is ignored: all, for there is none"),
        ("COM_FAIL_ACT_T", "limits.failsafe_delay_us", "s", 0.0, 25.0,
         "Time in Hold before a lost ground station or a battery lets the vehicle return or land"),
        ("BAT_LOW_THR", "limits.battery_low", "norm", 0.12, 0.5, "Battery low threshold"),
        ("BAT_CRIT_THR", "limits.battery_critical", "norm", 0.05, 0.5,
         "Battery critical threshold"),
        ("BAT_EMERGEN_THR", "limits.battery_emergency", "norm", 0.03, 0.5,
         "Battery emergency threshold"),
        ("COM_LOW_BAT_ACT", "limits.low_battery_action", "Low battery action",
         {0: "Warning", 2: "Land when critical", 3: "Return when critical, land at emergency"}),
        ("COM_FLTT_LOW_ACT", "limits.flight_time_action",
         "Action when the flight time that is left is no longer than the way home takes",
         {0: "None", 1: "Warning", 3: "Return"}),
        ("RTL_TIME_FACTOR", "limits.return_time_factor", "", 1.0, 2.0,
         "Safety factor of the time that the way home takes"),
        ("RTL_TIME_MARGIN", "limits.return_time_margin", "s", 0.0, 3600.0,
         "Safety margin of the time that the way home takes"),
        ("FD_FAIL_R", "limits.roll_failure", "deg", 0.0, 180.0,
         "Roll that is an attitude failure, well above its own tilt; 0: no check"),
        ("FD_FAIL_P", "limits.pitch_failure", "deg", 0.0, 180.0,
         "Pitch that is an attitude failure, well above its own tilt; 0: no check"),
        ("FD_FAIL_R_TTRI", "limits.roll_failure_us", "s", 0.02, 5.0,
         "Time beyond FD_FAIL_R that is a failure"),
        ("FD_FAIL_P_TTRI", "limits.pitch_failure_us", "s", 0.02, 5.0,
         "Time beyond FD_FAIL_P that is a failure"),
        ("CBRK_FLIGHTTERM", "limits.termination_breaker",
         "Circuit breaker of the flight termination by an attitude failure",
         {0: "Termination enabled", 121212: "Termination disabled"}),
        ("COM_PLN_LOSS_T", "limits.planner_loss_us", "s", 1.0, 60.0,
         "Time without a new plan after which the vehicle descends"),
        ("FD_ACT_EN", "limits.watches_actuators", "Detection of rotors and joints that fail",
         {0: "Disabled", 1: "Enabled"}),
        ("CA_FAILURE_MODE", "limits.failed_rotor_mode", "What allocation does about a failed rotor",
         {0: "Ignored", 1: "Allocation reweighted by its effectiveness"}),
        ("COM_ACT_FAIL_ACT", "limits.actuator_failure_action",
         "Action when a rotor or a joint has failed",
         {0: "Warning", 1: "Hold", 2: "Land", 3: "Return", 4: _ENDS}),
        ("COM_FLOOD_RATE", "limits.flood_rate", "1/s", 100.0, 100000.0,
         "Datagrams from the ground above which a link is reported as flooded"),
        ("COM_AID_LOSS_T", "limits.aiding_loss_us", "s", 0.01, 10.0,
         "Time without a usable position after which its loss is reported"),
        ("COM_POS_LOW_EPH", "limits.position_low", "m", 0.02, 10.0,
         "Dead reckoning: how far off the position may be that is acted upon"),
        ("COM_POS_LOW_ACT", "limits.position_low_action",
         "Dead reckoning: action above COM_POS_LOW_EPH",
         {1: "Warning", 2: "Hold", 5: "Land"}),
        ("COM_POS_FS_EPH", "limits.position_lost", "m", 0.05, 100.0,
         "Dead reckoning: standard deviation of the position above which the vehicle descends"),
        ("COM_ATT_LOSS", "limits.attitude_loss", "deg", 5.0, 60.0,
         "Standard deviation of roll and pitch above which the rotors stop"),
        ("COM_SENS_LOSS_T", "limits.sensor_loss_us", "s", 0.004, 10.0,
         "Time without a usable inertial unit or encoder after which it is lost"),
        ("COM_SENS_ACT", "limits.sensor_loss_action",
         "Action when inertial unit or joint encoders are lost",
         {1: "Warning", 2: "Hold", 5: "Land"}),
        ("SYS_FAILURE_EN", "limits.failure_injection", "Command INJECT_FAILURE in simulation",
         {0: "Refused", 1: "Passed on to the simulator"}),
    ],
    "Arming": [
        ("COM_ARM_BAT_MIN", "limits.arm_battery", "norm", -1.0, 0.9,
         "Battery below which arming is denied; negative: below BAT_CRIT_THR"),
        ("COM_ARM_TILT", "limits.arm_tilt", "deg", 1.0, 90.0, "Tilt above which arming is denied"),
        ("COM_ARM_SDCARD", "limits.arm_without_log",
         "Arming while the flight log cannot be written",
         {0: "Allowed", 1: "Allowed, with a warning", 2: "Denied"}),
    ],
    "Safe set": [
        ("SAFE_OWNER", "limits.safe_set_owner", "", 0.0, 255.0,
         "MAVLink system that owns the safe set and may grow it in flight; 0: the first one"),
        ("SAFE_BREACH_ACT", "limits.breach_action",
         "Action when the vehicle is outside its safe set",
         {1: "Warning", 2: "Hold", 5: "Land", 6: _RETREAT}),
        ("GF_ACTION", "limits.fence_action", "Action when the vehicle is outside an uploaded fence",
         {0: "None", 1: "Warning", 2: "Hold", 3: "Return", 4: _ENDS, 5: "Land", 6: _RETREAT}),
        ("SAFE_LAMBDA_MIN", "planner.lambda_min", "m/s", 0.0, 5.0,
         "Least λ beside walls, after little disturbance for long; 0: λ is always whole"),
        ("SAFE_SIGMAS", "limits.clearance_sigmas", "", 0.0, 6.0,
         "Standard deviations of the estimate that clearances grow by"),
        ("SAFE_FILTER", "safety_filter.enabled",
         "Filter of the acceleration that the loops are about to realise",
         {0: "Disabled", 1: "Enabled"}),
        ("SAFE_FLT_GAMMA", "safety_filter.gamma", "1/s", 0.1, 20.0,
         "Safety filter: CBF decay rate"),
        ("SAFE_FLT_DIST", "safety_filter.allowance", "m/s^2", -5.0, 5.0,
         "Safety filter: acceleration left for a disturbance that is not measured"),
        ("SAFE_FLT_NEAR", "safety_filter.near", "m", 0.1, 5.0,
         "Safety filter: distance from the vehicle beyond which a zone is left out"),
        ("SAFE_FLT_AZ_MAX", "safety_filter.vertical", "m/s^2", 0.5, 6.0,
         "Safety filter: maximum vertical acceleration"),
        ("SAFE_OWNER_T", "limits.owner_timeout_us", "s", 2.0, 300.0,
         "Silence after which another source may own the safe set, on the ground"),
        ("SAFE_MOVE_T", "limits.zone_timeout_us", "s", 0.5, 60.0,
         "Silence after which a moving zone is held where it is predicted then"),
    ],
    "Log": [
        ("LOG_PROFILE", "log_profile", "Contents of flight.ulg; takes effect at the next start",
         {0: "Sensors and actuators every tick, the rest at 50 Hz", 1: "Everything every tick"}),
    ],
    "Missions": [
        ("MSN_SPEED", "limits.mission_speed", "m/s", 0.01, 1.0, "Default mission speed"),
        ("MSN_TURN_RATE", "limits.mission_turn_rate", "rad/s", 0.01, 1.0,
         "Mission: maximum yaw rate"),
        ("MSN_TURN_ACC", "limits.mission_turn_acceleration", "rad/s^2", 0.005, 0.1,
         "Mission: maximum yaw acceleration"),
        ("FNC_CLEARANCE", "limits.fence_clearance", "m", 0.0, 2.0,
         "Clearance to geofence walls; applies to the next upload"),
    ],
}  # fmt: skip


# PX4 has these as INT32 although they are no counts: whole seconds and degrees.
_WHOLE: Final = frozenset(("COM_DL_LOSS_T", "FD_FAIL_P", "FD_FAIL_R", "RTL_TIME_MARGIN"))
_UNTUNED: Final = FlightConfig()


def _parameter(group: str, row: Row | _Choice) -> Parameter:
    choices: dict[int, str] = {}
    if len(row) == 4:
        name, path, meaning, choices = row
        row = (name, path, "", min(choices), max(choices), meaning)
    name, path, unit, least, most, meaning = row[:6]
    usual = _IN_MICROSECONDS if path.endswith("_us") else _SCALES.get(unit.partition(" ")[0], 1.0)
    scale = row[6] if len(row) == 7 else usual
    counts = scale == 1.0 and isinstance(attrgetter(path)(_UNTUNED), int | str)
    return Parameter(
        name=name,
        path=path,
        unit=unit,
        least=least,
        most=most,
        meaning=meaning + ("; changed while disarmed" if _is_for_disarmed(name, path) else ""),
        group=group,
        scale=scale,
        integer=counts or name in _WHOLE,
        choices=tuple(choices.items()),
    )


# In the order of their index on the wire, which is that of their names: clients sort so too.
PARAMETERS: Final[tuple[Parameter, ...]] = tuple(
    sorted(
        (_parameter(group, row) for group, rows in _ROWS.items() for row in rows),
        key=lambda parameter: parameter.name,
    )
)
BY_NAME: Final[dict[str, Parameter]] = {parameter.name: parameter for parameter in PARAMETERS}


def tuning_of(values: Mapping[str, float]) -> Tuning:
    """The numbers of a configuration that are parameters' ``values`` [their units] by name."""
    return tuple((BY_NAME[name].path, BY_NAME[name].scale * one) for name, one in values.items())


GROUPS: Final[tuple[str, ...]] = tuple(_ROWS)
