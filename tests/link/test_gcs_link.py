"""The ground link over real sockets: rates, peers, and what garbage does not do."""

from __future__ import annotations

import contextlib
import random
import socket
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from fsw.link import message_ids as ids
from fsw.link.flight_logs import flight_logs
from fsw.link.gcs_link import GcsLink
from fsw.link.inbox import Inbox
from fsw.link.log_service import LogService
from fsw.link.service import Outgoing
from fsw.signals import CommandAck, Mode, StatusText
from messages.frames import Frame, FrameWriter, split
from tests.link.snapshots import CONTEXT, outputs_at

HEARTBEAT = (0, 6, 8, 0, 4, 3)


@dataclass
class Ground:
    """A ground station's socket and the link under test."""

    station: socket.socket
    link: GcsLink
    inbox: Inbox
    recorded: list[tuple[int, bytes]] = field(default_factory=list)

    def heard(self) -> list[Frame]:
        frames = []
        while True:
            try:
                frames += split(self.station.recv(2048))
            except BlockingIOError:
                return frames

    def polled(self, datagram: bytes, sender: socket.socket | None = None) -> None:
        (sender or self.station).sendto(datagram, ("127.0.0.1", self.link.port))
        self.poll()

    def poll(self) -> None:
        self.link.poll(1_000_000)


def station_socket() -> socket.socket:
    station = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    station.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
    station.bind(("127.0.0.1", 0))
    station.setblocking(False)
    return station


@pytest.fixture
def ground() -> Iterator[Ground]:
    station, inbox = station_socket(), Inbox()
    recorded: list[tuple[int, bytes]] = []
    link = GcsLink(station.getsockname(), inbox, CONTEXT, lambda t, f: recorded.append((t, f)))
    yield Ground(station, link, inbox, recorded)
    link.close()
    station.close()


def test_streams_leave_at_their_rates_in_sensor_time(ground: Ground) -> None:
    frames: list[Frame] = []
    for tick in range(1500):
        ground.link.publish(outputs_at(1_000_000 + 2_000 * tick))
        if tick % 100 == 99:
            frames += ground.heard()
    counts = Counter((frame.component_id, frame.message_id) for frame in frames)
    assert counts[(1, ids.ATTITUDE)] == 150
    assert counts[(1, ids.LOCAL_POSITION_NED)] == 90
    assert counts[(191, ids.ARM_JOINT_STATE)] == 90
    assert counts[(1, ids.HEARTBEAT)] == 3 + 1  # one more at once, for the first mode
    assert counts[(191, ids.LOOP_TIMING)] == 6
    assert len(ground.recorded) == len(frames)


def test_each_component_counts_its_own_sequence(ground: Ground) -> None:
    for tick in range(200):
        ground.link.publish(outputs_at(1_000_000 + 2_000 * tick))
    frames = ground.heard()
    for component in (1, 191):
        sequences = [frame.sequence for frame in frames if frame.component_id == component]
        assert sequences == [n % 256 for n in range(len(sequences))]


def test_a_mode_change_is_told_at_once(ground: Ground) -> None:
    ground.link.publish(outputs_at(1_000_000))
    ground.heard()
    outputs = outputs_at(1_002_000)
    changed = replace(outputs, snapshot=replace(outputs.snapshot, mode=Mode.HOLD))
    ground.link.publish(changed)
    heartbeats = [frame for frame in ground.heard() if frame.message_id == ids.HEARTBEAT]
    assert [frame.payload_values[0] for frame in heartbeats] == [4 << 16 | 3 << 24]


def test_texts_and_acknowledgements_are_sent_as_they_happen(ground: Ground) -> None:
    ground.link.publish(outputs_at(1_000_000, texts=(StatusText(4, "why not"),)))
    ground.link.acknowledge(1_000_000, CommandAck(400, 1, 255, 190))
    frames = {frame.message_id: frame.payload_values for frame in ground.heard()}
    assert frames[ids.STATUSTEXT][1] == b"why not".ljust(50, b"\0")
    assert frames[ids.COMMAND_ACK] == (400, 1, 0, 0, 255, 190)


def test_a_number_that_does_not_fit_its_field_does_not_end_the_flight(ground: Ground) -> None:
    outputs = outputs_at(1_000_000)
    plan = outputs.snapshot.plan
    assert plan is not None
    huge = replace(outputs.snapshot, plan=replace(plan, cost=1e300))
    for _ in range(60):
        ground.link.publish(replace(outputs, snapshot=huge))
    assert ground.link.encode_failures > 0


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
    assert ground.inbox.take_commands() == ()
    assert ground.link.peers == (ground.station.getsockname(),)
    assert ground.recorded == []
    assert ground.link.losses.bytes > 0
    stranger.close()


def test_a_truncated_datagram_does_not_swallow_the_next(ground: Ground) -> None:
    command = FrameWriter(255, 190).frame(ids.COMMAND_LONG, *(0.0,) * 7, 400, 1, 1, 0)
    ground.polled(command[:20])
    ground.polled(command)
    assert len(ground.inbox.take_commands()) == 1


def test_a_valid_frame_makes_its_sender_a_peer(ground: Ground) -> None:
    other = station_socket()
    ground.polled(FrameWriter(255, 190).frame(ids.HEARTBEAT, *HEARTBEAT), other)
    ground.link.publish(outputs_at(1_000_000))
    assert other.recv(2048)
    assert len(ground.heard()) >= 1
    other.close()


def test_peers_are_bounded_and_the_configured_one_stays(ground: Ground) -> None:
    others = [station_socket() for _ in range(12)]
    writer = FrameWriter(255, 190)
    for other in others:
        ground.polled(writer.frame(ids.HEARTBEAT, *HEARTBEAT), other)
    assert len(ground.link.peers) == 5
    assert ground.station.getsockname() in ground.link.peers
    assert others[-1].getsockname() in ground.link.peers
    for other in others:
        other.close()


def test_our_own_frames_sent_back_are_ignored(ground: Ground) -> None:
    echo = station_socket()
    ground.polled(FrameWriter(1, 191).frame(ids.HEARTBEAT, *HEARTBEAT), echo)
    assert echo.getsockname() not in ground.link.peers
    echo.close()


def test_a_flood_is_read_within_a_budget(ground: Ground) -> None:
    heartbeat = FrameWriter(255, 190).frame(ids.HEARTBEAT, *HEARTBEAT)
    for _ in range(500):
        ground.station.sendto(heartbeat * 60, ("127.0.0.1", ground.link.port))
    ground.poll()
    assert 0 < len(ground.recorded) < 400


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


class Echo:
    """A service that answers each PING with itself, and counts down once asked."""

    message_ids = frozenset({ids.PING})

    def __init__(self) -> None:
        self.left = 0
        self.broken = False

    def receive(self, frame: Frame, t_us: int) -> list[Outgoing]:
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
    station, inbox, service = station_socket(), Inbox(), Echo()
    link = GcsLink(station.getsockname(), inbox, CONTEXT, lambda t, f: None, (service,))
    yield Ground(station, link, inbox), service
    link.close()
    station.close()


def test_a_service_answers_within_the_same_poll_and_goes_on_after_later_ticks(
    echo: tuple[Ground, Echo],
) -> None:
    ground, _ = echo
    ground.polled(FrameWriter(255, 190).frame(ids.PING, 77, 5, 0, 0))
    assert [frame.payload_values for frame in ground.heard()] == [(77, 5, 0, 0)]
    for tick in range(3):
        ground.link.publish(outputs_at(1_000_000 + 2_000 * tick))
    pings = [frame for frame in ground.heard() if frame.message_id == ids.PING]
    assert [frame.payload_values[1] for frame in pings] == [1, 0]


def test_a_log_that_is_downloaded_does_not_grow_by_it(tmp_path: Path) -> None:
    run = tmp_path / "run-1"
    run.mkdir()
    (run / "flight.tlog").write_bytes(bytes(2000))
    recorded: list[bytes] = []
    station, service = station_socket(), LogService(flight_logs(run))
    record = lambda t_us, frame: recorded.append(frame)  # noqa: E731
    link = GcsLink(station.getsockname(), Inbox(), CONTEXT, record, (service,))
    request = FrameWriter(255, 190).frame(ids.LOG_REQUEST_DATA, 0, 2000, 0, 1, 1)
    station.sendto(request, ("127.0.0.1", link.port))
    for tick in range(20):
        link.poll(1_000_000 + 2_000 * tick)
        link.publish(outputs_at(1_000_000 + 2_000 * tick))
    sent = Counter(frame.message_id for frame in split(b"".join(_datagrams(station))))
    kept = Counter(frame.message_id for frame in split(b"".join(recorded)))
    assert sent[ids.LOG_DATA] == 23
    assert kept == sent - Counter({ids.LOG_DATA: 23}) + Counter({ids.LOG_REQUEST_DATA: 1})
    link.close()
    station.close()


def _datagrams(station: socket.socket) -> Iterator[bytes]:
    with contextlib.suppress(BlockingIOError):
        while True:
            yield station.recv(2048)


def test_a_service_that_fails_ends_neither_the_link_nor_the_flight(
    echo: tuple[Ground, Echo],
) -> None:
    ground, service = echo
    service.broken = True
    ground.polled(FrameWriter(255, 190).frame(ids.PING, 77, 5, 0, 0))
    service.broken = False
    ground.polled(FrameWriter(255, 190).frame(ids.PING, 78, 6, 0, 0))
    assert [frame.payload_values[1] for frame in ground.heard()] == [6]
