"""The dialect as peers know it: a change here is a change of the protocol."""

import re
import xml.etree.ElementTree as ET

from messages import dialect
from messages.generate import DEFINITION

# name: (id, payload length, CRC_EXTRA). A peer built with other numbers drops the frames silently,
# so none of these may change; a new message gets a new line.
PINNED = {
    "ARM_JOINT_STATE": (60200, 129, 222),
    "ARM_JOINT_SETPOINT": (60201, 107, 59),
    "END_EFFECTOR_TARGET": (60202, 61, 239),
    "BARRIER_MARGIN": (60203, 223, 183),
    "MPC_STATUS": (60204, 53, 216),
    "MPC_HORIZON": (60205, 237, 234),
    "LOOP_TIMING": (60206, 49, 31),
    "OBSTACLE_WALL": (60207, 28, 28),
    "WORKSPACE_SPHERE": (60208, 18, 197),
    "SETPOINT_STATUS": (60209, 25, 131),
    "OBSTACLE_POINT": (60210, 24, 254),
    "OBSTACLE_SHAPE": (60211, 118, 185),
    "JOINT_ENCODERS": (60212, 41, 156),
    "MPC_HORIZON_ARM": (60213, 222, 38),
    "FORCE_TORQUE": (60214, 32, 198),
    "TOOL_CONTACT": (60215, 45, 89),
    "PAYLOAD_STATUS": (60216, 13, 36),
}

# From pymavlink's development.xml and upstream.xml, as MAVLink's common.xml and QGroundControl have
# them. Extensions are in the length and not in CRC_EXTRA.
NEWER = {
    "MISSION_CURRENT": (42, 18, 28),
    "MISSION_COUNT": (44, 9, 221),
    "MISSION_ACK": (47, 8, 153),
    "PROTOCOL_VERSION": (300, 22, 217),
    "COMPONENT_METADATA": (397, 108, 182),
    "EVENT": (410, 53, 160),
    "CURRENT_EVENT_SEQUENCE": (411, 3, 106),
    "REQUEST_EVENT": (412, 6, 33),
    "RESPONSE_EVENT_ERROR": (413, 7, 77),
    "AVAILABLE_MODES": (435, 46, 134),
    "CURRENT_MODE": (436, 9, 193),
    "AVAILABLE_MODES_MONITOR": (437, 1, 30),
}

PINNED_ENUMS = {
    "PANDION_CONSTRAINT_KIND": ("NONE", "WALLS", "WORKSPACE", "OBSTACLES"),
    "PANDION_SETPOINT_KIND": ("NONE", "BODY", "END_EFFECTOR", "ATTITUDE", "JOINTS"),
    "PANDION_SOLVER_STATUS": (
        "UNKNOWN",
        "SOLVED",
        "ALMOST_SOLVED",
        "INFEASIBLE",
        "TIME_LIMIT",
        "NUMERICAL_ERROR",
        "INPUT_REFUSED",
    ),
    "PANDION_RATE_GROUP": ("INNER", "MPC"),
    "PANDION_SHAPE": (
        "HALF_SPACE",
        "BALL",
        "TARGET_SPHERE",
        "VERTICAL_CYLINDER",
        "CYLINDER",
        "BOX",
    ),
}


def test_every_private_message_keeps_its_id_length_and_crc_extra():
    common_ids = 60000
    private = {
        message.msgname: (message_id, message.unpacker.size, message.crc_extra)
        for message_id, message in dialect.mavlink_map.items()
        if message_id >= common_ids
    }
    assert private == PINNED


def test_newer_standard_messages_are_those_that_ground_stations_know():
    known = {
        name: (id_, dialect.mavlink_map[id_].unpacker.size, dialect.mavlink_map[id_].crc_extra)
        for name, (id_, _, _) in NEWER.items()
    }
    assert known == NEWER


def test_the_catalogue_shows_the_same_numbers():
    catalogue = DEFINITION.with_name("README.md").read_text()
    rows = re.findall(r"^\| ([A-Z_]+) \| (\d+) \| (\d+) \| (\d+) \|", catalogue, re.MULTILINE)
    assert {name: tuple(map(int, numbers)) for name, *numbers in rows} == PINNED


def test_every_private_enum_keeps_its_values():
    for enum, names in PINNED_ENUMS.items():
        values = {f"{enum}_{name}": value for value, name in enumerate(names)}
        assert {name: getattr(dialect, name) for name in values} == values


def test_the_private_ids_stay_inside_their_range():
    ids = [int(message.get("id")) for message in ET.parse(DEFINITION).iter("message")]
    assert ids
    assert all(60200 <= message_id <= 60299 for message_id in ids)


def test_the_dialect_contains_common():
    for name in ("HEARTBEAT", "COMMAND_LONG", "HIL_SENSOR", "HIL_ACTUATOR_CONTROLS", "ODOMETRY"):
        assert getattr(dialect, f"MAVLINK_MSG_ID_{name}") in dialect.mavlink_map


def test_the_module_speaks_protocol_2_without_any_environment_variable():
    assert dialect.WIRE_PROTOCOL_VERSION == "2.0"
    assert dialect.DIALECT == "pandion"


def test_fields_are_declared_in_wire_order_so_that_xml_and_wire_read_alike():
    for name, (message_id, _, _) in PINNED.items():
        message = dialect.mavlink_map[message_id]
        assert message.fieldnames == message.ordered_fieldnames, name


def test_every_field_with_a_dimension_states_its_unit():
    dimensionless = {
        *("joint_count", "count", "index", "margin_min_index", "horizon", "plan_id", "normal"),
        *("missed_deadlines", "fallbacks", "cost", "slack_max", "sqp_iterations"),
        *("solver_iterations", "ticks", "late_ticks", "skipped_ticks"),
        *("target_system", "target_component", "accepted", "refused", "numbers"),
        *("breaches", "departures", "interventions", "steps", "refusals", "friction", "set_id"),
        *("start", "inputs"),  # of several dimensions, each with its unit in the description
    }
    for message in ET.parse(DEFINITION).iter("message"):
        for field in message.iter("field"):
            known = field.get("units") or field.get("enum") or field.get("display")
            assert known or field.get("name") in dimensionless, field.get("name")
