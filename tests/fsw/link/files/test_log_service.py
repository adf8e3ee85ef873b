"""Log download: what arrives is the file, whatever happens on the way."""

from __future__ import annotations

import os
import random
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from fsw.autopilot.signals import Severity, StatusText
from fsw.link.files.log_service import CHUNK, LogService
from fsw.link.files.vehicle_files import MARK, FlightLogs, flight_logs, vehicle_files
from fsw.link.wire.outgoing import ServiceOutput
from messages import message_ids as ids
from messages.block_file import BlockFile
from messages.frames import FrameWriter, split
from tests.fsw.link.files.wire_values import message_of, values_of
from tests.waiting import wait_for

ALL = 0xFFFFFFFF
FRAMES_A_TICK = 6
FRAMES_A_DATAGRAM = 13


OWN = Path("/var/vehicle.params")  # what makes earlier flights those of the same vehicle


def flight(runs: Path, name: str, content: bytes, suffix: str = "tlog", of: Path = OWN) -> Path:
    directory = runs / name
    directory.mkdir(exist_ok=True)
    (directory / MARK).write_bytes(bytes(of))
    (directory / f"flight.{suffix}").write_bytes(content)
    return directory


@dataclass
class Client:
    """Puts a download together, as ground stations do."""

    service: LogService
    log: bytearray = field(default_factory=bytearray)
    counts: list[int] = field(default_factory=list)
    writer: FrameWriter = field(default_factory=lambda: FrameWriter(255, 190))

    def ask(self, message_id: int, *values: int) -> list[ServiceOutput]:
        (frame,) = split(self.writer.frame(message_id, *values))
        return list(self.service.handle(frame, 0))

    def polled(self) -> list[ServiceOutput]:
        """Of one tick, and what fits between it and the next."""
        answers = list(self.service.poll(0))
        assert len(answers) <= FRAMES_A_TICK
        while bulk := self.service.bulk(0):
            assert len(bulk) <= FRAMES_A_DATAGRAM
            answers += bulk
        return answers

    def entries(self) -> list[tuple[int, ...]]:
        """(id, size, number of logs, last id) of each entry."""
        answers = self.ask(ids.LOG_REQUEST_LIST, 0, 0xFFFF, 1, 1)
        while more := self.polled():
            answers += more
        assert {message_of(answer) for answer in answers} == {ids.LOG_ENTRY}
        return [tuple(map(int, (v[2], v[1], v[3], v[4]))) for v in map(values_of, answers)]

    def download(
        self,
        log_id: int,
        offset: int = 0,
        count: int = ALL,
        lose: Callable[[], bool] = lambda: False,
    ) -> None:
        self.ask(ids.LOG_REQUEST_DATA, offset, count, log_id, 1, 1)
        while answers := self.polled():
            for start, id_, size, *data in (map(int, values_of(answer)) for answer in answers):
                assert id_ == log_id
                assert len(data) == CHUNK
                self.counts.append(size)
                if not lose():
                    self.log.extend(bytes(max(0, start + size - len(self.log))))
                    self.log[start : start + size] = bytes(data[:size])


@pytest.mark.parametrize("size", [1, 89, 90, 91, 1000, 90 * 40, 40_000])
@pytest.mark.parametrize("count", [ALL, 0x7FFFFFFF])
def test_a_download_is_the_file_byte_for_byte(tmp_path: Path, size: int, count: int) -> None:
    content = random.Random(size).randbytes(size)
    client = Client(LogService(FlightLogs(flight(tmp_path, "run-1", content), OWN)))
    client.download(0, count=count)
    assert bytes(client.log) == content


@pytest.mark.parametrize("size", [90, 91, 900])
def test_a_download_without_an_end_closes_with_a_message_that_is_not_full(
    tmp_path: Path, size: int
) -> None:
    client = Client(LogService(FlightLogs(flight(tmp_path, "run-1", bytes(size)), OWN)))
    client.download(0)
    assert [count < CHUNK for count in client.counts] == [False] * (size // 90) + [True]


def test_a_piece_ends_where_it_was_asked_to_end(tmp_path: Path) -> None:
    content = bytes(range(250)) * 8
    client = Client(LogService(FlightLogs(flight(tmp_path, "run-1", content), OWN)))
    client.download(0, offset=180, count=270)
    assert client.counts == [90, 90, 90]
    assert bytes(client.log[180:]) == content[180:450]


def test_behind_the_end_there_is_nothing(tmp_path: Path) -> None:
    client = Client(LogService(FlightLogs(flight(tmp_path, "run-1", bytes(180)), OWN)))
    client.download(0, offset=180)
    client.download(0, offset=5000, count=90)
    assert client.counts == [0, 0]


def test_lost_pieces_are_asked_for_again_many_at_a_time(tmp_path: Path) -> None:
    content = random.Random(1).randbytes(90 * 100)
    client = Client(LogService(FlightLogs(flight(tmp_path, "run-1", content), OWN)))
    numbers = iter(range(1000))
    client.download(0, lose=lambda: next(numbers) % 5 == 0)
    assert bytes(client.log) != content
    for lost in range(0, 100, 5):
        client.ask(ids.LOG_REQUEST_DATA, 90 * lost, 90, 0, 1, 1)
    client.download(0, offset=len(content), count=90)
    assert bytes(client.log) == content


def test_the_size_is_the_listed_one_while_the_file_grows(tmp_path: Path) -> None:
    content = random.Random(2).randbytes(5000)
    directory = flight(tmp_path, "run-1", content)
    client = Client(LogService(FlightLogs(directory, OWN)))
    assert client.entries() == [(0, 5000, 1, 0)]
    with (directory / "flight.tlog").open("ab") as log:
        log.write(b"more of the flight" * 100)
    client.download(0)
    assert bytes(client.log) == content
    assert client.entries() == [(0, 6800, 1, 0)]
    client.download(0)
    assert bytes(client.log) == (directory / "flight.tlog").read_bytes()


def test_flights_are_listed_oldest_first_and_this_one_last(tmp_path: Path) -> None:
    for age, name in ((30, "walls-1"), (10, "hop-1"), (20, "ground-9")):
        log = flight(tmp_path, name, bytes(age)) / "flight.tlog"
        os.utime(log, (1e9 - age, 1e9 - age))
    present = flight(tmp_path, "ground-1", bytes(5))
    client = Client(LogService(FlightLogs(present, OWN)))
    assert client.entries() == [(0, 30, 4, 3), (1, 20, 4, 3), (2, 10, 4, 3), (3, 5, 4, 3)]


def test_the_ulog_stands_for_its_flight(tmp_path: Path) -> None:
    directory = flight(tmp_path, "run-1", b"telemetry")
    flight(tmp_path, "run-1", b"everything", "ulg")
    client = Client(LogService(FlightLogs(directory, OWN)))
    client.download(0)
    assert bytes(client.log) == b"everything"


def test_a_link_to_elsewhere_is_no_log(tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.write_bytes(b"secret")
    runs = tmp_path / "runs"
    runs.mkdir()
    present = flight(runs, "run-1", b"")
    (runs / "run-2").mkdir()
    (runs / "run-2" / "flight.tlog").symlink_to(secret)
    flight(tmp_path, "elsewhere", b"secret")
    (runs / "run-3").symlink_to(tmp_path / "elsewhere")
    os.mkfifo(runs / "run-2" / "flight.ulg")
    logs = flight_logs(present, bytes(OWN))
    assert [log.flight for log in logs] == ["run-1"]
    client = Client(LogService(FlightLogs(present, OWN)))
    # Put there later, it cannot be opened either.
    (present / "flight.tlog").unlink()
    (present / "flight.tlog").symlink_to(secret)
    client.download(0)
    assert client.counts == [0]


def test_a_vehicle_without_logs_says_so(tmp_path: Path) -> None:
    empty = tmp_path / "run-1"
    empty.mkdir()
    client = Client(LogService(FlightLogs(empty)))
    assert client.entries() == [(0, 0, 0, 0)]
    client.download(0)
    assert client.counts == []


def test_finished_logs_are_erased_this_flight_s_is_kept_and_the_operator_is_told(
    tmp_path: Path,
) -> None:
    """QGroundControl asks for the list at once, so it must be another one by then."""
    for name in ("run-1", "run-2"):
        flight(tmp_path, name, b"finished", suffix="ulg")
        flight(tmp_path, name, b"finished")
    present = flight(tmp_path, "run-3", b"kept")
    (tmp_path / "run-1" / "result.json").write_text("{}")
    logs = FlightLogs(present, OWN)
    client, other = Client(LogService(logs)), Client(LogService(logs))
    assert len(other.entries()) == 3
    other.ask(ids.LOG_REQUEST_DATA, 0, ALL, 0, 1, 1)
    assert client.ask(ids.LOG_ERASE, 1, 1) == []
    reported = wait_for(lambda: list(client.service.poll(0)))
    assert reported == [StatusText(Severity.INFO, "2 logs erased, this flight's is kept")]
    assert client.entries() == [(0, 4, 1, 0)]
    left = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.glob("*/*.*[gn]"))
    assert left == ["run-1/result.json", "run-3/flight.tlog"]
    other.download(0)
    assert bytes(other.log) == b"kept", "numbers of another list mean nothing any more"
    assert list(vehicle_files(logs)["logs"]) == ["run-3"]  # type: ignore[call-overload]


@pytest.mark.requirement("REQ-LINK-9")
@pytest.mark.parametrize("own", [None, OWN])
def test_only_logs_that_this_vehicle_has_marked_are_listed_served_and_erased(
    tmp_path: Path, own: Path | None
) -> None:
    """A folder of runs has those of other vehicles and other studies too."""
    flight(tmp_path, "mine", b"of this vehicle")
    flight(tmp_path, "other", b"of another", of=Path("/var/other.params"))
    (flight(tmp_path, "unmarked", b"of a study", suffix="ulg") / MARK).unlink()
    huge = flight(tmp_path, "huge", b"of nobody") / MARK
    os.truncate(huge, 1 << 40)
    (flight(tmp_path, "empty", b"of nobody") / MARK).write_bytes(b"")
    logs = FlightLogs(flight(tmp_path, "run", b"kept"), own)
    reached = ["run"] if own is None else ["mine", "run"]
    assert [log.flight for log in logs.all] == reached
    assert list(vehicle_files(logs)["logs"]) == reached  # type: ignore[call-overload]
    erasure = logs.erase()
    counted = f"{len(reached) - 1} log{'' if len(reached) == 2 else 's'} erased"
    said = StatusText(Severity.INFO, f"{counted}, this flight's is kept")
    assert erasure.result(timeout=10.0) == said
    left = {path.parent.name for path in tmp_path.glob("*/flight.*")}
    assert left == {"mine", "other", "unmarked", "huge", "empty", "run"} - {*reached[:-1]}


def test_the_log_of_another_vehicle_that_flies_is_kept_and_told(tmp_path: Path) -> None:
    flight(tmp_path, "over", b"finished")
    flying = flight(tmp_path, "flying", b"of another day", suffix="ulg")
    telemetry = BlockFile(flying / "flight.tlog")
    telemetry.put(b"so far")
    client = Client(LogService(FlightLogs(flight(tmp_path, "here", b"kept"), OWN)))
    client.ask(ids.LOG_ERASE, 1, 1)
    reported = wait_for(lambda: list(client.service.poll(0)))
    kept = "1 log erased, this flight's is kept and 1 of flights that are not over"
    assert reported == [StatusText(Severity.INFO, kept)]
    left = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.glob("*/*.*[gn]"))
    assert left == ["flying/flight.tlog", "flying/flight.ulg", "here/flight.tlog"]
    telemetry.close()
    logs = FlightLogs(tmp_path / "here", OWN)
    erasure = logs.erase()
    said = erasure.result(timeout=10.0).text
    assert said.startswith("1 log erased"), "a flight that is over has given its lock back"


def test_a_log_that_cannot_be_erased_is_told(tmp_path: Path) -> None:
    earlier = flight(tmp_path, "run-1", b"finished")
    client = Client(LogService(FlightLogs(flight(tmp_path, "run-2", b"kept"), OWN)))
    (earlier / "flight.tlog").unlink()  # another client was faster
    client.ask(ids.LOG_ERASE, 1, 1)
    reported = wait_for(lambda: list(client.service.poll(0)))
    (text,) = reported
    assert isinstance(text, StatusText)
    assert text.severity == 4
    assert "0 logs erased" in text.text
    assert "run-1" in text.text


def test_a_flood_of_erasures_starts_one_thread_and_loses_no_outcome(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[threading.Thread] = []
    monkeypatch.setattr(threading.Thread, "start", lambda thread: started.append(thread))
    flight(tmp_path, "run-1", b"finished")
    logs = FlightLogs(flight(tmp_path, "run-2", b"kept"), OWN)
    client, other = Client(LogService(logs)), Client(LogService(logs))
    for _ in range(5):
        client.ask(ids.LOG_ERASE, 1, 1)
        other.ask(ids.LOG_ERASE, 1, 1)
    (thread,) = started
    other.ask(ids.LOG_REQUEST_DATA, 0, ALL, 0, 1, 1)
    client.ask(ids.LOG_ERASE, 1, 1)
    thread.run()
    assert client.polled() == [StatusText(Severity.INFO, "1 log erased, this flight's is kept")]
    assert any(not isinstance(one, StatusText) for one in other.polled()), "the transfer goes on"


def test_an_empty_log_of_an_earlier_flight_is_not_listed(tmp_path: Path) -> None:
    """QGroundControl never comes to the end of a download of nothing."""
    flight(tmp_path, "run-1", b"")
    logs = FlightLogs(flight(tmp_path, "run-2", b""), OWN)
    assert [log.flight for log in logs.all] == ["run-2"]


def test_a_client_that_stops_gets_no_more(tmp_path: Path) -> None:
    client = Client(LogService(FlightLogs(flight(tmp_path, "run-1", bytes(90_000)), OWN)))
    client.ask(ids.LOG_REQUEST_DATA, 0, ALL, 0, 1, 1)
    assert len(client.polled()) == FRAMES_A_TICK
    client.ask(ids.LOG_REQUEST_END, 1, 1)
    assert client.polled() == []


def test_a_request_for_another_log_ends_the_download_of_the_first(tmp_path: Path) -> None:
    flight(tmp_path, "run-1", bytes(90_000))
    client = Client(LogService(FlightLogs(flight(tmp_path, "run-2", b"the other"), OWN)))
    client.ask(ids.LOG_REQUEST_DATA, 0, 0x7FFFFFFF, 0, 1, 1)
    client.polled()
    client.download(1)
    assert bytes(client.log) == b"the other"
