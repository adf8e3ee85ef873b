"""What programs beside a ground station need, each stated from its own source or wire.

Where a ground station probes for much that a vehicle may lack, these programs end or wait for ever
without one thing. So each row is what must be *accepted*.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

import pytest

from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.parameters.param_type import field_of, value_of
from fsw.link.files.vehicle_files import MARK
from messages import dialect as d
from tests.conversations.connected import PARAMETER_FILE, Connected, Message, connected
from tests.conversations.table import Must, Turn, ack, play
from tests.parameters_on_the_wire import LISTED

EARLIER = bytes(range(256)) * 40
ONBOARD_CONTROLLER = 18  # MAV_TYPE

# mavros of ROS 2, of ROS 1, of another system; MAVSDK on a companion; those of the vehicle.
COMPANIONS = [(1, 191), (1, 240), (2, 191), (1, 195), (1, 1), (1, 25)]


@pytest.fixture
def vehicle(tmp_path: Path) -> Iterator[Connected]:
    for name, content in (("earlier", EARLIER), ("present", b"not yet")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "flight.ulg").write_bytes(content)
        (tmp_path / name / MARK).write_bytes(bytes(PARAMETER_FILE))
    with connected(tmp_path / "present", flight_config(body="points")) as vehicle:
        yield vehicle


def command(number: int, *params: float, to: tuple[int, int] = (1, 1)) -> Message:
    padded = (*params, *(0.0,) * (7 - len(params)))
    return d.MAVLink_command_long_message(*to, number, 0, *padded)


def setting(name: str, field: float, type_: int) -> Message:
    return d.MAVLink_param_set_message(1, 1, name.encode(), field, type_)


def reading(name: str) -> Message:
    return d.MAVLink_param_request_read_message(1, 1, name.encode(), -1)


@pytest.mark.drawn(2)
@pytest.mark.parametrize("who", COMPANIONS, ids=lambda who: f"{who[0]}-{who[1]}")
def test_mavros_starts_whatever_its_identity(vehicle: Connected, who: tuple[int, int]) -> None:
    """Its plugins: version, home, time, lists of each kind, a rate, a bool, parameters."""
    vehicle.become(*who, ONBOARD_CONTROLLER)
    vehicle.run(2.5)
    for_me = {"target_system": who[0], "target_component": who[1]}
    lists = [
        Turn(
            f"list of kind {kind}",
            lambda _, kind=kind: d.MAVLink_mission_request_list_message(1, 1, kind),
            (Must("MISSION_COUNT", {"mission_type": kind, **for_me}),),
        )
        for kind in (0, 1, 2)
    ]
    play(vehicle, (
        Turn("capabilities", lambda _: command(520, 1.0), (ack(520), Must("AUTOPILOT_VERSION", {
            "capabilities": lambda bits: bits & 16 and not bits & 131072,  # integers are bytewise
        }))),
        Turn("capabilities of everybody", lambda _: command(520, 1.0, to=(0, 0)), (ack(520),)),
        Turn("home", lambda _: command(410), (ack(410), Must("HOME_POSITION", {}))),
        Turn("time", lambda _: d.MAVLink_timesync_message(0, 1_234_567_890),
             (Must("TIMESYNC", {"ts1": 1_234_567_890, "tc1": lambda t: t > 0}),)),
        Turn("system time", lambda _: d.MAVLink_system_time_message(1_750_000_000_000_000, 0)),
        *lists,
        Turn("rate", lambda _: command(511, 30.0, 20_000.0), (ack(511),)),
        Turn("a bool is a UINT8",
             lambda _: setting("SYS_FAILURE_EN", struct.unpack("<f", b"\1\0\0\0")[0], 1),
             (Must("PARAM_VALUE", {"param_id": "SYS_FAILURE_EN", "param_type": 6,
                                   "param_value": field_of(1)[0]}),)),
    ))  # fmt: skip
    assert [m for m in vehicle.heard if m.get_type() == "COMMAND_ACK"]
    assert all(
        (m.target_system, m.target_component) == who
        for m in vehicle.heard
        if m.get_type() == "COMMAND_ACK"
    )
    begin = len(vehicle.heard)
    vehicle.send(d.MAVLink_param_request_list_message(1, 1))
    vehicle.run(1.5)
    values = [m for m in vehicle.heard[begin:] if m.get_type() == "PARAM_VALUE"]
    read = {m.param_id: value_of(m.param_value, m.param_type) for m in values}
    assert read.pop("_HASH_CHECK") is not None
    assert read == LISTED | {"SYS_FAILURE_EN": 1, "PLN_BODY": 0}
    counts = vehicle.links.links[0].as_json()
    assert (counts["echoes_dropped"], counts["for_others"]) == (0, 0)


@pytest.mark.drawn(1)
@pytest.mark.parametrize(
    ("name", "value"), [("COM_OBL_RC_ACT", 4), ("NAV_DLL_ACT", 0), ("COM_RCL_EXCEPT", 4)]
)
def test_mavsdk_finds_an_integer_where_px4_has_one(
    vehicle: Connected, name: str, value: int
) -> None:
    """`get_param_int` ends with WRONG_TYPE where the vehicle's type is another one."""
    vehicle.become(245, 190, 6)
    vehicle.run(2.5)

    def held(number: int) -> Must:
        field, type_ = field_of(number)
        assert type_ == 6
        return Must(
            "PARAM_VALUE", {"param_id": name, "param_type": type_, "param_value": field}, 0.5
        )

    default = LISTED[name]
    assert isinstance(default, int)
    play(vehicle, (
        Turn("get_param_int", lambda _: reading(name), (held(default),)),
        Turn("set_param_int", lambda _: setting(name, *field_of(value)), (held(value),)),
        Turn("get_param_int again", lambda _: reading(name), (held(value),)),
    ))  # fmt: skip


@pytest.mark.drawn(2)
@pytest.mark.parametrize(
    ("name", "value"),
    [("COM_RCL_EXCEPT", 7), ("COM_OBL_RC_ACT", 4), ("COM_OF_LOSS_T", 2.0), ("COM_RC_IN_MODE", 1)],
)
def test_mavpilot_verifies_what_it_writes(vehicle: Connected, name: str, value: float) -> None:
    """It sends a write and a read at once, and takes the first value that comes for the answer."""
    vehicle.become(255, 0, 6)
    vehicle.run(2.5)
    vehicle.send(setting(name, *field_of(value)))
    vehicle.send(reading(name))
    first = vehicle.run(1.0, lambda m: m.get_type() == "PARAM_VALUE" and m.param_id == name)
    assert first is not None
    assert value_of(first.param_value, first.param_type) == value


def test_dronekit_gets_its_fix(vehicle: Connected) -> None:
    """`wait_ready()` waits for `gps_0`, and `is_armable` for a fix above 1."""
    vehicle.become(255, 0, 6)
    must = Must("GPS_RAW_INT", {"fix_type": lambda fix: fix >= 3, "lat": lambda lat: lat != 0}, 3.0)
    play(vehicle, (Turn("wait", lambda _: (), (must,)),))


def ftp(opcode: int, path: str, offset: int, number: int, size: int | None = None) -> Message:
    data = path.encode()
    head = struct.pack("<HBBBBBxI", number, 0, opcode, size or len(data), 0, 0, offset)
    payload = (head + data).ljust(251, b"\0")
    return d.MAVLink_file_transfer_protocol_message(0, 1, 1, list(payload))


def listed(vehicle: Connected, path: str) -> list[str]:
    """Its listing: entries are counted, until the answer is no more."""
    found: list[str] = []
    for number in range(1, 50):
        vehicle.send(ftp(d.MAV_FTP_OPCODE_LISTDIRECTORY, path, len(found), number))
        answer = vehicle.run(0.5, lambda m: m.get_type() == "FILE_TRANSFER_PROTOCOL")
        assert answer is not None
        payload = bytes(answer.payload)
        if payload[3] != d.MAV_FTP_OPCODE_ACK:
            return found
        found += payload[12 : 12 + payload[4]].decode("ascii").strip("\0").split("\0")
    raise AssertionError("a listing without an end")


@pytest.mark.parametrize("folder", ["/log", "/fs/microsd/log"])
def test_autopilot_tools_finds_the_newest_log_by_its_date(vehicle: Connected, folder: str) -> None:
    """In simulation it looks in /log, else on the card; it asks for 4 bytes a piece."""
    vehicle.become(255, 0, 6)
    vehicle.run(2.5)
    files = {
        f"{day[1:]} {name[1:].split(chr(9))[0]}": f"{folder}/{day[1:]}/{name[1:].split(chr(9))[0]}"
        for day in listed(vehicle, folder)
        for name in listed(vehicle, f"{folder}/{day[1:]}")
    }
    dates = sorted(files, key=lambda one: datetime.strptime(one[:-4], "%Y-%m-%d %H_%M_%S"))
    assert len(dates) == 2
    vehicle.send(ftp(d.MAV_FTP_OPCODE_OPENFILERO, files[dates[-1]], 0, 0))
    assert vehicle.run(0.5, lambda m: m.get_type() == "FILE_TRANSFER_PROTOCOL").payload[3] == 128
    vehicle.send(ftp(d.MAV_FTP_OPCODE_BURSTREADFILE, "", 0, 2, size=4))
    piece = vehicle.run(0.5, lambda m: m.get_type() == "FILE_TRANSFER_PROTOCOL")
    assert bytes(piece.payload[12 : 12 + piece.payload[4]]) in (b"not yet", EARLIER[:239])


def test_px4_s_answers_about_storage_and_log_streams(vehicle: Connected) -> None:
    vehicle.become(255, 190, 6)
    vehicle.run(2.5)
    play(vehicle, (
        Turn("save", lambda _: command(245, 1.0), (ack(245),)),
        Turn("load", lambda _: command(245, 0.0), (ack(245),)),
        Turn("change", lambda _: setting("NAV_DLL_ACT", *field_of(3)),
             (Must("PARAM_VALUE", {"param_value": field_of(3)[0]}),)),
        Turn("reset", lambda _: command(245, 2.0), (ack(245), Must("PARAM_VALUE", {
            "param_id": "NAV_DLL_ACT", "param_value": field_of(2)[0],
        }))),
        Turn("log", lambda _: command(2510), (ack(2510),)),
        Turn("no log", lambda _: command(2511), (ack(2511),)),
    ))  # fmt: skip
