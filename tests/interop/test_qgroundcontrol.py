"""How fast QGroundControl's questions are answered, by the processes that fly: within 1 s.

What has to be answered to each, and accepted, is in ``tests/conversations``. The tests of
this file are one connection, in their order.
"""

from __future__ import annotations

import json
import re
import statistics
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from typing import Any

import pytest

from fsw.autopilot.parameters.metadata import metadata_crc, parameter_document
from fsw.autopilot.parameters.param_type import value_of
from fsw.autopilot.parameters.registry import PARAMETERS
from fsw.link.events import event_document
from fsw.storage.parameter_file import load
from messages import dialect
from tests.interop.station import PATIENCE_S, Station
from tests.interop.vehicle import REAL_TIME, Vehicle, parameter_file
from tests.parameters_on_the_wire import listed

PACING = REAL_TIME
DENIED, UNSUPPORTED = 2, 3
HEADER = struct.Struct("<HBBBBBxI")  # of FTP
OPEN, BURST, TERMINATE, LIST, CREATE = 4, 15, 1, 3, 6


@pytest.fixture(scope="module")
def station(vehicle: Vehicle) -> Iterator[Station]:
    station = Station(vehicle.gcs_port)
    yield station
    station.close()


def ftp(
    station: Station, opcode: int, data: bytes = b"", session: int = 0, offset: int = 0
) -> tuple[Any, ...]:
    """(opcode, session, data) of the first answer."""
    payload = HEADER.pack(1, session, opcode, len(data) or 239, 0, 0, offset) + data

    def send() -> None:
        station.mav.file_transfer_protocol_send(0, 1, 1, payload.ljust(251, b"\0"))

    answer = station.ask(
        f"FTP {opcode} {data!r}", send, lambda m: m.get_type() == "FILE_TRANSFER_PROTOCOL"
    )
    packed = bytes(answer.payload)
    _, session, reported, size, *_ = HEADER.unpack_from(packed)
    return reported, session, packed[HEADER.size : HEADER.size + size]


def download(station: Station, path: str) -> bytes:
    """A file, burst after burst."""
    _, session, size = ftp(station, OPEN, path.encode())
    content, total = b"", int.from_bytes(size, "little")
    while len(content) < total:
        _, _, first = ftp(station, BURST, session=session, offset=len(content))
        content += first
        for message in station.messages(PATIENCE_S):
            if len(content) >= total:
                break
            if message.get_type() == "FILE_TRANSFER_PROTOCOL":
                packed = bytes(message.payload)
                content += packed[HEADER.size : HEADER.size + packed[4]]
                if packed[6]:  # the burst is over
                    break
    ftp(station, TERMINATE, session=session)
    return content


def test_what_it_is(station: Station) -> None:
    version = station.request(dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
    assert version.capabilities & dialect.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    assert version.capabilities & dialect.MAV_PROTOCOL_CAPABILITY_MAVLINK2


def test_its_modes(station: Station) -> None:
    first = station.request(dialect.MAVLINK_MSG_ID_AVAILABLE_MODES, 1)
    modes = [
        station.request(dialect.MAVLINK_MSG_ID_AVAILABLE_MODES, number)
        for number in range(1, first.number_modes + 1)
    ]
    assert [mode.mode_index for mode in modes] == list(range(1, len(modes) + 1))
    assert len({mode.custom_mode for mode in modes}) == len(modes)
    current = station.request(dialect.MAVLINK_MSG_ID_CURRENT_MODE)
    assert current.custom_mode in {mode.custom_mode for mode in modes}


def test_its_component_metadata(station: Station) -> None:
    metadata = station.request(dialect.MAVLINK_MSG_ID_COMPONENT_METADATA)
    scheme, _, path = metadata.uri.partition("://")
    assert scheme == "mftp"
    parameters, events = json.loads(download(station, path))["metadataTypes"]
    assert download(station, parameters["uri"].partition("://")[2]) == parameter_document()
    document = download(station, events["uri"].partition("://")[2])
    assert document == event_document()
    assert (events["type"], events["fileCrc"]) == (4, metadata_crc(document))


@pytest.mark.long
def test_the_arming_checks_as_events_and_those_that_were_lost(station: Station) -> None:
    newest = station.hear(lambda m: m.get_type() == "CURRENT_EVENT_SEQUENCE", 5.0).sequence
    assert station.command(401) == 0
    first = station.hear(lambda m: m.get_type() == "EVENT")
    assert (first.sequence, first.id) == (newest + 1, 1 << 24 | 1), "the summary of the checks"
    station.mav.request_event_send(1, 1, first.sequence, first.sequence)
    again = station.hear(lambda m: m.get_type() == "EVENT" and m.sequence == first.sequence)
    assert bytes(again.arguments) == bytes(first.arguments)
    lost = (first.sequence + 1000) & 0xFFFF
    station.mav.request_event_send(1, 1, lost, lost)
    error = station.hear(lambda m: m.get_type() == "RESPONSE_EVENT_ERROR")
    assert (error.sequence, error.target_system, error.target_component) == (lost, 255, 190)


def test_its_parameters(vehicle: Vehicle, station: Station) -> None:
    begin = time.monotonic()
    station.mav.param_request_list_send(1, 1)
    found: dict[str, float] = {}
    for message in station.messages(5.0):
        if message.get_type() == "PARAM_VALUE":
            if message.param_index != 65535:  # the checksum of all
                value = value_of(message.param_value, message.param_type)
                assert value is not None
                found[message.param_id] = value
            if len(found) == message.param_count:
                break
    station.took["parameters"] = time.monotonic() - begin
    kept = load(parameter_file(vehicle.out.parent)).values  # of the tests before these
    assert found == pytest.approx(listed(kept), rel=1e-6)
    assert station.took["parameters"] < PATIENCE_S


def test_a_parameter_that_is_not_there(station: Station) -> None:
    answer = station.ask(
        "unknown parameter",
        lambda: station.mav.param_request_read_send(1, 1, b"NO_SUCH_PARAM", -1),
        lambda m: m.get_type() in ("PARAM_ERROR", "PARAM_VALUE") and "NO_SUCH" in m.param_id,
    )
    assert answer.get_type() == "PARAM_ERROR"


@pytest.mark.parametrize(("kind", "what"), [(0, "mission"), (1, "fence"), (2, "rally points")])
def test_its_mission_fence_and_rally_points(station: Station, kind: int, what: str) -> None:
    """A vehicle that has just started has none, and says so."""
    count = station.ask(
        what,
        lambda: station.mav.mission_request_list_send(1, 1, kind),
        lambda m: m.get_type() == "MISSION_COUNT" and m.mission_type == kind,
    )
    assert (count.count, count.target_system, count.target_component) == (0, 255, 190)


@pytest.mark.parametrize(
    "message_id", [259, 280, 410, 395], ids=["camera", "gimbal", "events", "information"]
)
def test_what_it_has_not_is_refused(station: Station, message_id: int) -> None:
    assert station.command(512, message_id) in (DENIED, UNSUPPORTED)


def test_its_logs(station: Station) -> None:
    station.ask(
        "logs",
        lambda: station.mav.log_request_list_send(1, 1, 0, 0xFFFF),
        lambda m: m.get_type() == "LOG_ENTRY" and m.id == m.last_log_num,
    )
    reported, _, data = ftp(station, CREATE, b"/new")
    assert (reported, data) == (129, b"\x09")


@pytest.mark.parametrize("integers", [False, True], ids=["COMMAND_LONG", "COMMAND_INT"])
def test_a_command_is_acknowledged_within_50_ms(station: Station, integers: bool) -> None:
    unknown = [31010, 2500, 41, 42, 43, 200, 205, 202, 203, 204]
    for command in unknown:
        assert station.command(command, 1.0, integers=integers) == UNSUPPORTED
    form = "INT" if integers else "LONG"
    took = [seconds for what, seconds in station.took.items() if f" {form} (1.0" in what]
    assert len(took) == len(unknown)
    assert statistics.median(took) < 0.05, took


def test_everything_was_answered_in_time(station: Station) -> None:
    slowest = sorted(station.took.items(), key=lambda item: -item[1])
    print("\n".join(f"{1e3 * seconds:7.1f} ms  {what}" for what, seconds in slowest))
    assert len(slowest) >= 40
    assert slowest[0][1] < PATIENCE_S


@pytest.mark.drawn(1)
@pytest.mark.parametrize(
    ("tool", "options", "shows"),
    [
        ("mavlogdump", ["--types=HEARTBEAT"], r"HEARTBEAT \{type : 2, autopilot : 12"),
        ("mavlogdump", ["--types=LOCAL_POSITION_NED"], r"LOCAL_POSITION_NED \{time_boot_ms"),
        ("mavparms", [], rf"(?m)^{PARAMETERS[0].name} "),
        ("mavflightmodes", [], r"LOITER"),
        ("mavsummarize", [], r"Total time"),
    ],
)
def test_pymavlink_s_tools_read_the_telemetry_log(
    vehicle: Vehicle, station: Station, tool: str, options: list[str], shows: str
) -> None:
    log = str(vehicle.out / "flight.tlog")
    reported = subprocess.run(
        [sys.executable, "-m", f"pymavlink.tools.{tool}", *options, log],
        env={"MAVLINK20": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert re.search(shows, reported.stdout), reported.stdout[-500:] + reported.stderr
