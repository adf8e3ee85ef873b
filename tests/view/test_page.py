"""Who may open a socket to a page."""

import socket

import pytest

from view.page import is_own


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
