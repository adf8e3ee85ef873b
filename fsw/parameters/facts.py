"""Parameters that cannot be changed: what PX4's ground stations insist on, answered truthfully.

QGroundControl reads PX4's parameters to decide which set-up is missing, and complains about each
that is not there. Where Pandion has the function, the parameter is a real one (``registry.py``).
Where it has not, the value says so: there is no radio, the sensors need no calibration, PX4's gains
are not in use. A few repeat a parameter of ours under the name that PX4 has for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from fsw.model.battery import BatteryModel
from fsw.parameters.registry import BY_NAME, Choices

GROUP: Final = "Read only"


@dataclass(frozen=True, slots=True)
class Fact:
    """One read-only parameter."""

    name: str  # at most 16 characters
    label: str  # what a ground station writes beside the value
    meaning: str  # why it is so
    value: float = 0.0
    unit: str = ""
    choices: Choices = ()
    repeats: str = ""  # the parameter of ours whose value it has

    def read(self, values: Mapping[str, float]) -> float:
        """Its value beside those of the parameters."""
        return values[self.repeats] if self.repeats else self.value


_NO_RADIO: Final[Choices] = ((0, "No radio"),)
_BATTERY: Final = BatteryModel()
_CELLS: Final = 4


def _all(
    labels: Mapping[str, str], meaning: str, value: float = 0.0, choices: Choices = ()
) -> list[Fact]:
    """Facts of one meaning, by name and label."""
    return [Fact(name, label, meaning, value, "", choices) for name, label in labels.items()]


def _repeat(name: str, ours: str) -> Fact:
    label = BY_NAME[ours].meaning
    return Fact(name, label, f"the value of {ours}", unit=BY_NAME[ours].unit, repeats=ours)


_NO_RC: Final = "there is no radio control"
_NO_SENSOR: Final = "there is no such sensor"
_LOOPS: Final = "not in use: the loops of this vehicle are tuned by TRK_ and PID_"
_FACTS: Final = [
    Fact(
        "SYS_AUTOSTART",
        "Airframe",
        "a quadrotor, by PX4's number; PX4 has no number of one with an arm",
        4001.0,
    ),
    Fact("SYS_AUTOCONFIG", "Reset to the airframe's defaults", "nothing is to be reset"),
    Fact("SYS_HAS_MAG", "Magnetometers", "none: the heading is measured from outside"),
    Fact("MAV_SYS_ID", "MAVLink system ID", "of the vehicle", 1.0),
    *_all(
        {"CAL_GYRO0_ID": "Gyro", "CAL_ACC0_ID": "Accelerometer", "CAL_MAG0_ID": "Heading sensor"},
        "not zero: it needs no calibration",
        1.0,
    ),
    *_all({"CAL_MAG1_ID": "Second magnetometer", "CAL_MAG2_ID": "Third magnetometer"}, _NO_SENSOR),
    *_all({f"CAL_MAG{k}_ROT": f"Rotation of magnetometer {k}" for k in range(3)}, _NO_SENSOR, -1.0),
    Fact("SENS_BOARD_ROT", "Rotation of the flight controller", "along the body's axes"),
    Fact("SENS_DPRES_OFF", "Offset of the airspeed sensor", _NO_SENSOR),
    Fact("COM_RC_IN_MODE", "Manual control input", _NO_RC, 1.0, choices=((1, "No radio"),)),
    Fact("COM_RC_LOSS_T", "Radio loss timeout", _NO_RC, unit="s"),
    Fact("NAV_RCL_ACT", "Radio loss failsafe", _NO_RC, choices=((0, "Disabled: no radio"),)),
    # Zero would be read as a set-up that is missing.
    *_all(
        {
            "RC_MAP_ROLL": "Roll channel",
            "RC_MAP_PITCH": "Pitch channel",
            "RC_MAP_YAW": "Yaw channel",
            "RC_MAP_THROTTLE": "Throttle channel",
        },
        _NO_RC,
        -1.0,
        ((-1, "No radio"),),
    ),
    *_all(
        {
            "RC_MAP_FLAPS": "Flaps channel",
            "RC_MAP_AUX1": "Auxiliary channel 1",
            "RC_MAP_AUX2": "Auxiliary channel 2",
            "RC_MAP_PARAM1": "Tuning channel 1",
            "RC_MAP_PARAM2": "Tuning channel 2",
            "RC_MAP_PARAM3": "Tuning channel 3",
            "RC_MAP_FLTMODE": "Mode channel",
            "RC_MAP_ARM_SW": "Arm switch",
            "RC_MAP_GEAR_SW": "Landing gear switch",
            "RC_MAP_KILL_SW": "Kill switch",
            "RC_MAP_LOITER_SW": "Hold switch",
            "RC_MAP_OFFB_SW": "Offboard switch",
            "RC_MAP_RETURN_SW": "Return switch",
        },
        _NO_RC,
        choices=_NO_RADIO,
    ),
    *_all(
        {
            "RC_ARMSWITCH_TH": "Arm switch threshold",
            "RC_GEAR_TH": "Landing gear switch threshold",
            "RC_KILLSWITCH_TH": "Kill switch threshold",
            "RC_LOITER_TH": "Hold switch threshold",
            "RC_OFFB_TH": "Offboard switch threshold",
            "RC_RETURN_TH": "Return switch threshold",
        },
        _NO_RC,
    ),
    *_all(
        {f"COM_FLTMODE{k}": f"Flight mode {k}" for k in range(1, 7)},
        "there is no radio control to choose a mode with",
        -1.0,
        ((-1, "Unassigned: no radio"),),
    ),
    Fact("BAT1_SOURCE", "Battery source", "without a sensor", choices=((0, "Battery model"),)),
    Fact("BAT1_N_CELLS", "Cells in series", "of the model", float(_CELLS)),
    Fact("BAT1_V_CHARGED", "Full cell voltage", "of the model", _BATTERY.full / _CELLS, "V"),
    Fact("BAT1_V_EMPTY", "Empty cell voltage", "of the model", _BATTERY.empty / _CELLS, "V"),
    Fact(
        "BAT1_V_LOAD_DROP",
        "Voltage drop of a cell under load",
        "not in use: the model has an inner resistance",
        unit="V",
    ),
    Fact("BAT1_CAPACITY", "Battery capacity", "of the model", 1000.0 * _BATTERY.capacity, "mAh"),
    Fact("GF_MAX_HOR_DIST", "Geofence radius", "no fence but the uploaded one", unit="m"),
    Fact("GF_MAX_VER_DIST", "Geofence height", "no fence but the uploaded one", unit="m"),
    Fact(
        "CP_DIST", "Collision prevention distance", "obstacles are announced, not sensed", -1.0, "m"
    ),
    Fact("COM_OBS_AVOID", "Obstacle avoidance by a companion", "there is none"),
    Fact("SDLOG_MODE", "Logging", "see LOG_PROFILE", 2.0, choices=((2, "From start to end"),)),
    _repeat("MPC_XY_VEL_MAX", "STR_V_MAX"),
    _repeat("MPC_LAND_SPEED", "LND_SPEED"),
    _repeat("COM_DISARM_LAND", "LND_T_STILL"),
    *_all(
        {
            **{
                f"MC_{a}RATE_{g}": f"{a.title()} rate {g}" for a in ("ROLL", "PITCH") for g in "KID"
            },
            **{f"MC_YAWRATE_{g}": f"Yaw rate {g}" for g in "KI"},
            **{f"MC_{a}_P": f"{a.title()} P" for a in ("ROLL", "PITCH", "YAW")},
            **{f"MPC_{a}_P": f"Position {a} P" for a in ("XY", "Z")},
            **{f"MPC_{a}_VEL_{g}_ACC": f"Velocity {a} {g}" for a in ("XY", "Z") for g in "PID"},
        },
        _LOOPS,
    ),
]

FACTS: Final[tuple[Fact, ...]] = tuple(sorted(_FACTS, key=lambda fact: fact.name))
FACT_BY_NAME: Final[dict[str, Fact]] = {fact.name: fact for fact in FACTS}
REPEATED: Final[dict[str, str]] = {fact.repeats: fact.name for fact in FACTS if fact.repeats}
"""Name of the fact that repeats a parameter, by the parameter's."""
