"""Who may open a socket to a page."""

import contextlib
import gzip
import html
import http.client
import os
import socket
import time
import urllib.request
from pathlib import Path

import msgspec
import pytest
import viser
import websockets.sync.client
import zstandard

from command_line.html_page import ICON
from fsw.autopilot.model.airframe import AIRFRAME
from tests.view.test_telemetry import a_log
from view.log_page import LogPage
from view.page import Server, is_own, open_server
from view.tlog_flight import TlogFlight


@pytest.mark.parametrize(
    ("origin", "host"),
    [
        ("http://127.0.0.1:8042", "127.0.0.1:8042"),
        ("http://localhost:8042", "localhost:8042"),
        ("http://192.168.1.7:8042", "192.168.1.7:8042"),
        ("http://192.168.1.7", "192.168.1.7:80"),
        ("http://[::1]:8042", "[::1]:8042"),
        (f"http://{socket.gethostname().lower()}:8042", f"{socket.gethostname().lower()}:8042"),
    ],
)
def test_the_page_itself_may(origin: str, host: str) -> None:
    assert is_own([origin], [host])


@pytest.mark.parametrize(
    ("origin", "host"),
    [
        ("http://evil.example:8042", "192.168.1.7:8042"),  # its page, our socket
        ("http://evil.example:8042", "evil.example:8042"),  # its name made to lead here
        ("http://192.168.1.8:8042", "192.168.1.7:8042"),
        ("http://127.0.0.1:8043", "127.0.0.1:8042"),
        ("https://127.0.0.1:8042", "127.0.0.1:8042"),
        ("null", "127.0.0.1:8042"),
        ("", ""),
    ],
)
def test_no_other_page_may(origin: str, host: str) -> None:
    assert not is_own([origin], [host])


def test_what_is_no_browser_may_and_a_request_with_two_origins_may_not() -> None:
    assert is_own([], ["127.0.0.1:8042"])
    assert not is_own(["http://127.0.0.1:8042"] * 2, ["127.0.0.1:8042"])
    assert not is_own(["http://127.0.0.1:8042"], [])


@pytest.mark.parametrize("packed", [False, True])
def test_a_page_has_our_title_and_icon_and_says_that_it_loads(packed: bool) -> None:
    server = open_server("127.0.0.1", 0, "walls <mocap>, seed 0")
    try:
        headers = {"Accept-Encoding": "gzip"} if packed else {}
        address = f"http://127.0.0.1:{server.get_port()}/"
        with urllib.request.urlopen(urllib.request.Request(address, headers=headers)) as answer:
            body = answer.read()
            assert int(answer.headers["Content-Length"]) == len(body)
            assert (answer.headers["Content-Encoding"] == "gzip") is packed
    finally:
        server.stop()
    page = (gzip.decompress(body) if packed else body).decode()
    assert f"<title>{html.escape('walls <mocap>, seed 0')} - Pandion</title>" in page
    assert f'href="{ICON}"' in page
    assert '<div id="root"><p' in page
    assert "loading the scene" in page
    head = page[: page.index("</head>")]
    assert "prefers-color-scheme: dark" in head
    assert "max-width: 36em" in head


@pytest.mark.parametrize("name", [r"logs\d1", r"g\g<1>", "logs\udcff", "<b>\x1b[31m"])
def test_a_title_from_outside_is_no_template(name: str) -> None:
    server = open_server("127.0.0.1", 0, f"{name}/flight.tlog")
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{server.get_port()}/") as answer:
            page = answer.read().decode()
    finally:
        server.stop()
    shown = name.replace("\udcff", r"\udcff").replace("\x1b", r"\x1b")
    assert f"<title>{html.escape(shown)}/flight.tlog - Pandion</title>" in page


def test_a_log_in_a_folder_of_any_name_is_shown(tmp_path: Path) -> None:
    """Facts and tabs go to the browser in a packed form that takes UTF-8 alone."""
    folder = tmp_path / os.fsdecode(b"\xff\\d")
    folder.mkdir()
    path = folder / "flight.tlog"
    path.write_bytes(a_log(50))
    flight = TlogFlight(path, AIRFRAME)
    server = open_server("127.0.0.1", 0, flight.title)
    page = LogPage(server, flight)
    try:
        with spoken_to(server) as browser:
            until = time.monotonic() + 10.0
            came = b""
            while time.monotonic() < until and b"udcff" not in came:
                came = unpacked(browser.recv(timeout=10.0))
    finally:
        page.close()
        server.stop()
    assert b"udcff" in came


def unpacked(sent: str | bytes) -> bytes:
    """The messages of a frame of viser's."""
    assert isinstance(sent, bytes)
    size = int.from_bytes(sent[8:16], "little")
    return zstandard.ZstdDecompressor().decompress(sent[16 : 16 + size])


def spoken_to(server: Server) -> websockets.sync.client.ClientConnection:
    return websockets.sync.client.connect(
        f"ws://127.0.0.1:{server.get_port()}",
        subprotocols=[websockets.Subprotocol(f"viser-v{viser.__version__}")],
        max_size=None,
    )


REQUESTS = {
    b"GET /%b HTTP/1.1\r\n%b\r\n" % (b"a" * 5000, b"Host: 127.0.0.1\r\n"): 400,
    b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nOrigin: http://[x\r\n\r\n": 400,
    b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nOrigin: http://evil.example\r\n\r\n": 403,
    b"GET /%00 HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n": 404,
}
MESSAGES = (
    "text",
    b"",
    b"\x00\xff" * 10,
    msgspec.msgpack.encode({"type": "Foo"}),
    msgspec.msgpack.encode({"type": "ViewerCameraMessage"}),
    msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": "x", "updates": {"value": 1}}),
)


def test_whatever_a_peer_sends_nothing_is_printed_and_the_page_is_served(
    capfd: pytest.CaptureFixture[str],
) -> None:
    server = open_server("127.0.0.1", 0, "a vehicle")
    number = server.gui.add_number("a number", 1.0)
    try:
        for request, status in REQUESTS.items():
            with socket.create_connection(("127.0.0.1", server.get_port()), 5.0) as peer:
                peer.sendall(request)
                answer = http.client.HTTPResponse(peer)
                answer.begin()
                assert answer.status == status
        for noise in (b"\x00\x1b[31m\xff\r\n\r\n", b"POST / HTTP/1.1\r\n\r\n"):
            with socket.create_connection(("127.0.0.1", server.get_port()), 5.0) as peer:
                peer.sendall(noise)
                peer.recv(100)
        updates = [{"value": "no number"}, {"value": None}, {"order": "x"}, {"nothing": 1}]
        known = number._impl.uuid
        wrong = [
            msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": known, "updates": one})
            for one in updates
        ]
        for message in (*MESSAGES, *wrong):
            with spoken_to(server) as browser:
                browser.send(message)
                with contextlib.suppress(Exception):
                    while True:
                        browser.recv(timeout=0.2)
        with (
            contextlib.suppress(websockets.exceptions.ConnectionClosed),
            websockets.sync.client.connect(
                f"ws://127.0.0.1:{server.get_port()}",
                subprotocols=[websockets.Subprotocol("viser-v0.0.1")],
            ) as old,
        ):
            old.recv(timeout=5.0)
        assert old.close_code == 1002
        with urllib.request.urlopen(f"http://127.0.0.1:{server.get_port()}/") as answer:
            assert answer.status == 200
    finally:
        server.stop()
    said = capfd.readouterr()
    assert said.out + said.err == ""
