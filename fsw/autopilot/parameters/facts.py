"""Parameters that cannot be changed: what PX4's ground stations insist on, answered truthfully.

QGroundControl reads PX4's parameters to decide which set-up is missing, and complains about each
that is not there. Where Pandion has the function, the parameter is a real one (``registry.py``).
Where it has not, the value says so: there is no radio, the sensors need no calibration, PX4's gains
are not in use. A few are no facts but other names: PX4's for a parameter of ours.

As everywhere, a value that is an ``int`` is an INT32, and each has PX4's type.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.parameters.registry import BY_NAME, Choices

GROUP: Final = "Read only"


@dataclass(frozen=True, slots=True)
class Fact:
    """One read-only parameter, or PX4's name of one of ours."""

    name: str  # at most 16 characters
    label: str  # what a ground station writes beside the value
    meaning: str  # why it is so
    value: float | Callable[[Airframe], float] = 0  # of every vehicle, or of one
    unit: str = ""
    choices: Choices = ()
    repeats: str = ""  # the parameter of ours whose value it has

    def read(self, values: Mapping[str, float], airframe: Airframe) -> float:
        """Its value beside those of the parameters, of a vehicle."""
        if self.repeats:
            return values[self.repeats]
        return self.value(airframe) if callable(self.value) else self.value


_NO_RADIO: Final[Choices] = ((0, "No radio"),)


def _cells(airframe: Airframe) -> int:
    """Lithium-polymer cells that have the battery's voltage when they are full."""
    return round(airframe.battery.full / 4.2)


def _all(
    labels: Mapping[str, str], meaning: str, value: float = 0, choices: Choices = ()
) -> list[Fact]:
    """Facts of one meaning, by name and label."""
    return [Fact(name, label, meaning, value, "", choices) for name, label in labels.items()]


def _repeat(name: str, ours: str) -> Fact:
    label = BY_NAME[ours].meaning
    return Fact(name, label, f"the value of {ours}", unit=BY_NAME[ours].unit, repeats=ours)


def _breakers(checks: Mapping[str, int]) -> list[Fact]:
    """Circuit breakers of PX4's checks that there is nothing to check for, by the open value."""
    return [
        Fact(f"CBRK_{name}", "Circuit breaker of a check", "there is no such check", number)
        for name, number in checks.items()
    ]


_ANY_POSITION: Final = "a position is needed, whichever sensor measures it"
_NO_RC: Final = "there is no radio control"
_NO_SENSOR: Final = "there is no such sensor"
_LOOPS: Final = "not in use: the loops of this vehicle are tuned by TRK_ and PID_"
_FACTS: Final = [
    Fact("SYS_AUTOSTART", "Airframe",
         "a multirotor, by PX4's number; PX4 has no number of one with an arm", 4001),
    Fact("SYS_AUTOCONFIG", "Reset to the airframe's defaults", "nothing is to be reset"),
    Fact("SYS_HAS_MAG", "Magnetometers", "none: the heading is measured from outside"),
    Fact("MAV_SYS_ID", "MAVLink system ID", "of the vehicle", 1),
    Fact("MAV_COMP_ID", "MAVLink component ID", "of the autopilot", 1),
    Fact("MAV_TYPE", "MAVLink type", "of the airframe", lambda v: v.mav_type),
    Fact("COM_ARM_WO_GPS", "Arming without GNSS", _ANY_POSITION, 1, choices=((1, "Allowed"),)),
    Fact("COM_RC_OVERRIDE", "Takeover by sticks", _NO_RC),
    Fact("COM_DISARM_PRFLT", "Time to disarm before takeoff", "it stays armed", -1.0, "s"),
    *_breakers({"USB_CHK": 197848, "SUPPLY_CHK": 894281, "IO_SAFETY": 22027}),
    *_all({"CAL_GYRO0_ID": "Gyro", "CAL_ACC0_ID": "Accelerometer", "CAL_MAG0_ID": "Heading sensor"},
          "not zero: it needs no calibration", 1),
    *_all({"CAL_MAG1_ID": "Second magnetometer", "CAL_MAG2_ID": "Third magnetometer"}, _NO_SENSOR),
    *_all({f"CAL_MAG{k}_ROT": f"Rotation of magnetometer {k}" for k in range(3)}, _NO_SENSOR, -1),
    Fact("SENS_BOARD_ROT", "Rotation of the flight controller", "along the body's axes"),
    Fact("SENS_DPRES_OFF", "Offset of the airspeed sensor", _NO_SENSOR, 0.0),
    Fact("COM_RC_LOSS_T", "Radio loss timeout", _NO_RC, 0.0, "s"),
    Fact("NAV_RCL_ACT", "Radio loss failsafe", _NO_RC, choices=((0, "Disabled: no radio"),)),
    # Zero would be read as a set-up that is missing.
    *_all({f"RC_MAP_{axis.upper()}": f"{axis} channel"
           for axis in ("Roll", "Pitch", "Yaw", "Throttle")}, _NO_RC, -1, ((-1, "No radio"),)),
    *_all({"RC_MAP_FLAPS": "Flaps channel", "RC_MAP_FLTMODE": "Mode channel",
           **{f"RC_MAP_AUX{k}": f"Auxiliary channel {k}" for k in (1, 2)},
           **{f"RC_MAP_PARAM{k}": f"Tuning channel {k}" for k in (1, 2, 3)},
           "RC_MAP_ARM_SW": "Arm switch", "RC_MAP_GEAR_SW": "Landing gear switch",
           "RC_MAP_KILL_SW": "Kill switch", "RC_MAP_LOITER_SW": "Hold switch",
           "RC_MAP_OFFB_SW": "Offboard switch", "RC_MAP_RETURN_SW": "Return switch"},
          _NO_RC, choices=_NO_RADIO),
    *_all({"RC_ARMSWITCH_TH": "Arm switch threshold", "RC_GEAR_TH": "Landing gear switch threshold",
           "RC_KILLSWITCH_TH": "Kill switch threshold", "RC_LOITER_TH": "Hold switch threshold",
           "RC_OFFB_TH": "Offboard switch threshold", "RC_RETURN_TH": "Return switch threshold"},
          _NO_RC, 0.0),
    *_all({f"COM_FLTMODE{k}": f"Flight mode {k}" for k in range(1, 7)},
          "there is no radio control to choose a mode with", -1, ((-1, "Unassigned: no radio"),)),
    Fact("BAT1_SOURCE", "Battery source", "without a sensor", choices=((0, "Battery model"),)),
    Fact("BAT1_N_CELLS", "Cells in series", "of the model", _cells),
    Fact("BAT1_V_CHARGED", "Full cell voltage", "of the model",
         lambda v: v.battery.full / _cells(v), "V"),
    Fact("BAT1_V_EMPTY", "Empty cell voltage", "of the model",
         lambda v: v.battery.empty / _cells(v), "V"),
    Fact("BAT1_V_LOAD_DROP", "Voltage drop of a cell under load",
         "not in use: the model has an inner resistance", 0.0, "V"),
    Fact("BAT1_CAPACITY", "Battery capacity", "of the model",
         lambda v: 1000.0 * v.battery.capacity, "mAh"),
    Fact("GF_MAX_HOR_DIST", "Geofence radius", "no fence but the uploaded one", 0.0, "m"),
    Fact("GF_MAX_VER_DIST", "Geofence height", "no fence but the uploaded one", 0.0, "m"),
    Fact("CP_DIST", "Collision prevention distance", "obstacles are announced, not sensed", -1.0,
         "m"),
    Fact("COM_OBS_AVOID", "Obstacle avoidance by a companion", "there is none"),
    Fact("SDLOG_MODE", "Logging", "see LOG_PROFILE", 2, choices=((2, "From start to end"),)),
    _repeat("MPC_XY_VEL_MAX", "STR_V_MAX"),
    _repeat("MPC_LAND_SPEED", "LND_SPEED"),
    _repeat("COM_DISARM_LAND", "LND_T_STILL"),
    _repeat("MPC_TKO_SPEED", "TKO_SPEED"),
    _repeat("MPC_XY_CRUISE", "STR_CRUISE"),
    *_all({**{f"MC_{a}RATE_{g}": f"{a.title()} rate {g}" for a in ("ROLL", "PITCH") for g in "KID"},
           **{f"MC_YAWRATE_{g}": f"Yaw rate {g}" for g in "KI"},
           **{f"MC_{a}_P": f"{a.title()} P" for a in ("ROLL", "PITCH", "YAW")},
           **{f"MPC_{a}_P": f"Position {a} P" for a in ("XY", "Z")},
           **{f"MPC_{a}_VEL_{g}_ACC": f"Velocity {a} {g}" for a in ("XY", "Z") for g in "PID"}},
          _LOOPS, 0.0),
]  # fmt: skip

FACTS: Final[tuple[Fact, ...]] = tuple(sorted(_FACTS, key=lambda fact: fact.name))
FACT_BY_NAME: Final[dict[str, Fact]] = {fact.name: fact for fact in FACTS}
ALIASES: Final[dict[str, str]] = {fact.name: fact.repeats for fact in FACTS if fact.repeats}
"""Parameter of ours that PX4 has under another name, by that name."""
REPEATED: Final[dict[str, str]] = {ours: name for name, ours in ALIASES.items()}
"""The opposite: PX4's name, by that of ours."""
