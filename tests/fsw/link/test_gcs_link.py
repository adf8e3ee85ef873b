"""The ground link over real sockets: rates, peers, and what garbage does not do."""

from __future__ import annotations

import contextlib
import math
import random
import socket
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v10 import common as old_protocol

from fsw.autopilot.ports import LinkLosses
from fsw.autopilot.signals import BatteryState, CommandAck, Mode, Severity, StatusText
from fsw.link.bounded_memory import SentFrames
from fsw.link.files.log_service import LogService
from fsw.link.files.vehicle_files import FlightLogs
from fsw.link.peers import EXPIRY_US
from fsw.link.services.service import LinkService, TimeService
from fsw.link.telemetry.streams import AT_ONCE, STREAMS
from fsw.link.wire.outgoing import Outgoing
from messages import dialect
from messages import message_ids as ids
from messages.frames import Frame, FrameWriter, as_version_1, split
from tests.fsw.link.ground import Ground, ground_station, station_socket
from tests.fsw.link.snapshots import SNAPSHOT, outputs_at

HEARTBEAT = (0, 6, 8, 0, 4, 3)
MANUAL_CONTROL, MANUAL = 69, (0, 0, 500, 0, 0, 1, *(0,) * 10)
# mavros, that of ROS 1, MAVSDK on a companion computer, others, the vehicle's own, pymavlink's.
IDENTITIES = [(1, 191), (1, 240), (1, 195), (1, 192), (2, 191), (1, 1), (1, 25), (255, 0), (3, 1)]


@pytest.fixture
def ground() -> Iterator[Ground]:
    with ground_station() as ground:
        yield ground


def test_streams_leave_at_their_rates_in_sensor_time(ground: Ground) -> None:
    frames = ground.fly(2000)
    counts = Counter((frame.component_id, frame.message_id) for frame in frames)
    for stream in STREAMS:
        rows = sum(s.message_id == stream.message_id for s in STREAMS)
        extra = 1 if stream in AT_ONCE else 0  # the first mode is news
        found = counts[(stream.component, stream.message_id)] - extra
        assert abs(found - rows * 4 * stream.ground_hz) <= 1, stream
    assert len(ground.recorded) == len(frames)


def test_each_component_counts_its_own_sequence(ground: Ground) -> None:
    frames = ground.fly(200)
    for component in (1, 25):
        sequences = [frame.sequence for frame in frames if frame.component_id == component]
        assert sequences == [n % 256 for n in range(len(sequences))]


def test_a_mode_change_is_told_at_once(ground: Ground) -> None:
    ground.fly(7)
    changed = ground.fly(1, mode=Mode.HOLD)
    reported = {frame.message_id: frame.payload_values[0] for frame in changed}
    assert reported[ids.HEARTBEAT] == reported[ids.CURRENT_MODE] == 4 << 16 | 3 << 24
    assert ids.EXTENDED_SYS_STATE in reported
    assert ids.HEARTBEAT not in {f.message_id for f in ground.fly(1, mode=Mode.HOLD)}


@pytest.mark.parametrize("change", [{"armed": False}, {"landed": True}, {"failures": ("x",)}])
def test_arming_landing_and_health_are_told_at_once(ground: Ground, change: dict[str, Any]) -> None:
    ground.fly(7)
    assert ids.HEARTBEAT in {frame.message_id for frame in ground.fly(1, **change)}


def test_texts_and_acknowledgements_are_sent_as_they_happen(ground: Ground) -> None:
    ground.links.publish(outputs_at(1_000_000, texts=(StatusText(Severity.WARNING, "why not"),)))
    ground.links.acknowledge(1_000_000, CommandAck(400, 1, 255, 190))
    frames = {frame.message_id: frame.payload_values for frame in ground.heard()}
    assert frames[ids.STATUSTEXT][1] == b"why not".ljust(50, b"\0")
    assert frames[ids.COMMAND_ACK] == (400, 1, 0, 0, 255, 190)


@pytest.mark.parametrize(("sent", "answered"), [(16, 0), (30, 14), (200, 64)])
def test_a_command_for_which_a_tick_has_no_room_is_answered_at_once(
    ground: Ground, sent: int, answered: int
) -> None:
    """A client that waits for its answer would be left to guess what became of it."""
    station = FrameWriter(255, 190)

    def ask(numbers: range) -> list[tuple[object, ...]]:
        for number in numbers:
            command = (*(0.0,) * 7, number, 1, 1, 0)
            ground.polled(station.frame(ids.COMMAND_LONG, *command))
        frames = ground.heard()
        assert {f.message_id for f in frames} <= {ids.COMMAND_ACK}, "and no text"
        return [frame.payload_values for frame in frames]

    later = [(number, 1, 0, 0, 255, 190) for number in range(1016, 1016 + answered)]
    assert ask(range(1000, 1000 + sent)) == later
    assert len(ground.inbox.take().commands) == 16
    assert ground.inbox.refused == sent - 16
    assert ask(range(2000, 2017)) == [(2016, 1, 0, 0, 255, 190)], "and so in the next tick"


def test_a_number_that_does_not_fit_its_field_does_not_end_the_flight(ground: Ground) -> None:
    plan = SNAPSHOT.plan
    assert plan is not None
    reported = {frame.message_id for frame in ground.fly(60, plan=replace(plan, cost=1e300))}
    assert ids.ATTITUDE in reported
    assert ids.MPC_STATUS not in reported
    assert ground.link.outbox.encode_failures > 0


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf, 1e30])
def test_no_estimate_however_wild_ends_the_flight(ground: Ground, number: float) -> None:
    wild = SNAPSHOT.estimate._replace(
        p_WB=(number,) * 3, v_WB=(number,) * 3, R_WB=(number,) * 9,
        w_WB_B=(number,) * 3, yaw=number,
    )  # fmt: skip
    battery = BatteryState(number, number, number, number)
    reported = {frame.message_id for frame in ground.fly(1000, estimate=wild, battery=battery)}
    assert ids.HEARTBEAT in reported


@pytest.mark.requirement("REQ-LINK-6")
def test_garbage_does_not_raise_and_nothing_is_learnt_from_it(ground: Ground) -> None:
    chance = random.Random(4)
    stranger = station_socket()
    for size in (0, 1, 9, 12, 60, 280, 1400, 2048, 4000):
        ground.polled(bytes(chance.randrange(256) for _ in range(size)), stranger)
        ground.polled(b"\xfd" * size, stranger)
    command = FrameWriter(255, 190).frame(ids.COMMAND_LONG, *(0.0,) * 7, 400, 1, 1, 0)
    for cut in range(len(command)):
        ground.polled(command[:cut], stranger)
    ground.polled(command[:-1] + bytes([command[-1] ^ 1]), stranger)
    assert ground.inbox.take().commands == []
    assert ground.link.peers.all == (ground.station.getsockname(),)
    assert ground.recorded == []
    assert ground.link.losses.bytes > 0
    stranger.close()


def test_a_truncated_datagram_does_not_swallow_the_next(ground: Ground) -> None:
    command = FrameWriter(255, 190).frame(ids.COMMAND_LONG, *(0.0,) * 7, 400, 1, 1, 0)
    ground.polled(command[:20])
    ground.polled(command)
    assert len(ground.inbox.take().commands) == 1


def test_a_valid_frame_makes_its_sender_a_peer(ground: Ground) -> None:
    other = station_socket()
    ground.polled(FrameWriter(255, 190).frame(ids.HEARTBEAT, *HEARTBEAT), other)
    assert ground.fly(5)
    assert other.recv(2048)
    other.close()


def test_a_peer_is_answered_in_the_version_it_speaks(ground: Ground) -> None:
    """QGroundControl falls back to MAVLink 1 and reads both; an old program reads only that."""
    old, new = station_socket(), station_socket()
    heartbeat = old_protocol.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
    ground.polled(bytes(heartbeat.pack(old_protocol.MAVLink(None, 255, 190))), old)
    ground.polled(FrameWriter(254, 190).frame(ids.HEARTBEAT, *HEARTBEAT), new)
    ground.fly(1000)
    both = [b"".join(_received(one)) for one in (old, new)]
    assert [{magic for magic, _ in _frames(data)} for data in both] == [{0xFE}, {0xFD}]
    reader = old_protocol.MAVLink(None)
    reported = {message.get_type() for message in reader.parse_buffer(both[0])}
    assert {"HEARTBEAT", "ATTITUDE", "MISSION_CURRENT", "BATTERY_STATUS"} <= reported
    assert "BAD_DATA" not in reported
    by_id = {id_ for _, id_ in _frames(both[1])}
    assert {id_ for _, id_ in _frames(both[0])} == {id_ for id_ in by_id if id_ < 256}


def test_a_peer_that_returns_to_version_2_is_answered_in_it(ground: Ground) -> None:
    writer = FrameWriter(255, 190)
    for frame, magic in (
        (writer.frame(ids.HEARTBEAT, *HEARTBEAT), 0xFD),
        (as_version_1(writer.frame(ids.HEARTBEAT, *HEARTBEAT)), 0xFE),
        (writer.frame(ids.HEARTBEAT, *HEARTBEAT), 0xFD),
    ):
        assert frame is not None
        ground.heard()
        ground.polled(frame)
        for _ in range(50):
            ground.t_us += 2_000
            ground.links.publish(outputs_at(ground.t_us))
        assert {found for found, _ in _frames(b"".join(ground.datagrams()))} == {magic}


def _received(station: socket.socket) -> list[bytes]:
    found = []
    with contextlib.suppress(BlockingIOError):
        while True:
            found.append(station.recv(2048))
    return found


def _frames(data: bytes) -> list[tuple[int, int]]:
    """Start marker and message id of each frame."""
    found, at = [], 0
    while at < len(data):
        if data[at] == 0xFE:
            found.append((0xFE, data[at + 5]))
            at += 8 + data[at + 1]
        else:
            found.append((data[at], int.from_bytes(data[at + 7 : at + 10], "little")))
            at += 12 + data[at + 1]
    return found


def test_peers_are_bounded_and_the_configured_one_stays(ground: Ground) -> None:
    others = [station_socket() for _ in range(12)]
    writer = FrameWriter(255, 190)
    for other in others:
        ground.polled(writer.frame(ids.HEARTBEAT, *HEARTBEAT), other)
    assert len(ground.link.peers.all) == 5
    assert ground.station.getsockname() in ground.link.peers.all
    assert others[-1].getsockname() in ground.link.peers.all
    for other in others:
        other.close()


def test_a_peer_that_speaks_is_not_pushed_out_by_newcomers(ground: Ground) -> None:
    """A stranger with a few ports took all telemetry from a station that was not configured."""
    first, *others = [station_socket() for _ in range(12)]
    heartbeat = FrameWriter(255, 190).frame(ids.HEARTBEAT, *HEARTBEAT)
    ground.polled(heartbeat, first)
    for other in others:
        ground.polled(heartbeat, other)
        assert first.getsockname() in ground.link.peers.all
    assert others[-1].getsockname() in ground.link.peers.all, "the newest is answered too"
    ground.clock.pass_s(2.5)
    for speaker in (others[-1], others[1], others[-1], first):
        ground.polled(heartbeat, speaker)
    kept = {others[-1].getsockname(), others[1].getsockname(), first.getsockname()}
    assert kept <= set(ground.link.peers.all), "those that are silent go first"
    for one in (first, *others):
        one.close()


def test_each_sender_has_its_turn(ground: Ground) -> None:
    """A stranger's full datagrams delayed a ground station's commands by a second."""
    heartbeat = FrameWriter(66, 66).frame(ids.HEARTBEAT, *HEARTBEAT)
    owner = FrameWriter(255, 190)
    ground.polled(owner.frame(ids.HEARTBEAT, *HEARTBEAT))
    with closing(station_socket()) as stranger:
        for _ in range(40):
            stranger.sendto(heartbeat * 60, ("127.0.0.1", ground.link.port))
        command = (*(0.0,) * 7, 511, 1, 1, 0)
        ground.station.sendto(
            owner.frame(ids.COMMAND_LONG, *command), ("127.0.0.1", ground.link.port)
        )
        ground.heard()
        for _ in range(3):
            ground.poll()
        assert ids.COMMAND_ACK in [frame.message_id for frame in ground.heard()]


def test_a_peer_that_falls_silent_is_forgotten(ground: Ground) -> None:
    other = station_socket()
    writer = FrameWriter(255, 190)
    ground.polled(writer.frame(ids.HEARTBEAT, *HEARTBEAT), other)
    ground.clock.pass_s(0.6 * EXPIRY_US / 1e6)
    ground.polled(writer.frame(ids.HEARTBEAT, *HEARTBEAT), other)
    ground.clock.pass_s(0.6 * EXPIRY_US / 1e6)
    ground.fly(500)
    assert other.getsockname() in ground.link.peers.all
    ground.clock.pass_s(0.6 * EXPIRY_US / 1e6)
    ground.fly(500)
    assert ground.link.peers.all == (ground.station.getsockname(),)
    other.close()


@pytest.mark.parametrize("version", [2, 1])
def test_our_own_frames_sent_back_are_dropped_and_counted(ground: Ground, version: int) -> None:
    if version == 1:
        ping = FrameWriter(255, 190).frame(ids.PING, 1, 2, 0, 0)
        ground.polled(as_version_1(ping) or b"")
    before, echo = ground.link.accepted, station_socket()
    sent: list[bytes] = []
    for _ in range(200):
        ground.fly_silently(1)
        sent += ground.datagrams()
    assert {datagram[0] for datagram in sent} <= {0xFD, 0xFE}
    for datagram in sent:
        ground.polled(datagram, echo)
    frames = [frame for datagram in sent for frame in split(datagram)]
    assert {frame.component_id for frame in frames} == ({1, 25} if version == 2 else {1})
    assert echo.getsockname() not in ground.link.peers.all
    assert counts(ground)["echoes_dropped"] == len(frames)
    assert ground.link.accepted == before
    echo.close()


@pytest.mark.parametrize("who", IDENTITIES, ids=lambda who: f"{who[0]}-{who[1]}")
def test_a_program_of_any_identity_is_answered(who: tuple[int, int]) -> None:
    program = dialect.MAVLink(None, srcSystem=who[0], srcComponent=who[1])
    asked = (
        dialect.MAVLink_heartbeat_message(18, 8, 192, 0, 4, 3),  # mavros'
        dialect.MAVLink_ping_message(1, 2, 0, 0),
        dialect.MAVLink_command_long_message(1, 1, 512, 0, ids.AUTOPILOT_VERSION, *(0,) * 6),
    )
    with ground_station(services=(TimeService(),)) as ground:
        ground.fly(5)
        for message in asked:
            ground.polled(message.pack(program))
        assert ground.link.accepted == len(asked)
        found = {frame.message_id: frame.payload_values for frame in ground.heard()}
        assert found[ids.PING] == (1, 2, *who)
        assert found[ids.COMMAND_ACK][:2] == (512, 0)
        assert found[ids.COMMAND_ACK][-2:] == who
        assert ids.AUTOPILOT_VERSION in found
        assert counts(ground)["echoes_dropped"] == 0


def test_what_one_link_sent_is_known_on_the_other() -> None:
    """A router between both sends the frames of each to the other."""
    sent = SentFrames()
    with ground_station(sent=sent) as gcs, ground_station(sent=sent, api=True) as api:
        gcs.fly_silently(10)
        for datagram in gcs.datagrams():
            api.polled(datagram)
        assert api.link.accepted == 0
        assert api.link.echoes > 0


def test_a_memory_of_what_was_sent_is_bounded_and_keeps_the_newest() -> None:
    sent = SentFrames()
    writer = FrameWriter(1, 1)
    frames = [writer.frame(ids.PING, number, 0, 0, 0) for number in range(40_000)]
    for frame in frames:
        sent.add([frame])
    assert all(frame in sent for frame in frames[-8000:])
    assert sum(frame in sent for frame in frames) < 17_000


def test_what_is_not_answered_is_counted_by_its_name(ground: Ground) -> None:
    station = FrameWriter(255, 190)
    for _ in range(3):
        ground.polled(station.frame(MANUAL_CONTROL, *MANUAL))
    ground.polled(station.frame(ids.PARAM_REQUEST_LIST, 7, 1))
    found = counts(ground)
    assert found["unhandled"] == {"MANUAL_CONTROL": 3}
    assert found["for_others"] == 1
    assert ground.links.losses == LinkLosses(unhandled=3)


@pytest.mark.requirement("REQ-LINK-5")
def test_a_flood_is_read_within_a_budget(ground: Ground) -> None:
    heartbeat = FrameWriter(255, 190).frame(ids.HEARTBEAT, *HEARTBEAT)
    for _ in range(500):
        ground.station.sendto(heartbeat * 60, ("127.0.0.1", ground.link.port))
    ground.poll()
    assert 0 < len(ground.recorded) < 400


def test_a_flood_does_not_fill_the_disk(ground: Ground) -> None:
    """A stranger's frames made the telemetry log grow by 1.2 MB/s."""
    writer = FrameWriter(66, 66)
    flood = b"".join(writer.frame(ids.PING, 1, k, 0, 0) for k in range(60))
    for _ in range(300):
        ground.t_us += 2_000
        ground.polled(flood)
    received = sum(len(frame) for _, frame in ground.recorded if frame[5] == 66)
    assert 128_000 <= received + 100 < 1.7 * 128_000  # in 0.6 s, after one without any
    assert counts(ground)["unrecorded"] > 1_000
    ground.t_us += 1_000_000
    before = len(ground.recorded)
    ground.polled(writer.frame(ids.HEARTBEAT, *HEARTBEAT))
    assert len(ground.recorded) == before + 1


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux counts them")
def test_what_a_flood_left_for_the_kernel_to_drop_is_counted_to_the_datagram(
    ground: Ground,
) -> None:
    heartbeat = FrameWriter(255, 190).frame(ids.HEARTBEAT, *HEARTBEAT)
    ground.polled(heartbeat)
    assert counts(ground)["datagrams_dropped"] == 0
    sent = 2_000
    for _ in range(sent):
        ground.station.sendto(heartbeat, ("127.0.0.1", ground.link.port))
    assert ground.link.dropped
    for _ in range(sent):
        ground.poll()
    dropped = ground.link.dropped
    assert dropped == sent - (ground.link.accepted - 1) > 1_000
    assert ground.link.received == ground.links.received == sent + 1, "read or dropped"
    ground.links.close()
    assert counts(ground)["datagrams_dropped"] == dropped  # told after the flight


def counts(ground: Ground) -> dict[str, Any]:
    """Of the link, as `fsw.json` has them."""
    return ground.link.as_json()


def test_both_directions_are_recorded_frame_by_frame(ground: Ground) -> None:
    writer = FrameWriter(255, 190)
    first, second = (writer.frame(ids.HEARTBEAT, *HEARTBEAT) for _ in range(2))
    ground.polled(b"junk" + first + b"\xfd\xfd" + second)
    assert [frame for _, frame in ground.recorded] == [first, second]


def test_garbage_that_looks_like_the_next_header_does_not_end_the_flight(ground: Ground) -> None:
    writer = FrameWriter(255, 190)
    first, second = (writer.frame(ids.HEARTBEAT, *HEARTBEAT) for _ in range(2))
    ground.polled(b"\x00\xff\x00\x00" + first[4:10] + first + second)
    assert [frame for _, frame in ground.recorded] == [first, second]


class Echo(LinkService):
    """A service that answers each PING with itself, and counts down once asked."""

    message_ids = frozenset({ids.PING})

    def __init__(self) -> None:
        self.left = 0
        self.broken = False

    def handle(self, frame: Frame, t_us: int) -> list[Outgoing]:
        if self.broken:
            raise RuntimeError("a mistake in a service")
        self.left = 2
        return [Outgoing(ids.PING, frame.payload_values)]

    def poll(self, t_us: int) -> list[Outgoing]:
        if not self.left:
            return []
        self.left -= 1
        return [Outgoing(ids.PING, (t_us, self.left, 0, 0))]


@pytest.fixture
def echo() -> Iterator[tuple[Ground, Echo]]:
    service = Echo()
    with ground_station(services=(service,)) as ground:
        yield ground, service


def test_a_service_answers_within_the_same_poll_and_goes_on_after_later_ticks(
    echo: tuple[Ground, Echo],
) -> None:
    ground, _ = echo
    ground.polled(FrameWriter(255, 190).frame(ids.PING, 77, 5, 0, 0))
    assert [frame.payload_values for frame in ground.heard()] == [(77, 5, 0, 0)]
    pings = [frame for frame in ground.fly(3) if frame.message_id == ids.PING]
    assert [frame.payload_values[1] for frame in pings] == [1, 0]


def test_a_log_that_is_downloaded_does_not_grow_by_it(tmp_path: Path) -> None:
    run = tmp_path / "run-1"
    run.mkdir()
    (run / "flight.tlog").write_bytes(bytes(2000))
    request = FrameWriter(255, 190).frame(ids.LOG_REQUEST_DATA, 0, 2000, 0, 1, 1)
    with ground_station(services=(LogService(FlightLogs(run)),)) as ground:
        ground.polled(request)
        sent = Counter(frame.message_id for frame in ground.fly(20))
        kept = Counter(id_ for _, raw in ground.recorded for id_ in [split(raw)[0].message_id])
    assert sent[ids.LOG_DATA] == 23
    assert kept == sent - Counter({ids.LOG_DATA: 23}) + Counter({ids.LOG_REQUEST_DATA: 1})


def test_a_service_that_fails_ends_neither_the_link_nor_the_flight(
    echo: tuple[Ground, Echo],
) -> None:
    ground, service = echo
    service.broken = True
    ground.polled(FrameWriter(255, 190).frame(ids.PING, 77, 5, 0, 0))
    service.broken = False
    ground.polled(FrameWriter(255, 190).frame(ids.PING, 78, 6, 0, 0))
    assert [frame.payload_values[1] for frame in ground.heard()] == [6]
