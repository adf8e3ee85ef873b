"""Every action of QGroundControl 4.4 and 5, over MAVLink 2 and after a fall-back to MAVLink 1.

The tables say what has to be accepted, not only that something is answered: a ground station's
button that is refused is a button that does not work.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.parameters.param_type import value_of
from fsw.autopilot.signals import MissionState, Mode
from fsw.link.files.vehicle_files import MARK
from fsw.link.wire.identity import AVAILABLE_MODES
from messages import dialect as d
from tests.conversations.connected import PARAMETER_FILE, Connected, connected
from tests.conversations.qgroundcontrol import (
    QGC_4_4,
    QGC_5,
    REQUIRED,
    Client,
    connect,
    fence,
    fly_plan,
    guided,
    items,
    rally,
    take_off,
)
from tests.conversations.table import Message, Must, play
from tests.fsw.zones import of_kind, walls_of

EARLIER = bytes(range(256)) * 400  # more than one piece of 512 messages
TYPES = {0: items, 1: fence, 2: rally}

clients = pytest.mark.parametrize("client", [QGC_4_4, QGC_5], ids=lambda c: c.name)
either_way = pytest.mark.parametrize(
    ("client", "version"),
    [
        pytest.param(QGC_5, 2, id="5-mavlink2"),
        pytest.param(QGC_4_4, 1, id="4.4-mavlink1", marks=pytest.mark.long),
        pytest.param(QGC_5, 1, id="5-mavlink1", marks=pytest.mark.long),
        pytest.param(QGC_4_4, 2, id="4.4-mavlink2", marks=pytest.mark.long),
    ],
)
versions = pytest.mark.parametrize("version", [2, 1], ids=["mavlink2", "mavlink1"])


@pytest.fixture
def vehicle(tmp_path: Path) -> Iterator[Connected]:
    for name, content in (("earlier", EARLIER), ("present", b"not yet")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "flight.ulg").write_bytes(content)
        (tmp_path / name / MARK).write_bytes(bytes(PARAMETER_FILE))
    config = flight_config(body="points")
    # A quicker vehicle: ten metres of climb are a test's longest wait.
    limits = replace(config.limits, climb_speed=1.5, land_speed=0.6)
    with connected(tmp_path / "present", replace(config, limits=limits)) as vehicle:
        vehicle.run(2.5)
        yield vehicle


def speaks(vehicle: Connected, version: int) -> Connected:
    """Connected, and fallen back if need be."""
    vehicle.version_1 = version == 1
    play(vehicle, connect(len(AVAILABLE_MODES), newest=version == 2))
    return vehicle


@pytest.mark.drawn(2)
@clients
@versions
def test_it_connects_without_a_text_and_is_answered_in_its_version(
    vehicle: Connected, client: Client, version: int
) -> None:
    speaks(vehicle, version)
    vehicle.markers.clear()
    vehicle.run(0.5)
    assert vehicle.markers == {0xFD if version == 2 else 0xFE}
    assert not [m.text for m in vehicle.heard if m.get_type() == "STATUSTEXT"]
    names = {m.custom_mode: m for m in vehicle.heard if m.get_type() == "AVAILABLE_MODES"}
    if version == 2:
        # 4.4 looks its buttons up by name, after renaming what has a standard mode; 5 by number.
        renamed = {1: "Position", 2: "Orbit", 4: "Altitude", 5: "Safe Recovery", 6: "Mission",
                   7: "Land", 8: "Takeoff"}  # fmt: skip
        shown = {n: renamed.get(m.standard_mode, m.mode_name) for n, m in names.items()}
        wanted = {0x03040000: "Hold", 0x04040000: "Mission", 0x05040000: "Return",
                  0x06040000: "Land", 0x02040000: "Takeoff"}  # fmt: skip
        assert {n: shown[n] for n in wanted} == wanted
        assert len(set(shown.values())) == len(shown)


@versions
def test_no_parameter_that_it_insists_on_is_missing_and_none_asks_for_set_up(
    vehicle: Connected, version: int
) -> None:
    speaks(vehicle, version)
    vehicle.send(d.MAVLink_param_request_list_message(1, 0))
    vehicle.run(1.0)
    values = {m.param_id: m for m in vehicle.heard if m.get_type() == "PARAM_VALUE"}
    count = next(iter(values.values())).param_count
    assert {m.param_index for m in values.values() if m.param_index != 65535} == set(range(count))
    assert set(REQUIRED) - set(values) == set()
    read = {n: value_of(m.param_value, m.param_type) for n, m in values.items()}
    wrong = [n for n, holds in REQUIRED.items() if holds and not holds(read[n])]
    assert wrong == []


@either_way
def test_every_button_of_the_fly_view_works(
    vehicle: Connected, client: Client, version: int
) -> None:
    speaks(vehicle, version)
    play(vehicle, take_off(client))
    turns = guided(client)
    if version == 1:  # ids beyond 255 do not exist there
        turns = tuple(
            replace(turn, must=tuple(m for m in turn.must if m.type != "ORBIT_EXECUTION_STATUS"))
            for turn in turns
        )
    play(vehicle, turns)
    height = -vehicle.flight.sim.truth().p_WB[2]
    assert height < 0.4, "it stands"


def upload(vehicle: Connected, kind: int, given: list[Message]) -> Message:
    """Offer a list, and give each item that is asked for; the acknowledgement."""
    vehicle.send(d.MAVLink_mission_count_message(1, 1, len(given), kind))
    wanted = ("MISSION_REQUEST_INT", "MISSION_ACK")
    while True:
        answer = vehicle.run(1.5, lambda m: m.get_type() in wanted and m.mission_type == kind)
        assert answer is not None, "the vehicle fell silent, and QGroundControl gives up"
        if answer.get_type() == "MISSION_ACK":
            return answer
        vehicle.send(given[answer.seq])


def download(vehicle: Connected, kind: int) -> list[Message]:
    vehicle.send(d.MAVLink_mission_request_list_message(1, 1, kind))
    count = vehicle.run(1.5, lambda m: m.get_type() == "MISSION_COUNT")
    found = []
    for seq in range(count.count):
        vehicle.send(d.MAVLink_mission_request_int_message(1, 1, seq, kind))
        item = vehicle.run(0.25, lambda m: m.get_type() == "MISSION_ITEM_INT")
        assert item is not None
        found.append(item)
    vehicle.send(d.MAVLink_mission_ack_message(1, 1, 0, kind))
    return found


@pytest.mark.drawn(1)
@either_way
def test_a_plan_is_uploaded_started_paused_continued_and_flown_to_its_end(
    vehicle: Connected, client: Client, version: int
) -> None:
    speaks(vehicle, version)
    given = items(vehicle)
    assert upload(vehicle, 0, given).type == 0
    assert [_content(m) for m in download(vehicle, 0)] == [_content(m) for m in given]
    play(vehicle, fly_plan(client))
    assert vehicle.flight.snapshot.mission.state is MissionState.COMPLETE
    x, y, _ = vehicle.flight.sim.truth().p_WB
    assert (abs(x) < 0.4, abs(y) < 0.4) == (True, True), "home"


def _content(item: Message) -> tuple[object, ...]:
    numbers = struct.pack("<5f", item.param1, item.param2, item.param3, item.param4, item.z)
    return (item.seq, item.command, item.frame, item.x, item.y, item.autocontinue, numbers)


@pytest.mark.parametrize("kind", [1, 2], ids=["fence", "rally"])
def test_fences_of_either_sense_and_rally_points_go_up_and_come_down(
    vehicle: Connected, kind: int
) -> None:
    """Only over MAVLink 2: in MAVLink 1 a list has no type, and QGroundControl offers neither."""
    speaks(vehicle, 2)
    given = TYPES[kind](vehicle)
    acknowledged = upload(vehicle, kind, given)
    assert acknowledged.type == 0
    assert [_content(m) for m in download(vehicle, kind)] == [_content(m) for m in given]
    current = vehicle.run(1.5, lambda m: m.get_type() == "MISSION_CURRENT")
    identity = current.fence_id if kind == 1 else current.rally_points_id
    assert identity == acknowledged.opaque_id != 0
    if kind == 1:
        safe_set = vehicle.flight.state.mission.safe_set
        assert len(walls_of(safe_set)) == 4
        assert len(of_kind(safe_set, "vertical cylinder")) >= 2
    assert upload(vehicle, kind, []).type == 0
    vehicle.send(d.MAVLink_mission_clear_all_message(1, 1, kind))
    assert vehicle.run(1.5, lambda m: m.get_type() == "MISSION_ACK").type == 0


@versions
def test_a_refused_parameter_comes_back_at_once_with_the_reason(
    vehicle: Connected, version: int
) -> None:
    speaks(vehicle, version)
    for name, sent, held in ((b"COM_RC_LOSS_T", 4.0, 0.0), (b"STR_CRUISE", 9.0, 1.0)):
        vehicle.send(d.MAVLink_param_set_message(1, 1, name, sent, 9))
        value = vehicle.run(1.0, lambda m: m.get_type() == "PARAM_VALUE")
        assert (value.param_id, value.param_value) == (name.decode(), held)
    vehicle.send(d.MAVLink_param_set_message(1, 1, b"STR_CRUISE", 0.75, 9))
    value = vehicle.run(1.0, lambda m: m.get_type() == "PARAM_VALUE")
    assert value.param_value == 0.75


@pytest.mark.drawn(2)
@clients
@versions
def test_the_log_page_lists_downloads_and_erases(
    vehicle: Connected, client: Client, version: int, tmp_path: Path
) -> None:
    speaks(vehicle, version)

    def entries() -> dict[int, int]:
        before = len(vehicle.heard)
        vehicle.send(d.MAVLink_log_request_list_message(1, 1, 0, client.last_log))
        vehicle.run(0.5)
        return {m.id: m.size for m in vehicle.heard[before:] if m.get_type() == "LOG_ENTRY"}

    assert entries() == {0: len(EARLIER), 1: 7}
    begin, log = vehicle.t_s, bytearray(len(EARLIER))
    piece = 512 * 90
    for offset in range(0, len(EARLIER), piece):
        count = min(piece, len(EARLIER) - offset)
        vehicle.send(d.MAVLink_log_request_data_message(1, 1, 0, offset, count))
        missing = set(range(offset, offset + count, 90))

        def whole(m: Message, missing: set[int] = missing) -> bool:
            if m.get_type() == "LOG_DATA":
                log[m.ofs : m.ofs + m.count] = bytes(m.data[: m.count])
                missing.discard(m.ofs)
            return not missing

        assert vehicle.run(0.5, whole) is not None, "QGroundControl would ask again"
    assert bytes(log) == EARLIER
    # In lockstep the vehicle hears the next request up to 10 ms later, in real time at once.
    assert len(EARLIER) / (vehicle.t_s - begin) > 1.5e6, "bytes a second of the vehicle's time"
    vehicle.send(d.MAVLink_log_erase_message(1, 1))
    assert entries() == {0: 7}, "it asks for the list at once"
    reported = Must("STATUSTEXT", {"text": lambda t: "1 log erased" in t, "severity": 6})
    assert any(reported.met_by(m) for m in vehicle.heard) or vehicle.run(2.0, reported.met_by)
    assert not (tmp_path / "earlier" / "flight.ulg").exists()


def test_a_signed_link_accepts_nothing_of_mavlink_1(vehicle: Connected) -> None:
    speaks(vehicle, 2)
    link = vehicle.links.links[0]
    link.signing.set_up(bytes(range(32)), 0)
    before = len(vehicle.heard)
    vehicle.version_1 = True
    vehicle.send(d.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0))
    vehicle.run(1.0)
    assert not [m for m in vehicle.heard[before:] if m.get_type() == "COMMAND_ACK"]
    assert link.signing.counters.unsigned > 1, "the command, and heartbeats"


@pytest.mark.requirement("REQ-SAFE-4")
def test_a_fence_through_the_rotors_is_denied_and_stops_no_rotor(tmp_path: Path) -> None:
    """GF_ACTION 4 ends the flight outside a fence: it must not be the answer to an upload."""
    config = flight_config()
    limits = replace(config.limits, climb_speed=1.5, fence_action=4)
    (tmp_path / "present").mkdir()
    with connected(tmp_path / "present", replace(config, limits=limits)) as vehicle:
        vehicle.run(2.5)
        speaks(vehicle, 2)
        play(vehicle, take_off(QGC_5))
        north, east, _ = vehicle.flight.snapshot.estimate.p_WB

        def around(ahead: float) -> list[Message]:
            corners = ((ahead, 5.0), (ahead, -5.0), (-5.0, -5.0), (-5.0, 5.0))
            return [
                d.MAVLink_mission_item_int_message(
                    *(1, 1, seq, 1, 5001, 0, 1, 4.0, 0, 0, 0),
                    *(round(1e4 * (north + x)), round(1e4 * (east + y)), 0.0, 1),
                )
                for seq, (x, y) in enumerate(corners)
            ]

        assert upload(vehicle, 1, around(0.15)).type == 14
        vehicle.run(1.0)
        assert vehicle.flight.state.safety.fence_us < 0
        assert vehicle.flight.mode is Mode.HOLD
        assert upload(vehicle, 1, around(2.0)).type == 0
        vehicle.run(1.0)
        assert vehicle.flight.state.safety.fence_us < 0
