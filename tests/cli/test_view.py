"""What `pandion view` says when it cannot show anything."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from messages import message_ids as ids
from messages import ulog
from messages.frames import FrameWriter
from messages.ulog_reader import UlogError
from pandion import view
from view.page import PageError, open_server
from view.tlog_flight import TlogFlight


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


@pytest.mark.parametrize("name", ["FLIGHT.TLOG", "flight", "flight.tlog.raw"])
def test_a_telemetry_log_is_known_by_its_content(name: str, tmp_path: Path) -> None:
    writer = FrameWriter(1, 1)
    frames = (writer.frame(ids.ATTITUDE, *[0] * 7), writer.frame(ids.LOCAL_POSITION_NED, *[0] * 7))
    stamps = (10**15 + 40_000 * k for k in range(4))
    log = b"".join(at.to_bytes(8, "big") + one for at in stamps for one in frames)
    (tmp_path / name).write_bytes(log)
    assert isinstance(view._opened(tmp_path / name, "paper"), TlogFlight)


def test_a_ulog_is_known_by_its_content(tmp_path: Path) -> None:
    (tmp_path / "flight.tlog").write_bytes(ulog.MAGIC + bytes(8))
    with pytest.raises(UlogError, match="ends before its data begin"):
        view._opened(tmp_path / "flight.tlog", "paper")


def test_an_address_that_is_none_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert view.main(["--vehicle", "here"]) == 2
    assert "'here' is not of the form udp:HOST:PORT" in capsys.readouterr().err


def test_a_port_that_is_taken_is_not_replaced_by_another() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(PageError, match="choose another --port"):
            open_server("127.0.0.1", taken.getsockname()[1], "a flight")
