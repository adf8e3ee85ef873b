"""What QGroundControl says, from its sources: 4.4 and 5, each row with what must come back.

Both send the same messages in the same order when they connect; they differ in heights, headings
and in how they set the current mission item. Where a row says that a command is accepted, refusing
it is a failure of a button.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from messages import dialect as d
from tests.conversations.connected import Connected, Message
from tests.conversations.table import Must, Turn, ack, latest, mode

NAN = math.nan
TAKEOFF, HOLD, MISSION, RETURN, LAND, ORBIT = (
    main << 16 | sub << 24 for main, sub in ((4, 2), (4, 3), (4, 4), (4, 5), (4, 6), (3, 1))
)
ACCEPTED, DENIED, UNSUPPORTED = 0, 2, 3


@dataclass(frozen=True)
class Client:
    """What one version does differently."""

    name: str
    lowest_takeoff_m: float
    orbit_yaw: float
    last_log: int  # of LOG_REQUEST_LIST
    sets_item_by_command: bool


QGC_4_4 = Client("4.4", 10.0, 0.0, 49, sets_item_by_command=False)
QGC_5 = Client("5", 3.048, 5.0, 0xFFFF, sets_item_by_command=True)

# Parameters without which a page says "Parameters are missing from firmware", or asks for set-up;
# with the condition under which it does not.
ANY = None
REQUIRED: dict[str, Any] = {
    "SYS_AUTOSTART": lambda v: v != 0,
    "CAL_GYRO0_ID": lambda v: v != 0,
    "CAL_ACC0_ID": lambda v: v != 0,
    "CAL_MAG0_ID": lambda v: v != 0,
    "COM_RC_IN_MODE": lambda v: v == 1,
    "BAT1_N_CELLS": lambda v: v != 0,
    "BAT1_V_EMPTY": lambda v: v != 0,
    "BAT1_V_CHARGED": lambda v: v != 0,
    **dict.fromkeys(
        """
        SYS_AUTOCONFIG MAV_SYS_ID CAL_MAG1_ID CAL_MAG2_ID CAL_MAG0_ROT CAL_MAG1_ROT CAL_MAG2_ROT
        SENS_BOARD_ROT SENS_DPRES_OFF RC_MAP_ROLL RC_MAP_PITCH RC_MAP_YAW RC_MAP_THROTTLE
        RC_MAP_FLAPS RC_MAP_AUX1 RC_MAP_AUX2 RC_MAP_PARAM1 RC_MAP_PARAM2 RC_MAP_PARAM3
        RC_MAP_FLTMODE COM_FLTMODE1 COM_FLTMODE2 COM_FLTMODE3 COM_FLTMODE4 COM_FLTMODE5
        COM_FLTMODE6 RC_MAP_ARM_SW RC_MAP_GEAR_SW RC_MAP_KILL_SW RC_MAP_LOITER_SW RC_MAP_OFFB_SW
        RC_MAP_RETURN_SW RC_ARMSWITCH_TH RC_GEAR_TH RC_KILLSWITCH_TH RC_LOITER_TH RC_OFFB_TH
        RC_RETURN_TH BAT1_SOURCE BAT1_V_LOAD_DROP RTL_RETURN_ALT RTL_DESCEND_ALT RTL_LAND_DELAY
        COM_RC_LOSS_T COM_LOW_BAT_ACT NAV_RCL_ACT NAV_DLL_ACT COM_DL_LOSS_T BAT_LOW_THR
        BAT_CRIT_THR BAT_EMERGEN_THR SDLOG_MODE GF_ACTION GF_MAX_HOR_DIST GF_MAX_VER_DIST
        COM_DISARM_LAND CP_DIST COM_OBS_AVOID MPC_LAND_SPEED MPC_XY_VEL_MAX MC_ROLLRATE_K
        MC_ROLLRATE_I MC_ROLLRATE_D MC_PITCHRATE_K MC_PITCHRATE_I MC_PITCHRATE_D MC_YAWRATE_K
        MC_YAWRATE_I MC_ROLL_P MC_PITCH_P MC_YAW_P MPC_XY_VEL_P_ACC MPC_XY_VEL_I_ACC
        MPC_XY_VEL_D_ACC MPC_Z_VEL_P_ACC MPC_Z_VEL_I_ACC MPC_Z_VEL_D_ACC MPC_XY_P MPC_Z_P
        """.split(),  # noqa: SIM905
        ANY,
    ),
}


def long(command: int, *params: float) -> Any:
    """COMMAND_LONG to component 1, what is left out is 0."""
    p = (*params, *(0.0,) * (7 - len(params)))
    return lambda _: d.MAVLink_command_long_message(1, 1, command, 0, *p)


def set_mode(custom_mode: int) -> Any:
    """SET_MODE: the heartbeat's base mode with the bit of custom modes."""

    def say(vehicle: Connected) -> Message:
        base = latest(vehicle, "HEARTBEAT").base_mode
        return d.MAVLink_set_mode_message(1, base & ~1 | 1, custom_mode)

    return say


def at(
    command: int, p: tuple[float, float, float, float], north: float, east: float, z: float
) -> Any:
    """COMMAND_INT in frame 0 at a place near home, which is where the map is; z above the sea."""

    def say(vehicle: Connected) -> Message:
        x, y = place(vehicle, north, east)
        return d.MAVLink_command_int_message(1, 1, 0, command, 0, 0, *p, x, y, z)

    return say


def place(vehicle: Connected, north: float, east: float) -> tuple[int, int]:
    """Degrees times 1e7 of a place near home [m]."""
    home = latest(vehicle, "HOME_POSITION")
    metres_a_degree = 111_195.0
    x = home.latitude + 1e7 * north / metres_a_degree
    y = home.longitude + 1e7 * east / metres_a_degree / math.cos(math.radians(1e-7 * home.latitude))
    return round(x), round(y)


def amsl(vehicle: Connected) -> float:
    """The altitude that is shown, above the sea [m]."""
    return float(latest(vehicle, "ALTITUDE").altitude_amsl)


def request(message_id: int, kind: str, which: float = 0.0, **fields: Any) -> Turn:
    """REQUEST_MESSAGE that must be accepted and followed by the message."""
    return Turn(
        f"request {kind} {which:g}",
        long(512, float(message_id), which),
        (ack(512), Must(kind, fields)),
    )


def connect(modes: int, *, newest: bool) -> tuple[Turn, ...]:
    """The start, in its order; a camera and a gimbal are looked for meanwhile."""
    version = {
        "flight_sw_version": lambda v: v >> 8 >= 0x010401 and v & 0xFF != 255,
        "capabilities": lambda c: all(c & 1 << bit for bit in (2, 3, 13, 14, 15)),
    }
    turns = [
        request(148, "AUTOPILOT_VERSION", **version),
        Turn("probe camera", long(512, 259.0), (ack(512, DENIED),)),
        request(300, "PROTOCOL_VERSION", max_version=lambda v: v >= 200),
        Turn("probe camera, older", long(521, 1.0), (ack(521, UNSUPPORTED),)),
    ]
    if newest:  # ids beyond 255, which MAVLink 1 has not
        turns += [
            request(435, "AVAILABLE_MODES", k, mode_index=k, number_modes=modes)
            for k in range(1, modes + 1)
        ]
        turns.append(request(397, "COMPONENT_METADATA", uri=lambda u: u.startswith("mftp://")))
    for _ in range(3):
        turns.append(Turn("probe gimbal", long(512, 280.0), (ack(512, DENIED),)))
    for kind in (0, 1, 2) if newest else (0,):
        turns.append(
            Turn(
                f"list of type {kind}",
                lambda _, kind=kind: d.MAVLink_mission_request_list_message(1, 1, kind),
                (Must("MISSION_COUNT", {"count": 0, "mission_type": kind}),),
            )
        )
    return tuple(turns)


def take_off(client: Client) -> tuple[Turn, ...]:
    """The slider at its lowest: take-off while disarmed, armed when that is accepted."""

    def say(vehicle: Connected) -> Message:
        height = client.lowest_takeoff_m + amsl(vehicle)
        p = (-1.0, 0.0, 0.0, NAN, NAN, NAN, height)
        return d.MAVLink_command_long_message(1, 1, 22, 0, *p)

    return (
        Turn("take-off before arming", say, (ack(22), mode(TAKEOFF, armed=False))),
        Turn("arm", long(400, 1.0), (ack(400), mode(TAKEOFF, armed=True))),
        Turn(
            "climb",
            lambda _: (),
            (
                Must("EXTENDED_SYS_STATE", {"landed_state": 3}),
                mode(HOLD, 20.0, armed=True),
                Must("EXTENDED_SYS_STATE", {"landed_state": 2}),
                Must(
                    "ALTITUDE",
                    {"altitude_relative": lambda h: abs(h - client.lowest_takeoff_m) < 0.3},
                    5.0,
                ),
            ),
        ),
    )


def guided(client: Client) -> tuple[Turn, ...]:
    """Every action of the Fly view, in the air."""

    def go_to(vehicle: Connected) -> Message:
        return at(192, (-1.0, 1.0, 0.0, NAN), 2.0, 1.0, amsl(vehicle))(vehicle)

    def higher(vehicle: Connected) -> Message:
        altitude = latest(vehicle, "ALTITUDE").altitude_relative + 1.0
        z = 1e-3 * latest(vehicle, "HOME_POSITION").altitude + altitude
        return d.MAVLink_command_long_message(1, 1, 192, 0, -1, 1, 0, NAN, NAN, NAN, z)

    def orbit(vehicle: Connected) -> Message:
        return at(34, (2.0, NAN, client.orbit_yaw, NAN), 2.0, 1.0, amsl(vehicle))(vehicle)

    nowhere = -(2**31)  # an integer of NaN, on the processors it runs on
    moved = {"x": lambda x: x > 1.7, "y": lambda y: y > 0.7}
    return (
        Turn("go to", go_to, (ack(192), Must("LOCAL_POSITION_NED", moved, 12.0))),
        Turn("change altitude", higher, (ack(192),)),
        Turn("change speed", long(178, 1.0, 0.5, -1.0, 0.0, NAN, NAN, NAN), (ack(178),)),
        Turn(
            "orbit",
            orbit,
            (
                ack(34),
                mode(ORBIT),
                Must("ORBIT_EXECUTION_STATUS", {"radius": 2.0}) if client.name else ack(34),
            ),
        ),
        Turn(
            "pause",
            long(192, -1.0, 1.0, 0.0, NAN, NAN, NAN, NAN),
            (ack(192), mode(HOLD, armed=True)),
        ),
        Turn("look at a place", at(195, (NAN, NAN, NAN, NAN), 6.0, 6.0, NAN), (ack(195),)),
        Turn(
            "look away",
            lambda _: d.MAVLink_command_int_message(
                1, 1, 0, 197, 0, 0, NAN, NAN, NAN, NAN, nowhere, nowhere, NAN
            ),
            (ack(197),),
        ),
        Turn("set heading", long(192, -1.0, 1.0, 0.0, 0.3, NAN, NAN, NAN), (ack(192),)),
        Turn("set home", long(179, 1.0), (ack(179), Must("HOME_POSITION", {}, 3.0))),
        Turn("tuning page", long(511, 31.0, 10_000.0), (ack(511),)),
        Turn("tuning page left", long(511, 31.0, 0.0), (ack(511),)),
        Turn("motors page", long(209, 1.0, 0.0, 10.0), (ack(209, DENIED),), no_text_below=0),
        Turn("actuators page", long(310, 0.1), (ack(310, DENIED),), no_text_below=0),
        Turn("return", set_mode(RETURN), (mode(RETURN, armed=True),)),
        Turn("hold from the menu", set_mode(HOLD), (mode(HOLD, armed=True),)),
        Turn(
            "land",
            set_mode(LAND),
            (mode(LAND, armed=True), mode(HOLD, 40.0, armed=False)),
        ),
    )


def items(vehicle: Connected) -> list[Message]:
    """A plan as the Plan view makes it: takeoff, way points, a region of interest, return."""
    rows = (
        (22, 3, (0.0, 0.0, 0.0, NAN), (0.0, 0.0), 2.0),
        (178, 2, (1.0, 5.0, -1.0, 0.0), None, 0.0),  # the default where it is ticked
        (195, 3, (0.0, 0.0, 0.0, 0.0), (3.0, 3.0), 0.0),
        (16, 3, (0.0, 0.0, 0.0, NAN), (1.5, 0.0), 2.0),
        (197, 2, (0.0, 0.0, 0.0, 0.0), None, 0.0),
        (16, 3, (0.0, 0.0, 0.0, NAN), (1.5, 1.0), 2.0),
        (20, 2, (0.0, 0.0, 0.0, 0.0), None, 0.0),
    )
    found = []
    for seq, (command, frame, p, where, z) in enumerate(rows):
        x, y = (0, 0) if where is None else place(vehicle, *where)
        found.append(
            d.MAVLink_mission_item_int_message(
                1, 1, seq, frame, command, int(seq == 0), 1, *p, x, y, z, 0
            )
        )
    return found


def fence(vehicle: Connected) -> list[Message]:
    """An inclusion and both exclusions, as the fence editor makes them."""
    corners = ((30.0, 30.0), (30.0, -30.0), (-30.0, -30.0), (-30.0, 30.0))
    excluded = ((8.0, 8.0), (12.0, 8.0), (12.0, 9.0), (8.0, 9.0))
    rows = [
        *((5001, 4.0, corner) for corner in corners),
        *((5002, 4.0, corner) for corner in excluded),
        (5004, 1.0, (-8.0, 8.0)),
    ]
    return [
        d.MAVLink_mission_item_int_message(
            1, 1, seq, 0, command, 0, 0, number, 0, 0, 0, *place(vehicle, *where), 0.0, 1
        )
        for seq, (command, number, where) in enumerate(rows)
    ]


def rally(vehicle: Connected) -> list[Message]:
    """One rally point."""
    x, y = place(vehicle, 1.0, -1.0)
    return [d.MAVLink_mission_item_int_message(1, 1, 0, 3, 5100, 0, 0, 0, 0, 0, 0, x, y, 5.0, 2)]


def fly_plan(client: Client) -> tuple[Turn, ...]:
    """The slider "Start Mission" on the ground, pause, another item, continue, and the end."""

    def item(vehicle: Connected) -> Message:
        if client.sets_item_by_command:
            return d.MAVLink_command_long_message(1, 1, 224, 0, 5, 0, 0, 0, 0, 0, 0)
        return d.MAVLink_mission_set_current_message(1, 1, 5)

    return (
        Turn("mission mode before arming", set_mode(MISSION), (mode(MISSION, armed=False),)),
        Turn("arm", long(400, 1.0), (ack(400), mode(MISSION, 1.5, armed=True))),
        Turn("first item", lambda _: (), (Must("MISSION_ITEM_REACHED", {"seq": 0}, 30.0),)),
        Turn(
            "pause",
            long(192, -1.0, 1.0, 0.0, NAN, NAN, NAN, NAN),
            (ack(192), mode(HOLD, armed=True)),
        ),
        Turn("another item", item, (Must("MISSION_CURRENT", {"seq": 5}),)),
        Turn("continue", set_mode(MISSION), (mode(MISSION, armed=True),)),
        Turn(
            "to the end",
            lambda _: (),
            (
                Must("MISSION_ITEM_REACHED", {"seq": 5}, 30.0),
                mode(RETURN, 10.0),
                mode(HOLD, 60.0, armed=False),
            ),
        ),
    )
