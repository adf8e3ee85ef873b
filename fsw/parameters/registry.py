"""Every parameter a ground station may change: one table, and why the other numbers are none.

A parameter is a REAL32 on the wire (clients disagree on how integers are encoded) and one number
of ``FlightConfig``. Units are chosen so that every default has at most six decimals: MAVProxy
writes no more into its files. Names that PX4 has too mean what they mean there; all others
avoid PX4's, because QGroundControl would show PX4's text beside them.

Defaults are not in the table: they are those of the dataclasses.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from fsw.parameters.flight_config import FlightConfig
from fsw.parameters.real32 import nearest_decimal
from fsw.tuning import number_at

_DEGREE: Final = math.pi / 180.0
_MICRO: Final = 1e-6
_IN_MICROSECONDS: Final = 1e6


Choices = tuple[tuple[int, str], ...]
"""The values that something can have, with what each means."""


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
    choices: Choices = ()  # where only some values mean something

    @property
    def default(self) -> float:
        """The value of a vehicle that nobody has tuned."""
        return self.read(FlightConfig())

    def read(self, config: FlightConfig) -> float:
        """Its value in a configuration."""
        return nearest_decimal(number_at(config, self.path) / self.scale)

    def refusal(self, value: float) -> str | None:
        """Why it cannot have a value; None if the range allows it."""
        if self.choices and value not in [number for number, _ in self.choices]:
            known = ", ".join(f"{number} {what}" for number, what in self.choices)
            return f"{self.name} is to be one of {known}; {value:g} is refused"
        if self.least <= value <= self.most:  # NaN is not
            return None
        return f"{self.name} is to be {self.least:g}..{self.most:g}, {value:g} is refused"


_Pid = tuple[float, float, float, float]  # P, I, D and the limit
_NIL: Final[_Pid] = (0.0, 0.0, 0.0, 0.01)
_Row = tuple[str, str, str, float, float, str] | tuple[str, str, str, float, float, str, float]


def _pid(name: str, path: str, unit: str, most: _Pid, what: str, least: _Pid = _NIL) -> list[_Row]:
    p, i, d, limit = zip(least, most, strict=True)
    return [
        (f"{name}_P", f"{path}.kp", "1/s^2", *p, f"{what}: gain on the error"),
        (f"{name}_I", f"{path}.ki", "1/s^3", *i, f"{what}: gain on its integral"),
        (f"{name}_D", f"{path}.kd", "1/s", *d, f"{what}: gain on its rate"),
        (f"{name}_MAX", f"{path}.limit", unit, *limit, f"{what}: limit of the correction"),
    ]


def _barrier(name: str, path: str, what: str) -> list[_Row]:
    return [
        (f"{name}_ALPHA", f"{path}.alpha", "m/s^2", 0.1, 10.0, f"{what}: braking counted on"),
        (f"{name}_K_S", f"{path}.slope", "1/s", 0.5, 10.0, f"{what}: slope k_S at the boundary"),
        (f"{name}_GAMMA", f"{path}.gamma", "1/s", 0.1, 10.0, f"{what}: rate of approach"),
        (f"{name}_LAMBDA", f"{path}.lambda_", "m/s", 0.01, 5.0, f"{what}: kept for the unknown"),
    ]


_TRACKING = "tuning.tracking"
_WEIGHTS = "planner.weights"
_SOFT = "planner.soft"
_ROWS: Final[dict[str, list[_Row]]] = {
    "Tracking loop": [
        ("TRK_EFFORT", f"{_TRACKING}.input_weight", "1e-6 s^8", 0.05, 100.0,
         "price of horizontal snap in the LQR; cheaper follows closer, until the rotors saturate",
         _MICRO),
        ("TRK_POINT", f"{_TRACKING}.point_below_base", "m", 0.0, 0.3,
         "how far below the base the point is that the loop holds"),
        ("TRK_Z_EFFORT", f"{_TRACKING}.vertical_input_weight", "1e-6 s^4", 0.05, 1000.0,
         "price of vertical acceleration in the LQR", _MICRO),
        ("TRK_DIST_TAU", f"{_TRACKING}.disturbance_correlation", "s", 0.01, 1.0,
         "how long a disturbance is believed to last"),
        ("TRK_OBS_BW", f"{_TRACKING}.observer_bandwidth", "rad/s", 10.0, 200.0,
         "bandwidth of the disturbance observer"),
        ("TRK_WIND_TAU", f"{_TRACKING}.wind_time", "s", 0.5, 60.0,
         "how long a disturbance lasts before it is taken for wind"),
        ("TRK_WIND_MAX", f"{_TRACKING}.wind_limit", "m/s^2", 0.0, 1.0,
         "wind that is cancelled at most, an axis"),
        ("TRK_ERR_MAX", f"{_TRACKING}.position_error_limit", "m", 0.01, 0.5,
         "position error that is corrected at most"),
        ("TRK_ACC_MAX", f"{_TRACKING}.acceleration_limit", "m/s^2", 0.5, 5.0,
         "acceleration that is asked for at most"),
        ("TRK_JRK_MAX", f"{_TRACKING}.jerk_limit", "m/s^3", 2.0, 100.0,
         "jerk that is asked for at most"),
    ],
    "Inner loops": [
        *_pid("PID_ATT", "tuning.attitude", "rad/s^2", (500.0, 500.0, 100.0, 200.0),
              "attitude (--inner pid)"),
        *_pid("PID_HGT", "tuning.height", "m/s^2", (100.0, 100.0, 50.0, 9.0),
              "height (--inner pid)"),
        *_pid("PID_YAW", "tuning.yaw", "rad/s^2", (50.0, 50.0, 50.0, 5.0), "yaw"),
        *_pid("PID_JNT", "tuning.joint", "rad/s^2", (2000.0, 2000.0, 200.0, 1000.0), "arm joints",
              (50.0, 0.0, 5.0, 20.0)),
        ("YAW_THR_MAX", "tuning.yaw_thrust_limit", "N", 0.0, 8.0,
         "thrust of a rotor that yaw may use"),
        ("CMP_REACH", "tuning.compensation.reach", "norm", 0.5, 0.999,
         "the arm compensates up to this share of its straight length"),
        ("CMP_FOLD", "tuning.compensation.fold", "norm", 0.1, 0.5,
         "the arm compensates down to this share of its straight length"),
        ("CMP_MARGIN", "tuning.compensation.joint_margin", "rad", 0.0, 0.5,
         "what compensation keeps to the joint limits"),
        ("CMP_WHOLE", "tuning.compensation.whole", "m", 0.0, 0.5,
         "the arm compensates wholly while the base is this close to its plan"),
        ("CMP_NONE", "tuning.compensation.none", "m", 0.01, 1.0,
         "the arm does not compensate while the base is farther off than this"),
    ],
    "Planner": [
        ("PLN_W_TRACK", f"{_WEIGHTS}.tracking", "", 0.0, 1000.0,
         "weight w_1 of the end-effector's position error"),
        ("PLN_W_TRACK_N", f"{_WEIGHTS}.tracking_terminal", "", 0.0, 5000.0,
         "the same at the last node, w_s1"),
        ("PLN_W_VEL", f"{_WEIGHTS}.velocity", "", 0.0, 1000.0,
         "weight w_2 of the end-effector's velocity error"),
        ("PLN_W_VEL_N", f"{_WEIGHTS}.velocity_terminal", "", 0.0, 5000.0,
         "the same at the last node, w_s2"),
        ("PLN_W_COG", f"{_WEIGHTS}.arm_com", "", 0.0, 1000.0,
         "weight w_3 of the arm's centre of gravity"),
        ("PLN_W_COG_N", f"{_WEIGHTS}.arm_com_terminal", "", 0.0, 5000.0,
         "the same at the last node, w_s3"),
        ("PLN_W_POSTURE", f"{_WEIGHTS}.posture", "", 0.0, 100.0,
         "weight of the joints' error, where joints are asked for"),
        ("PLN_W_YAW", f"{_WEIGHTS}.yaw", "", 0.0, 100.0, "weight of the yaw error"),
        ("PLN_YAW_LEAD", f"{_WEIGHTS}.yaw_lead", "s", 0.0, 10.0,
         "how far ahead the yaw error looks at the rate of now, which damps the yaw"),
        ("PLN_W_INPUT", f"{_WEIGHTS}.inputs", "", 0.0001, 100.0,
         "weight of all inputs; without it the optimum is not unique"),
        ("PLN_TILT_MAX", "planner.limits.tilt", "deg", 2.0, 30.0,
         "tilt the plan may ask for", _DEGREE),
        ("PLN_AZ_MAX", "planner.limits.vertical", "m/s^2", 0.2, 6.0,
         "vertical acceleration the plan may ask for"),
        ("PLN_YAW_MAX", "planner.limits.yaw_acc", "rad/s^2", 0.01, 1.0,
         "yaw acceleration the plan may ask for"),
        ("PLN_JNT_MAX", "planner.limits.joint_acc", "rad/s^2", 0.5, 50.0,
         "joint acceleration the plan may ask for"),
        ("PLN_JNT_SLACK", "planner.joint_slack", "", 0.0, 1e5, "price of softening a joint limit"),
        ("PLN_UPS_DIST", "upset_distance", "m", 0.02, 1.0,
         "farther than this off the plan, plan from the measurement"),
        ("PLN_UPS_YAW", "upset_yaw", "rad", 0.05, 3.0, "the same for yaw"),
    ],
    "Barriers": [
        *_barrier("WALL", "planner.walls", "walls and points"),
        *_barrier("SPH", "planner.workspace", "workspace sphere"),
        ("BAR_SLACK", "planner.barrier_slack", "", 0.0, 1e5, "price of softening a barrier"),
        ("SUR_DISTURB", "surroundings.disturbance", "m/s^2", 0.0, 3.0,
         "disturbance on an axis that the analysis reckons with"),
        ("SUR_HOLD", "surroundings.disturbance_hold", "s", 0.01, 2.0,
         "how long a random disturbance keeps its value"),
        ("SUR_ACC_TGT", "surroundings.target_acceleration", "m/s^2", 0.0, 3.0,
         "acceleration of the reference that the analysis reckons with"),
        ("SUR_V_TAN", "surroundings.tangential_speed", "m/s", 0.0, 3.0,
         "speed along the sphere's surface that the analysis reckons with"),
        ("SUR_HANGING", "surroundings.hanging", "m", 0.0, 0.3,
         "how far the end-effector hangs below the base"),
    ],
    "Other controllers": [
        ("HC_TIGHTEN", "planner.tightening", "m", 0.0, 0.5,
         "hc: kept in addition to the safe set"),
        ("SC_W_WALL", f"{_SOFT}.wall", "", 0.001, 1000.0,
         "sc: w_4 of eq 29, in the denominator as printed"),
        ("SC_W_WALL_N", f"{_SOFT}.wall_terminal", "", 0.001, 1000.0,
         "the same at the last node, w_s4"),
        ("SC_W_SPH", f"{_SOFT}.workspace", "", 0.0, 1000.0, "sc: w_5 of eq 30"),
        ("SC_W_SPH_N", f"{_SOFT}.workspace_terminal", "", 0.0, 1000.0,
         "the same at the last node, w_s5"),
        ("SC_W_CENTRE", f"{_SOFT}.centring", "", 0.0, 10000.0,
         "naive with centring: weight of the distance to the sphere's centre"),
    ],
    "Takeoff and landing": [
        ("MIS_TAKEOFF_ALT", "limits.takeoff_climb", "m", 0.3, 10.0,
         "climb of a takeoff that names no height"),
        ("TKO_CLIMB_MAX", "limits.takeoff_climb_most", "m", 1.0, 150.0,
         "climb of a takeoff at most"),
        ("TKO_WAIT_T", "limits.takeoff_wait_us", "s", 1.0, 300.0,
         "a takeoff commanded before arming is forgotten after this long", _IN_MICROSECONDS),
        ("TKO_SPEED", "limits.climb_speed", "m/s", 0.05, 1.5, "speed of a takeoff"),
        ("LND_SPEED", "limits.land_speed", "m/s", 0.05, 0.6, "speed of a landing"),
        ("LND_HEIGHT", "limits.landed_height", "m", 0.02, 0.25,
         "lower than this above standing it may have landed"),
        ("LND_AIRBORNE", "limits.airborne_height", "m", 0.25, 1.0,
         "higher than this above standing it flies"),
        ("LND_V_STILL", "limits.landed_speed", "m/s", 0.01, 0.3,
         "slower than this it may have landed"),
        ("LND_T_STILL", "limits.landed_time_us", "s", 0.1, 5.0,
         "how long it must be low and slow to have landed", _IN_MICROSECONDS),
        ("LND_IDLE_THR", "limits.idle_thrust", "N", 0.0, 4.0,
         "thrust of a rotor while armed on the ground"),
    ],
    "Steering": [
        ("STR_CRUISE", "steering.cruise_speed", "m/s", 0.1, 3.0, "speed on the way to a place"),
        ("STR_V_MAX", "steering.speed", "m/s", 0.1, 3.0, "speed that can be asked for"),
        ("STR_ACC_MAX", "steering.acceleration", "m/s^2", 0.2, 2.5,
         "acceleration of a steered reference"),
        ("STR_YAW_RATE", "steering.yaw_rate", "rad/s", 0.05, 1.0, "turn rate at most"),
        ("STR_YAW_ACC", "steering.yaw_acceleration", "rad/s^2", 0.01, 0.5,
         "yaw acceleration of a steered reference"),
        ("STR_JNT_RATE", "steering.joint_speed", "rad/s", 0.05, 3.0,
         "speed of joints that are moved by command"),
        ("STR_LEASH", "steering.leash", "m", 0.1, 0.6,
         "how far a steered reference runs ahead of the vehicle"),
        ("RTL_RETURN_ALT", "limits.return_height", "m", 0.5, 50.0,
         "height above home on the way back"),
        ("RTL_DESCEND_ALT", "limits.return_descent", "m", 0.5, 50.0,
         "height above home at which a return waits before it lands"),
        ("RTL_LAND_DELAY", "limits.return_wait", "s", -1.0, 300.0,
         "how long it waits there; negative: it stays"),
    ],
    "Failsafes": [
        ("COM_OF_LOSS_T", "limits.setpoint_timeout_us", "s", 0.1, 5.0,
         "offboard ends after this long without a set-point", _IN_MICROSECONDS),
        ("COM_OBL_RC_ACT", "limits.setpoint_loss_action", "", 3.0, 5.0,
         "what then"),
        ("COM_DL_LOSS_T", "limits.station_timeout_us", "s", 3.0, 300.0,
         "the ground station is lost after this long without its heartbeat", _IN_MICROSECONDS),
        ("NAV_DLL_ACT", "limits.station_loss_action", "", 0.0, 3.0,
         "what then, in takeoff, hold, orbit and offboard; other modes go on"),
        ("BAT_LOW_THR", "limits.battery_low", "norm", 0.12, 0.5, "the battery is low below this"),
        ("BAT_CRIT_THR", "limits.battery_critical", "norm", 0.06, 0.3,
         "the battery is critical below this; the vehicle cannot be armed"),
        ("BAT_EMERGEN_THR", "limits.battery_emergency", "norm", 0.03, 0.2,
         "the battery is nearly empty below this"),
        ("COM_LOW_BAT_ACT", "limits.low_battery_action", "", 0.0, 3.0,
         "what is done about a battery that runs low in flight"),
    ],
    "Log": [
        ("LOG_PROFILE", "log_profile", "", 0.0, 1.0,
         "what flight.ulg holds, from the next start on"),
    ],
    "Missions": [
        ("MSN_SPEED", "limits.mission_speed", "m/s", 0.01, 1.0,
         "speed of a mission that names none"),
        ("MSN_TURN_RATE", "limits.mission_turn_rate", "rad/s", 0.01, 1.0,
         "turn rate of a mission at most"),
        ("MSN_TURN_ACC", "limits.mission_turn_acceleration", "rad/s^2", 0.005, 0.1,
         "turn acceleration of a mission at most"),
        ("FNC_CLEARANCE", "limits.fence_clearance", "m", 0.0, 2.0,
         "kept from the walls of a fence uploaded from now on"),
    ],
}  # fmt: skip

_CHOICES: Final[dict[str, Choices]] = {
    "LOG_PROFILE": (
        (0, "Sensors and actuators every tick, the rest at 50 Hz"),
        (1, "Everything every tick"),
    ),
    "COM_OBL_RC_ACT": ((3, "Return"), (4, "Land"), (5, "Hold")),
    "NAV_DLL_ACT": ((0, "Disabled"), (1, "Hold"), (2, "Return"), (3, "Land")),
    "COM_LOW_BAT_ACT": (
        (0, "Warning"),
        (2, "Land when critical"),
        (3, "Return when critical, land when nearly empty"),
    ),
}

# Numbers of FlightConfig that are no parameters, by the beginning of their path, and why.
NO_PARAMETERS: Final[dict[str, str]] = {
    "battery.": "describes the vehicle",
    "origin.": "given at start: single precision is metres off in a latitude",
    "airframe.": "describes the vehicle; scales its actuators and telemetry, which must not change",
    "planner.horizon": "size of the program, which is laid out once",
    "planner.period_us": "the planner's grid, counted in ticks everywhere",
    "planner.sqp_iterations": "bounds the time of a planning cycle, which is budgeted",
    "planner.walls.skipped_nodes": "size of the program",
    "planner.workspace.skipped_nodes": "size of the program",
    "planner.hard_skipped_nodes": "size of the program",
    "tick_period_us": "the loop's grid, given by the simulator link",
    "plan_delay_ticks": "part of the grid: when answers take effect",
    "catch_up_ticks": "bounds the work of one tick",
}


def _parameter(group: str, row: _Row) -> Parameter:
    name, path, unit, least, most, meaning = row[:6]
    scale = row[6] if len(row) == 7 else 1.0
    choices = _CHOICES.get(name, ())
    return Parameter(name, path, unit, least, most, meaning, group, scale, choices)


# In the order of their index on the wire, which is that of their names: clients sort so too.
PARAMETERS: Final[tuple[Parameter, ...]] = tuple(
    sorted(
        (_parameter(group, row) for group, rows in _ROWS.items() for row in rows),
        key=lambda parameter: parameter.name,
    )
)
BY_NAME: Final[dict[str, Parameter]] = {parameter.name: parameter for parameter in PARAMETERS}
GROUPS: Final[tuple[str, ...]] = tuple(_ROWS)
