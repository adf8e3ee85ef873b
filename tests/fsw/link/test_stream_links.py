"""A link to the ground over a serial line or TCP: the same as over UDP, and never too full."""

from __future__ import annotations

import socket
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.link.bounded_memory import SentFrames
from fsw.link.files.log_service import LogService
from fsw.link.files.vehicle_files import FlightLogs
from fsw.link.gcs_link import GcsLink, LinkSetup
from fsw.link.ground_links import GroundLinks
from fsw.link.inbox import Inbox
from fsw.link.services.parameter_service import ParameterService
from fsw.link.services.service import LinkService
from fsw.link.signing.key_file import NoKeyFile
from fsw.link.signing.signing import SignedTimes, Signing
from fsw.link.telemetry.streams import GROUND_RATES
from fsw.storage.parameter_store import ParameterStore
from messages import message_ids as ids
from messages.addresses import LinkAddress, SerialLine, TcpEnd
from messages.frames import Frame, FrameWriter, Losses
from messages.stream_reader import StreamReader
from tests.fsw.link.snapshots import CONTEXT, outputs_at
from tests.serial_line import SerialLine as Line

TICK_S = 0.002
STATION = FrameWriter(255, 190)


def wall_us() -> int:
    return time.monotonic_ns() // 1000


@contextmanager
def link_at(
    address: LinkAddress, services: Sequence[LinkService] = ()
) -> Iterator[tuple[GcsLink, GroundLinks]]:
    setup = LinkSetup("gcs", address, 0, GROUND_RATES, unheard=True)
    signing = Signing(0, lambda: 1_750_000_000_000_000, NoKeyFile(), SignedTimes())
    link = GcsLink(setup, Inbox(), CONTEXT, signing, wall_us, None, services, SentFrames())
    with closing(GroundLinks([link], 2_000, wall_us)) as links:
        yield link, links


def fly(links: GroundLinks, seconds: float, t_us: int = 1_000_000) -> int:
    """Fly in real time; the time of the last tick."""
    begin = time.monotonic()
    for k in range(round(seconds / TICK_S)):
        t_us += 2_000
        links.publish(outputs_at(t_us))
        links.attend(max(begin + (k + 1) * TICK_S - time.monotonic(), 0.0))
    return t_us


def frames_in(stream: bytes) -> list[Frame]:
    reader, losses = StreamReader(), Losses()
    return [frame for data in (stream, b"") for frame, _ in reader.cut(data, losses)]


def asked(message_id: int, *values: float | bytes) -> bytes:
    return STATION.frame(message_id, *values)


@pytest.mark.drawn(1)
@pytest.mark.parametrize("baud", [57_600, pytest.param(115_200, marks=pytest.mark.long), 921_600])
def test_a_slow_line_is_never_more_than_80_percent_full(baud: int) -> None:
    with closing(Line(baud)) as line, link_at(SerialLine(line.device, baud)) as (link, links):
        t_us = fly(links, 1.5)
        line.take()
        before = line.taken
        fly(links, 3.0, t_us)
        rate = (line.taken - before) / 3.0
        counts = Counter(frame.message_id for frame in frames_in(line.take()))
        told = [text.text for _ in range(9) for text in links.news() if "slow" in text.text]
    assert rate < 0.8 * baud / 10.0
    assert counts[ids.HEARTBEAT] >= 2
    assert counts[ids.SYS_STATUS] >= 5
    share = link.rates.share
    assert counts[ids.ATTITUDE] == pytest.approx(3 * 50 * share, abs=10)
    if baud > 200_000:
        assert share == 1.0
        assert told == []
    else:
        assert rate > 0.5 * baud / 10.0
        assert told == [
            f"link gcs: slow line, telemetry at {100.0 * share:.0f} % of its rates, "
            "heartbeat and state in full"
        ]


def test_the_slowest_line_still_carries_heartbeats() -> None:
    with closing(Line(9_600)) as line, link_at(SerialLine(line.device, 9_600)) as (_, links):
        fly(links, 3.0)
        assert line.taken < 3.2 * 0.8 * 960
        counts = Counter(frame.message_id for frame in frames_in(line.take()))
    assert counts[ids.HEARTBEAT] >= 2


def test_a_command_is_answered_at_once_while_a_log_is_downloaded_over_a_slow_line(
    tmp_path: Path,
) -> None:
    run = tmp_path / "run-1"
    run.mkdir()
    (run / "flight.ulg").write_bytes(bytes(300_000))
    parameters = ParameterStore(FlightConfig(), lambda tuning: None)
    services = (LogService(FlightLogs(run)), ParameterService(parameters))
    baud = 57_600
    with (
        closing(Line(baud)) as line,
        link_at(SerialLine(line.device, baud), services) as (_, links),
    ):
        line.send(asked(ids.HEARTBEAT, 0, 6, 8, 0, 4, 3))
        line.send(asked(ids.LOG_REQUEST_LIST, 0, 0xFFFF, 1, 1))
        line.send(asked(ids.PARAM_REQUEST_LIST, 1, 1))
        t_us = fly(links, 1.0)
        entries = [f for f in frames_in(line.take()) if f.message_id == ids.LOG_ENTRY]
        log = int(entries[0].payload_values[2])
        line.send(asked(ids.LOG_REQUEST_DATA, 0, 300_000, log, 1, 1))
        before = line.taken
        t_us = fly(links, 3.0, t_us)
        rate = (line.taken - before) / 3.0
        counts = Counter(frame.message_id for frame in frames_in(line.take()))
        command = (float(ids.ATTITUDE), *(0.0,) * 6, 510, 1, 1, 0)
        line.send(asked(ids.COMMAND_LONG, *command))
        fly(links, 0.4, t_us)
        answers = {frame.message_id for frame in frames_in(line.take())}
    assert rate < 0.82 * baud / 10.0
    assert counts[ids.LOG_DATA] > 10
    assert counts[ids.HEARTBEAT] >= 2
    assert counts[ids.ATTITUDE] > 20
    assert ids.COMMAND_ACK in answers


def test_bit_errors_cost_only_the_frames_that_have_them() -> None:
    baud = 115_200
    with (
        closing(Line(baud, error_rate=2e-4)) as line,
        link_at(SerialLine(line.device, baud)) as (link, links),
    ):
        for _ in range(300):
            line.send(asked(ids.HEARTBEAT, 0, 6, 8, 0, 4, 3))
        fly(links, 1.5)
        assert 250 <= link.accepted < 300
        assert link.losses.bytes > 0


def test_a_line_that_is_unplugged_and_plugged_in_again_is_told_and_counted() -> None:
    baud = 921_600
    with closing(Line(baud)) as line, link_at(SerialLine(line.device, baud)) as (link, links):
        where = f"serial:{line.device}:{baud}"
        assert [text.text for text in links.news()] == [f"link gcs: {where} connected"]
        t_us = fly(links, 0.2)
        line.unplug()
        t_us = fly(links, 0.1, t_us)
        (lost,) = links.news()
        assert lost.text.startswith(f"link gcs: {where} lost: ")
        assert links.news() == []
        line.plug_in()
        link._endpoint._stream.address = SerialLine(line.device, baud)  # type: ignore[union-attr]
        t_us = fly(links, 1.2, t_us)
        assert [text.text for text in links.news()] == [f"link gcs: {where} connected again"]
        line.take()
        fly(links, 0.3, t_us)
        assert frames_in(line.take())
        assert link.as_json()["connections"] == 2


def test_a_device_that_is_not_there_is_told_and_costs_nothing() -> None:
    with link_at(SerialLine("/dev/nowhere", 57_600)) as (link, links):
        (absent,) = links.news()
        assert absent.text == (
            "link gcs: serial:/dev/nowhere:57600 not there: No such file or directory"
        )
        fly(links, 0.1)
        assert link.as_json()["connected"] is False


def test_over_tcp_a_station_hears_and_is_heard_at_full_rates() -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as server:
        port = server.getsockname()[1]
        with link_at(TcpEnd("127.0.0.1", port)) as (link, links):
            t_us = fly(links, 0.05)
            station, _ = server.accept()
            with closing(station):
                command = (float(ids.ATTITUDE), *(0.0,) * 6, 510, 1, 1, 0)
                half = asked(ids.COMMAND_LONG, *command)
                station.sendall(half[:9])
                t_us = fly(links, 0.05, t_us)
                station.sendall(half[9:])
                fly(links, 1.0, t_us)
                counts = Counter(frame.message_id for frame in frames_in(station.recv(1 << 20)))
            assert link.is_heard
            assert counts[ids.COMMAND_ACK] == 1
            assert abs(counts[ids.ATTITUDE] - 52) <= 3
            assert link.as_json()["connections"] == 1


def test_a_listening_link_takes_a_client() -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as free:
        port = free.getsockname()[1]
    with link_at(TcpEnd("127.0.0.1", port, listens=True)) as (link, links):
        t_us = fly(links, 0.05)
        assert [text.text for text in links.news()] == [
            f"link gcs: tcpin:127.0.0.1:{port} waits for a client"
        ]
        with closing(socket.create_connection(("127.0.0.1", port))) as station:
            station.sendall(asked(ids.HEARTBEAT, 0, 6, 8, 0, 4, 3))
            fly(links, 0.5, t_us)
            assert link.accepted == 1
            assert frames_in(station.recv(1 << 20))
