"""Who may open a socket to a page."""

import gzip
import html
import socket
import urllib.request

import pytest

from command_line.html_page import ICON
from view.page import is_own, open_server


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
