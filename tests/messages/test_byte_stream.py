"""Serial lines and TCP connections: late, lost, back again; every intact frame is read."""

from __future__ import annotations

import random
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager

import pytest

from messages.addresses import (
    LinkError,
    SerialLine,
    TcpEnd,
    address_text,
    parse_address,
    parse_link_address,
)
from messages.byte_stream import ByteStream
from messages.frames import Losses
from messages.stream_reader import PAUSE_US, StreamReader
from tests.messages.test_stream_reader import frames
from tests.serial_line import SerialLine as Line


def wall_us() -> int:
    return time.monotonic_ns() // 1000


def wait_until(done: Callable[[], object], patience_s: float = 5.0) -> bool:
    until = time.monotonic() + patience_s
    while time.monotonic() < until:
        if done():
            return True
        time.sleep(0.002)
    return False


def comes(stream: ByteStream, expected: bytes) -> bool:
    """Whether this comes, in pieces as on a line."""
    came = bytearray()

    def all_there() -> bool:
        came.extend(stream.read(64))
        return came == expected

    return wait_until(all_there)


@contextmanager
def line_at(baud: int, error_rate: float = 0.0) -> Iterator[tuple[Line, ByteStream]]:
    with (
        closing(Line(baud, error_rate)) as line,
        closing(ByteStream(SerialLine(line.device, baud), wall_us)) as stream,
    ):
        yield line, stream


def read_until_quiet(stream: ByteStream, quiet_s: float = 0.35) -> tuple[bytes, list[bytes]]:
    """Everything that comes, and the frames in it, as a link reads them."""
    reader, losses, came, found = StreamReader(), Losses(), b"", []
    last_us = wall_us()
    while wall_us() - last_us < 1e6 * quiet_s or reader.waits:
        data = stream.read(512)
        if data:
            last_us = wall_us()
        elif wall_us() - last_us < PAUSE_US:
            time.sleep(0.001)
            continue
        came += data
        found += [raw for _, raw in reader.cut(data, losses)]
    return came, found


@pytest.mark.drawn(4)
@pytest.mark.parametrize("baud", [57_600, 115_200, 460_800, 921_600])
@pytest.mark.parametrize("error_rate", [0.0, 1e-4, 1e-3])
def test_every_intact_frame_is_read_from_a_noisy_line(baud: int, error_rate: float) -> None:
    sent = frames(baud // 1800, seed=baud)
    with line_at(baud, error_rate) as (line, stream):
        begin = time.monotonic()
        line.send(b"".join(sent))
        came, found = read_until_quiet(stream)
        assert line.idle
        assert time.monotonic() - begin < 10.0 * len(came) / baud + 2.0
    # No byte is lost on this line: where each frame lies is known.
    assert len(came) == sum(map(len, sent))
    intact, at = [], 0
    for frame in sent:
        if came[at : at + len(frame)] == frame:
            intact.append(frame)
        at += len(frame)
    assert (len(intact) < len(sent)) is (error_rate > 0.0)
    assert [raw for raw in found if raw in intact] == intact


def test_a_device_that_comes_late_vanishes_and_comes_back_is_used_again() -> None:
    now_us = 0

    def clock() -> int:
        return now_us

    with closing(Line(921_600)) as line:
        where = SerialLine(line.device, 921_600)
        with closing(ByteStream(SerialLine("/dev/nowhere", 57_600), clock)) as stream:
            assert not stream.connected
            assert stream.problem == "No such file or directory"
            stream.address = where  # the adapter is plugged in
            assert stream.read(64) == b""
            assert not stream.connected  # it is looked for once a second
            now_us += 1_000_000
            stream.read(64)
            assert stream.connected
            line.send(b"hello")
            assert comes(stream, b"hello")
            line.unplug()
            assert wait_until(lambda: stream.read(64) == b"" and not stream.connected)
            stream.send(b"nobody hears this")
            line.plug_in()
            stream.address = SerialLine(line.device, 921_600)
            now_us += 1_000_000
            stream.read(64)
            assert stream.connected  # what came before it opened the line is lost
            line.send(b"again")
            assert comes(stream, b"again")
            assert stream.connections == 2
            stream.send(b"answer")
            assert wait_until(lambda: bytes(line.got) == b"answer")


def test_nobody_else_opens_the_line() -> None:
    with line_at(57_600) as (line, stream):
        assert stream.connected
        with closing(ByteStream(SerialLine(line.device, 57_600), wall_us)) as second:
            assert not second.connected
            assert second.problem


def test_a_line_that_takes_nothing_holds_nobody_up_and_loses_whole_datagrams() -> None:
    with line_at(57_600) as (line, stream):
        datagram = b"\xfd" + bytes(range(200))
        begin = time.monotonic()
        for _ in range(2000):
            stream.send(datagram)
        assert time.monotonic() - begin < 0.5
        assert stream.dropped > 1000
        before = -1
        while line.taken != before:
            before = line.taken
            for _ in range(30):
                time.sleep(0.01)
                assert stream.read(1) == b""
        came = line.take()
        assert len(came) > 4000
        assert came == datagram * (len(came) // len(datagram))


def test_a_tcp_client_finds_its_server_late_and_again() -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as server:
        port = server.getsockname()[1]
    stream = ByteStream(TcpEnd("127.0.0.1", port), wall_us)
    with closing(stream):
        assert stream.problem == "Connection refused"
        for count in (1, 2):
            with closing(socket.create_server(("127.0.0.1", port), reuse_port=False)) as server:
                server.settimeout(5.0)
                assert wait_until(lambda: stream.read(64) == b"" and stream.connected)
                client, _ = server.accept()
                with closing(client):
                    sent = frames(300, count)
                    client.sendall(b"".join(sent))
                    stream.send(b"hello")
                    assert client.recv(64) == b"hello"
                    _, found = read_until_quiet(stream)
                    assert found == sent
            assert wait_until(lambda: stream.read(64) == b"" and not stream.connected)
        assert stream.connections == 2


def test_a_listening_end_serves_the_client_that_came_last() -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as free:
        port = free.getsockname()[1]
    stream = ByteStream(TcpEnd("127.0.0.1", port, listens=True), wall_us)
    with closing(stream), pytest.raises(LinkError, match="cannot listen on tcpin:127"):
        ByteStream(TcpEnd("127.0.0.1", port, listens=True), wall_us)
    stream = ByteStream(TcpEnd("127.0.0.1", port, listens=True), wall_us)
    with closing(stream):
        first = socket.create_connection(("127.0.0.1", port))
        assert wait_until(lambda: stream.read(64) == b"" and stream.connected)
        second = socket.create_connection(("127.0.0.1", port))
        with closing(first), closing(second):
            second.sendall(b"from the second")
            assert comes(stream, b"from the second")
            assert first.recv(64) == b""


@pytest.mark.parametrize(
    "text",
    [
        "udp:127.0.0.1:14550",
        "tcp:127.0.0.1:5760",
        "tcpin:0.0.0.0:5760",
        "serial:/dev/ttyUSB0:57600",
    ],
)
def test_an_address_is_read_and_written_alike(text: str) -> None:
    assert address_text(parse_link_address(text)) == text


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("serial:/dev/ttyUSB0", "not of the form"),
        ("serial:/dev/ttyUSB0:300", "baud 300 is outside 9600..4000000"),
        ("tcp:127.0.0.1:70000", "port 70000 is outside 1..65535"),
        ("tcp:127.0.0.1:0", "port 0 is outside"),
        ("http://127.0.0.1:80", "not of the form"),
        ("tcp:no such host:80", "not of the form"),
        ("tcp:nowhere.invalid:80", "is not known"),
        ("serial:a\0b:57600", "not of the form"),
        ("", "not of the form"),
    ],
)
def test_what_is_no_address_is_refused_in_one_sentence(text: str, why: str) -> None:
    with pytest.raises(LinkError, match=why):
        parse_link_address(text)


def test_where_only_udp_will_do_another_kind_is_refused() -> None:
    with pytest.raises(LinkError, match="not of the form udp:HOST:PORT"):
        parse_address("tcp:127.0.0.1:5760")


def test_noise_from_a_line_that_nobody_set_up_is_passed_over() -> None:
    with line_at(921_600) as (line, stream):
        sent = frames(50, 4)
        line.send(random.Random(2).randbytes(20_000) + b"".join(sent))
        _, found = read_until_quiet(stream)
        assert [raw for raw in found if raw in sent] == sent
