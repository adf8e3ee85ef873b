"""What `pandion view` says when it cannot show anything."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from pandion import view
from view.page import PageError, open_server


@pytest.mark.parametrize("name", ["flight.ulg", "flight.tlog"])
def test_a_log_that_is_none_is_refused_in_a_sentence(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert view.main([str(tmp_path / name)]) == 2
    (tmp_path / name).write_bytes(b"\xfd" * 40)
    assert view.main([str(tmp_path / name)]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 2
    assert all(line.startswith("pandion view: ") and name in line for line in said)


def test_an_address_that_is_none_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert view.main(["--vehicle", "here"]) == 2
    assert "'here' is not of the form udp:HOST:PORT" in capsys.readouterr().err


def test_a_port_that_is_taken_is_not_replaced_by_another() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(PageError, match="choose another --port"):
            open_server("127.0.0.1", taken.getsockname()[1], "a flight")
