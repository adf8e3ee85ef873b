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

from fsw.parameters.registry import BY_NAME, Choices
from fsw.vehicle.battery import BatteryModel

GROUP: Final = "Read only"


@dataclass(frozen=True, slots=True)
class Fact:
    """One read-only parameter."""

    name: str  # at most 16 characters
    meaning: str
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


def _all(names: str, meaning: str, value: float = 0.0, choices: Choices = ()) -> list[Fact]:
    return [Fact(name, meaning, value, choices=choices) for name in names.split()]


def _repeat(name: str, ours: str) -> Fact:
    return Fact(name, f"PX4's name of {ours}", unit=BY_NAME[ours].unit, repeats=ours)


_FACTS: Final = [
    Fact(
        "SYS_AUTOSTART", "airframe, by PX4's number: a quadrotor; it has none with an arm", 4001.0
    ),
    Fact("SYS_AUTOCONFIG", "nothing is to be configured"),
    Fact("SYS_HAS_MAG", "there is no magnetometer: the heading is measured from outside"),
    Fact("MAV_SYS_ID", "MAVLink system of the vehicle", 1.0),
    *_all(
        "CAL_GYRO0_ID CAL_ACC0_ID CAL_MAG0_ID",
        "not zero: this sensor needs no calibration",
        1.0,
    ),
    *_all("CAL_MAG1_ID CAL_MAG2_ID", "there is no such sensor"),
    *_all("CAL_MAG0_ROT CAL_MAG1_ROT CAL_MAG2_ROT", "there is no such sensor", -1.0),
    Fact("SENS_BOARD_ROT", "sensors lie along the body's axes"),
    Fact("SENS_DPRES_OFF", "there is no airspeed sensor"),
    Fact("COM_RC_IN_MODE", "there is no radio control", 1.0, choices=((1, "No radio"),)),
    Fact("COM_RC_LOSS_T", "there is no radio control to lose", unit="s"),
    Fact("NAV_RCL_ACT", "there is no radio control to lose", choices=((0, "None: no radio"),)),
    # Zero would be read as a set-up that is missing.
    *_all(
        "RC_MAP_ROLL RC_MAP_PITCH RC_MAP_YAW RC_MAP_THROTTLE",
        "there is no radio control",
        -1.0,
        ((-1, "No radio"),),
    ),
    *_all(
        "RC_MAP_FLAPS RC_MAP_AUX1 RC_MAP_AUX2 RC_MAP_PARAM1 RC_MAP_PARAM2 RC_MAP_PARAM3 "
        "RC_MAP_FLTMODE RC_MAP_ARM_SW RC_MAP_GEAR_SW RC_MAP_KILL_SW RC_MAP_LOITER_SW "
        "RC_MAP_OFFB_SW RC_MAP_RETURN_SW",
        "there is no radio control",
        choices=_NO_RADIO,
    ),
    *_all(
        "RC_ARMSWITCH_TH RC_GEAR_TH RC_KILLSWITCH_TH RC_LOITER_TH RC_OFFB_TH RC_RETURN_TH",
        "there is no radio control",
    ),
    *_all(
        "COM_FLTMODE1 COM_FLTMODE2 COM_FLTMODE3 COM_FLTMODE4 COM_FLTMODE5 COM_FLTMODE6",
        "there is no radio control to choose a mode with",
        -1.0,
        ((-1, "Unassigned: no radio"),),
    ),
    Fact("BAT1_SOURCE", "the battery is a model, without a sensor", choices=((0, "Model"),)),
    Fact("BAT1_N_CELLS", "cells in series", float(_CELLS)),
    Fact("BAT1_V_CHARGED", "full cell", _BATTERY.full / _CELLS, "V"),
    Fact("BAT1_V_EMPTY", "empty cell", _BATTERY.empty / _CELLS, "V"),
    Fact("BAT1_V_LOAD_DROP", "not used: the drop is that of the inner resistance", unit="V"),
    Fact("BAT1_CAPACITY", "capacity", 1000.0 * _BATTERY.capacity, "mAh"),
    Fact(
        "GF_ACTION",
        "a fence is a barrier that the vehicle does not cross; there is no breach to act upon",
        choices=((0, "None: the barriers keep the vehicle inside"),),
    ),
    Fact("GF_MAX_HOR_DIST", "no fence but the uploaded one", unit="m"),
    Fact("GF_MAX_VER_DIST", "no fence but the uploaded one", unit="m"),
    Fact("CP_DIST", "obstacles are announced, not sensed", -1.0, "m"),
    Fact("COM_OBS_AVOID", "there is no companion that avoids obstacles"),
    Fact("SDLOG_MODE", "what is logged when", 2.0, choices=((2, "From start to end"),)),
    _repeat("MPC_XY_VEL_MAX", "STR_V_MAX"),
    _repeat("MPC_LAND_SPEED", "LND_SPEED"),
    _repeat("COM_DISARM_LAND", "LND_T_STILL"),
    *_all(
        "MC_ROLLRATE_K MC_ROLLRATE_I MC_ROLLRATE_D MC_PITCHRATE_K MC_PITCHRATE_I MC_PITCHRATE_D "
        "MC_YAWRATE_K MC_YAWRATE_I MC_ROLL_P MC_PITCH_P MC_YAW_P MPC_XY_P MPC_Z_P "
        "MPC_XY_VEL_P_ACC MPC_XY_VEL_I_ACC MPC_XY_VEL_D_ACC "
        "MPC_Z_VEL_P_ACC MPC_Z_VEL_I_ACC MPC_Z_VEL_D_ACC",
        "not in use: the loops here are tuned by TRK_ and PID_",
    ),
]

FACTS: Final[tuple[Fact, ...]] = tuple(sorted(_FACTS, key=lambda fact: fact.name))
FACT_BY_NAME: Final[dict[str, Fact]] = {fact.name: fact for fact in FACTS}
REPEATED: Final[dict[str, str]] = {fact.repeats: fact.name for fact in FACTS if fact.repeats}
"""Name of the fact that repeats a parameter, by the parameter's."""
