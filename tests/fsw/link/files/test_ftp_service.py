"""MAVLink FTP: every request is answered, and nothing but the offered files is reached."""

from __future__ import annotations

import os
import random
import struct
import time
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

import pytest

from fsw.link.files.ftp_jobs import MAX_DATA
from fsw.link.files.ftp_service import FtpService
from fsw.link.files.served_file import Directory, DiskFile, MemoryFile
from fsw.link.files.vehicle_files import MARK, FlightLogs, _parameters, vehicle_files
from fsw.link.wire.outgoing import Outgoing
from messages import dialect
from messages import message_ids as ids
from messages.frames import FrameWriter, split
from tests.fsw.link.files.wire_values import values_of

HEADER = struct.Struct("<HBBBBBxI")
FRAMES_A_TICK = 10
SECOND_US = 1_000_000


@dataclass(frozen=True)
class ServiceOutput:
    """A message of the server."""

    sequence: int
    session: int
    opcode: int
    requested: int
    complete: bool
    offset: int
    data: bytes
    to: tuple[int, ...]

    @property
    def refusal(self) -> int | None:
        return self.data[0] if self.opcode == dialect.MAV_FTP_OPCODE_NAK else None


def decoded(outgoing: Outgoing) -> ServiceOutput:
    assert outgoing.message_id == ids.FILE_TRANSFER_PROTOCOL
    network, system, component, *payload = (int(value) for value in values_of(outgoing))
    assert network == 0
    sequence, session, opcode, size, requested, complete, offset = HEADER.unpack_from(
        bytes(payload)
    )
    data = bytes(payload[HEADER.size : HEADER.size + size])
    return ServiceOutput(
        sequence, session, opcode, requested, bool(complete), offset, data, (system, component)
    )


@dataclass
class Client:
    """A ground station."""

    service: FtpService
    component: int = 190
    sequence: int = 0
    t_us: int = SECOND_US
    writer: FrameWriter = field(init=False)

    def __post_init__(self) -> None:
        self.writer = FrameWriter(255, self.component)

    def send(
        self,
        opcode: int,
        data: bytes = b"",
        session: int = 0,
        offset: int = 0,
        size: int | None = None,
        repeat: bool = False,
        target: tuple[int, int] = (1, 1),
    ) -> list[ServiceOutput]:
        """Ask, and poll until there is silence."""
        if not repeat:
            self.sequence = (self.sequence + 1) & 0xFFFF
        size = len(data) if size is None else size
        header = HEADER.pack(self.sequence, session, opcode, size, 0, 0, offset)
        payload = (header + data).ljust(251, b"\0")
        frame = self.writer.frame(ids.FILE_TRANSFER_PROTOCOL, 0, *target, *payload)
        (received,) = split(frame)
        return [decoded(answer) for answer in self.service.handle(received, self.t_us)]

    def polled(self) -> list[ServiceOutput]:
        answers = [decoded(answer) for answer in self.service.poll(self.t_us)]
        assert len(answers) <= FRAMES_A_TICK
        return answers

    def ask(self, opcode: int, data: bytes = b"", **header: int) -> ServiceOutput:
        """The one answer to a request, at once or within a few ticks."""
        answers = self.send(opcode, data, **header)  # type: ignore[arg-type]
        for _ in range(200):
            answers += self.polled()
        (answer,) = answers
        assert answer.requested == opcode
        assert answer.sequence == (self.sequence + 1) & 0xFFFF
        assert answer.to == (255, self.component)
        if opcode != dialect.MAV_FTP_OPCODE_OPENFILERO:
            assert answer.session == header.get("session", 0)
        return answer

    def open(self, path: str) -> tuple[int, int]:
        """(session, size)."""
        answer = self.ask(dialect.MAV_FTP_OPCODE_OPENFILERO, path.encode())
        assert answer.opcode == dialect.MAV_FTP_OPCODE_ACK
        return answer.session, int.from_bytes(answer.data, "little")

    def names(self, path: str) -> list[str]:
        found: list[str] = []
        while True:
            answer = self.ask(
                dialect.MAV_FTP_OPCODE_LISTDIRECTORY, path.encode(), offset=len(found)
            )
            if answer.refusal == dialect.MAV_FTP_ERR_EOF:
                return found
            assert answer.opcode == dialect.MAV_FTP_OPCODE_ACK
            found += [entry.decode() for entry in answer.data.split(b"\0") if entry]

    def burst(self, session: int, offset: int, size: int = MAX_DATA) -> list[ServiceOutput]:
        answers = self.send(
            dialect.MAV_FTP_OPCODE_BURSTREADFILE, session=session, offset=offset, size=size
        )
        while more := self.polled():
            answers += more
        return answers


def serve(**files: bytes) -> Directory:
    return {name: MemoryFile(content) for name, content in files.items()}


CONTENT = random.Random(3).randbytes(100_000)


@pytest.fixture
def client() -> Client:
    return Client(FtpService({"files": serve(a=CONTENT, b=b"b"), "top": MemoryFile(b"t")}))


@pytest.mark.parametrize("root", ["/", "", ".", "//", "/./"])
def test_the_root_is_listed(client: Client, root: str) -> None:
    assert client.names(root) == ["Dfiles", "Ftop\t1"]


def test_a_long_directory_is_listed_piece_by_piece() -> None:
    files = {f"file{n:03}": MemoryFile(b"x") for n in range(300)}
    assert Client(FtpService({"d": files})).names("/d") == [f"F{name}\t1" for name in files]


@pytest.mark.parametrize("size", [1, 100, MAX_DATA])
def test_reading_gives_the_file(client: Client, size: int) -> None:
    session, total = client.open("/files/a")
    assert total == len(CONTENT)
    for offset in (0, 1, 5000, total - 1):
        answer = client.ask(
            dialect.MAV_FTP_OPCODE_READFILE, session=session, offset=offset, size=size
        )
        assert answer.data == CONTENT[offset : offset + size]
        assert answer.offset == offset
    answer = client.ask(dialect.MAV_FTP_OPCODE_READFILE, session=session, offset=total, size=size)
    assert answer.refusal == dialect.MAV_FTP_ERR_EOF


@pytest.mark.parametrize("size", [0, 4, 80, MAX_DATA])
def test_bursts_give_the_file_in_pieces_as_large_as_fit(client: Client, size: int) -> None:
    """PX4 does so too: autopilot-tools asks for pieces of 4 bytes, MAVProxy for 80."""
    session, total = client.open("files/a")
    read = b""
    while len(read) < total:
        client.sequence = 65_000  # it must go round
        pieces = client.burst(session, len(read), size)
        for number, piece in enumerate(pieces, start=1):
            assert piece.sequence == (client.sequence + number) & 0xFFFF
            assert piece.offset == len(read)
            assert piece.complete == (number == len(pieces))
            assert len(piece.data) == min(MAX_DATA, total - len(read))
            read += piece.data
    assert read == CONTENT
    (end,) = client.burst(session, total, size)
    assert end.refusal == dialect.MAV_FTP_ERR_EOF


def test_the_checksum_is_the_one_of_the_specification(client: Client) -> None:
    crc = 0
    for byte in CONTENT:  # reflected 0x04C11DB7, no inversion at either end
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xEDB88320 if crc & 1 else 0)
    answer = client.ask(dialect.MAV_FTP_OPCODE_CALCFILECRC, b"/files/a")
    assert answer.data == crc.to_bytes(4, "little")


def test_a_checksum_takes_a_little_of_many_ticks(client: Client) -> None:
    big = Client(FtpService(serve(big=bytes(1 << 20))))
    assert big.send(dialect.MAV_FTP_OPCODE_CALCFILECRC, b"big") == []
    ticks = 0
    while not big.polled():
        ticks += 1
        assert big.send(dialect.MAV_FTP_OPCODE_CALCFILECRC, b"big", repeat=True) == []
    assert ticks == 16


OUTSIDE = [
    "..",
    "/..",
    "../secret",
    "/files/../../secret",
    "files/../top",
    "/etc/passwd",
    "//etc/passwd",
    "~",
    "files/a/..",
    "files\\..",
    "@PARAM/param.pck.gz",
    "@SYS/threads.txt",
]


@pytest.mark.parametrize("path", OUTSIDE)
@pytest.mark.parametrize(
    "opcode",
    [
        dialect.MAV_FTP_OPCODE_OPENFILERO,
        dialect.MAV_FTP_OPCODE_LISTDIRECTORY,
        dialect.MAV_FTP_OPCODE_CALCFILECRC,
    ],
)
def test_there_is_no_way_out_of_the_tree(client: Client, opcode: int, path: str) -> None:
    assert client.ask(opcode, path.encode()).refusal == dialect.MAV_FTP_ERR_FILENOTFOUND


@pytest.mark.parametrize("path", [b"\xff\xfe", b"/files/\xc3\x28", b"files/a/x", b"files"])
def test_what_is_no_file_is_not_found(client: Client, path: bytes) -> None:
    assert (
        client.ask(dialect.MAV_FTP_OPCODE_OPENFILERO, path).refusal
        == dialect.MAV_FTP_ERR_FILENOTFOUND
    )


def test_a_link_in_the_place_of_a_log_is_not_followed(tmp_path: Path) -> None:
    secret, log = tmp_path / "secret", tmp_path / "run" / "flight.tlog"
    secret.write_bytes(b"secret")
    log.parent.mkdir()
    log.write_bytes(b"log")
    client = Client(FtpService(vehicle_files(FlightLogs(log.parent))))
    assert client.names("/logs/run") == ["Fflight.tlog\t3"]
    log.unlink()
    log.symlink_to(secret)
    path = b"/logs/run/flight.tlog"
    assert (
        client.ask(dialect.MAV_FTP_OPCODE_OPENFILERO, path).refusal
        == dialect.MAV_FTP_ERR_FILENOTFOUND
    )
    assert (
        client.ask(dialect.MAV_FTP_OPCODE_CALCFILECRC, path).refusal
        == dialect.MAV_FTP_ERR_FILENOTFOUND
    )
    log.unlink()
    os.mkfifo(log)
    assert (
        client.ask(dialect.MAV_FTP_OPCODE_OPENFILERO, path).refusal
        == dialect.MAV_FTP_ERR_FILENOTFOUND
    )
    assert (
        client.send(dialect.MAV_FTP_OPCODE_TERMINATESESSION)[0].refusal
        == dialect.MAV_FTP_ERR_INVALIDSESSION
    )


@pytest.mark.parametrize(
    "opcode", range(dialect.MAV_FTP_OPCODE_CREATEFILE, dialect.MAV_FTP_OPCODE_RENAME + 1)
)
def test_writing_is_refused_at_once(client: Client, opcode: int) -> None:
    (answer,) = client.send(opcode, b"/files/b")
    assert answer.refusal == dialect.MAV_FTP_ERR_FILEPROTECTED


@pytest.mark.parametrize("opcode", [0, 16, 100, 128, 129, 255])
def test_an_unknown_request_is_refused_at_once(client: Client, opcode: int) -> None:
    (answer,) = client.send(opcode)
    assert answer.refusal == dialect.MAV_FTP_ERR_UNKNOWNCOMMAND
    assert answer.requested == opcode


def test_more_data_than_fit_are_refused(client: Client) -> None:
    (answer,) = client.send(dialect.MAV_FTP_OPCODE_OPENFILERO, b"/top", size=240)
    assert answer.refusal == dialect.MAV_FTP_ERR_INVALIDDATASIZE


def test_a_repeated_open_opens_once_and_a_repeated_close_succeeds(client: Client) -> None:
    first = client.send(dialect.MAV_FTP_OPCODE_OPENFILERO, b"/top")
    assert client.send(dialect.MAV_FTP_OPCODE_OPENFILERO, b"/top", repeat=True) == first
    second = client.ask(dialect.MAV_FTP_OPCODE_OPENFILERO, b"/top")
    assert (first[0].session, second.session) == (0, 1)
    closed = client.send(dialect.MAV_FTP_OPCODE_TERMINATESESSION, session=0)
    assert client.send(dialect.MAV_FTP_OPCODE_TERMINATESESSION, session=0, repeat=True) == closed
    assert closed[0].opcode == dialect.MAV_FTP_OPCODE_ACK
    again = client.ask(dialect.MAV_FTP_OPCODE_TERMINATESESSION, session=0)
    assert again.refusal == dialect.MAV_FTP_ERR_INVALIDSESSION


def test_sessions_are_few_and_come_back_when_their_client_has_gone(client: Client) -> None:
    for number in range(8):
        assert client.open("/top")[0] == number
    refused = client.ask(dialect.MAV_FTP_OPCODE_OPENFILERO, b"/top")
    assert refused.refusal == dialect.MAV_FTP_ERR_NOSESSIONSAVAILABLE
    client.t_us += 29 * SECOND_US
    client.ask(dialect.MAV_FTP_OPCODE_READFILE, session=0, size=1)
    client.t_us += 2 * SECOND_US
    assert client.open("/top")[0] == 1


def test_a_tick_works_on_one_checksum(client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    """Twelve of them read and summed 780 kB in each tick."""
    summed: list[int] = []
    monkeypatch.setattr(zlib, "crc32", lambda data, crc: summed.append(len(data)) or crc)
    frames = [
        split(FrameWriter(system, 1).frame(ids.FILE_TRANSFER_PROTOCOL, *request))[0]
        for system in range(10, 15)
        for request in [(0, 1, 1, *HEADER.pack(1, 0, 14, 4, 0, 0, 0), *b"/top".ljust(239, b"\0"))]
    ]
    for frame in frames:
        assert client.service.handle(frame, client.t_us) == ()
    client.service.poll(client.t_us)
    assert len(summed) == 1


def test_one_client_cannot_hold_all_sessions(client: Client) -> None:
    for _ in range(8):
        client.open("/top")
    client.t_us += SECOND_US
    client.ask(dialect.MAV_FTP_OPCODE_READFILE, session=0, size=1)
    other = Client(client.service, component=1, t_us=client.t_us)
    other.open("/top")
    assert (
        client.ask(dialect.MAV_FTP_OPCODE_READFILE, session=0, size=1).opcode
        == dialect.MAV_FTP_OPCODE_ACK
    )
    gone = client.ask(dialect.MAV_FTP_OPCODE_READFILE, session=1, size=1)
    assert gone.refusal == dialect.MAV_FTP_ERR_INVALIDSESSION, "the one that was used longest ago"


def test_a_client_may_choose_the_number_of_its_session(client: Client) -> None:
    (chosen,) = client.send(dialect.MAV_FTP_OPCODE_OPENFILERO, b"/top", session=231)
    (again,) = client.send(dialect.MAV_FTP_OPCODE_OPENFILERO, b"/files/b", session=231)
    assert (chosen.session, again.session) == (231, 0)
    assert client.ask(dialect.MAV_FTP_OPCODE_READFILE, session=231, size=1).data == b"t"
    assert client.ask(dialect.MAV_FTP_OPCODE_READFILE, session=0, size=1).data == b"b"
    assert client.send(dialect.MAV_FTP_OPCODE_LISTDIRECTORY, b"/", session=77)[0].session == 77
    assert client.send(dialect.MAV_FTP_OPCODE_REMOVEFILE, b"/top", session=78)[0].session == 78


def test_a_reset_closes_the_sessions_of_the_one_who_asks(client: Client) -> None:
    other = Client(client.service, component=230)
    mine, theirs = client.open("/top")[0], other.open("/top")[0]
    assert client.ask(dialect.MAV_FTP_OPCODE_RESETSESSION).opcode == dialect.MAV_FTP_OPCODE_ACK
    lost = client.ask(dialect.MAV_FTP_OPCODE_READFILE, session=mine, size=1)
    assert lost.refusal == dialect.MAV_FTP_ERR_INVALIDSESSION
    assert other.ask(dialect.MAV_FTP_OPCODE_READFILE, session=theirs, size=1).data == b"t"


def test_nobody_reads_or_closes_the_session_of_another(client: Client) -> None:
    session, _ = client.open("/top")
    other = Client(client.service, component=230)
    for opcode in (
        dialect.MAV_FTP_OPCODE_READFILE,
        dialect.MAV_FTP_OPCODE_BURSTREADFILE,
        dialect.MAV_FTP_OPCODE_TERMINATESESSION,
    ):
        refused = other.ask(opcode, session=session, size=1)
        assert refused.refusal == dialect.MAV_FTP_ERR_INVALIDSESSION
    assert client.ask(dialect.MAV_FTP_OPCODE_READFILE, session=session, size=1).data == b"t"


def test_two_clients_share_the_ticks(client: Client) -> None:
    other = Client(client.service, component=230)
    sessions = [(each, each.open("/files/a")[0]) for each in (client, other)]
    for each, session in sessions:
        each.send(dialect.MAV_FTP_OPCODE_BURSTREADFILE, session=session, size=MAX_DATA)
    receivers = [answer.to[1] for answer in client.polled()]
    assert receivers.count(190) == receivers.count(230) == FRAMES_A_TICK // 2


def test_a_closed_session_sends_no_more(client: Client) -> None:
    session, _ = client.open("/files/a")
    client.send(dialect.MAV_FTP_OPCODE_BURSTREADFILE, session=session, size=MAX_DATA)
    assert client.polled()
    client.send(dialect.MAV_FTP_OPCODE_TERMINATESESSION, session=session)
    assert client.polled() == []


def test_a_file_has_the_size_of_its_opening_while_it_grows(tmp_path: Path) -> None:
    path = tmp_path / "growing"
    path.write_bytes(CONTENT)
    client = Client(FtpService({"growing": DiskFile(path)}))
    session, size = client.open("growing")
    with path.open("ab") as file:
        file.write(b"more" * 1000)
    read = b""
    while len(read) < size:
        read += b"".join(piece.data for piece in client.burst(session, len(read)))
    assert read == CONTENT
    assert client.burst(session, size)[0].refusal == dialect.MAV_FTP_ERR_EOF


def test_a_file_that_became_shorter_is_a_failure_and_not_silence(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(CONTENT)
    client = Client(FtpService({"file": DiskFile(path)}))
    session, _ = client.open("file")
    path.write_bytes(b"")
    answer = client.ask(dialect.MAV_FTP_OPCODE_READFILE, session=session, offset=100, size=10)
    assert answer.refusal == dialect.MAV_FTP_ERR_FAIL


def test_names_that_do_not_fit_a_message_are_left_out(tmp_path: Path) -> None:
    for name in ("n" * 230, "tab\there", "plain"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "flight.tlog").write_bytes(b"log")
    tree = vehicle_files(FlightLogs(tmp_path / "plain"))
    logs = tree["logs"]
    assert isinstance(logs, Mapping)
    assert list(logs) == ["plain"]


GIB = 1 << 30
LAST = 0xFFFFFFFF  # bytes of a file that the protocol's fields of 32 bits can name


@dataclass
class HugeFile:
    """An open file in nobody's memory."""

    size: int
    closed: bool = False

    def read(self, offset: int, count: int) -> bytes:
        return bytes(max(0, min(count, self.size - offset)))

    def close(self) -> None:
        self.closed = True


@dataclass
class Huge:
    """What it is opened from."""

    file: HugeFile

    @property
    def size(self) -> int:
        return self.file.size

    def open(self) -> HugeFile:
        return self.file


@pytest.mark.requirement("REQ-LINK-9")
@pytest.mark.parametrize("length", [LAST - 1, LAST, LAST + 1, 6 * GIB, 1 << 45])
def test_of_a_log_of_any_size_what_the_protocol_can_name_is_served(length: int) -> None:
    file = HugeFile(length)
    client = Client(FtpService({"huge": Huge(file)}))  # type: ignore[dict-item]
    served = min(length, LAST)
    assert client.names("/") == [f"Fhuge\t{served}"]
    session, size = client.open("huge")
    assert size == served
    (last,) = client.burst(session, served - 100)
    assert (len(last.data), last.complete) == (100, True)
    for offset in (served, LAST):
        answer = client.ask(
            dialect.MAV_FTP_OPCODE_READFILE, session=session, offset=offset, size=10
        )
        assert answer.refusal == dialect.MAV_FTP_ERR_EOF
    assert (
        len(
            client.ask(
                dialect.MAV_FTP_OPCODE_READFILE, session=session, offset=served - 3, size=9
            ).data
        )
        == 3
    )
    assert (
        client.ask(dialect.MAV_FTP_OPCODE_TERMINATESESSION, session=session).opcode
        == dialect.MAV_FTP_OPCODE_ACK
    )
    assert file.closed


def test_a_sparse_log_beyond_4_gib_is_read_from_the_disk_up_to_there(tmp_path: Path) -> None:
    log = tmp_path / "flight.ulg"
    with log.open("wb") as file:
        file.seek(LAST - 5)
        file.write(b"nearly" + b"beyond")
        file.truncate(5 * GIB)
    client = Client(FtpService({"flight.ulg": DiskFile(log)}))
    session, size = client.open("flight.ulg")
    assert size == LAST
    (last,) = client.burst(session, LAST - 5)
    assert (last.data, last.complete) == (b"nearl", True)
    client.send(
        dialect.MAV_FTP_OPCODE_BURSTREADFILE, session=session, offset=LAST - 500, size=MAX_DATA
    )
    assert sum(len(piece.data) for piece in client.polled()) == 500


def flown(folder: Path, name: str, begun: str, mark: bytes) -> bytes:
    """A flight of a vehicle that began at a time (UTC); what is in its log."""
    (folder / name).mkdir()
    (folder / name / "flight.ulg").write_bytes(name.encode())
    (folder / name / MARK).write_bytes(mark)
    begun_s = datetime.fromisoformat(f"{begun}+00:00").timestamp()
    os.utime(folder / name / MARK, (begun_s, begun_s))
    return name.encode()


@pytest.mark.parametrize("root", ["/log", "/fs/microsd/log", "/fs/microsd/log/", "log"])
def test_logs_are_where_px4_has_them_by_date(tmp_path: Path, root: str) -> None:
    """What autopilot-tools does: the newest by date and time of all in the folders of a folder."""
    parameters = tmp_path / "v.params"
    mark = bytes(parameters.resolve())
    flown(tmp_path, "b", "2026-11-24T23:59:59", mark)
    flown(tmp_path, "c", "2026-11-24T23:59:59", mark)
    flown(tmp_path, "a", "2026-11-24T01:02:03", mark)
    flown(tmp_path, "of another", "2026-11-24T02:00:00", b"/another.params")
    (tmp_path / "now").mkdir()
    (tmp_path / "now" / "flight.ulg").write_bytes(b"now")
    logs = FlightLogs(tmp_path / "now", parameters)
    client = Client(FtpService(vehicle_files(logs)))
    today = time.strftime("%Y-%m-%d", time.gmtime((tmp_path / "now" / MARK).stat().st_mtime))
    assert client.names(root) == ["D2026-11-24", "D2026-11-25", f"D{today}"]
    folder = root.rstrip("/")
    assert client.names(f"{folder}/2026-11-24") == ["F01_02_03.ulg\t1", "F23_59_59.ulg\t1"]
    assert client.names(f"{folder}/2026-11-25") == ["F00_00_00.ulg\t1"]
    (newest,) = client.names(f"{folder}/{today}")
    name, size = newest[1:].split("\t")
    datetime.strptime(f"{today} {Path(name).stem}", "%Y-%m-%d %H_%M_%S")
    assert size == "3"
    session, _ = client.open(f"{folder}/{today}/{name}")
    assert client.burst(session, 0, 4)[0].data == b"now"
    erasure = logs.erase()
    while not erasure.done():
        time.sleep(0.001)
    assert client.names(root) == [f"D{today}"]


def test_a_flight_keeps_its_date_when_it_is_an_earlier_one(tmp_path: Path) -> None:
    parameters = tmp_path / "v.params"
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "flight.ulg").write_bytes(b"x")
    before = FlightLogs(tmp_path / "first", parameters).all[-1]
    (tmp_path / "first" / "flight.ulg").write_bytes(b"it went on for long")
    os.utime(tmp_path / "first" / "flight.ulg", (4e9, 4e9))
    (earlier, _) = FlightLogs(tmp_path / "second", parameters).all
    assert (earlier.flight, earlier.begun_s) == ("first", before.begun_s)


def test_a_directory_of_flights_is_laid_out_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each request for it looked at all 1000 flights, for several hundred microseconds."""
    for name in ("a", "b", "c"):
        (tmp_path / name).mkdir()
        (tmp_path / name / MARK).write_bytes(bytes(tmp_path / "vehicle.params"))
        (tmp_path / name / "flight.ulg").write_bytes(b"log")
    files = vehicle_files(FlightLogs(tmp_path / "c", tmp_path / "vehicle.params"))
    monkeypatch.setattr("fsw.link.files.vehicle_files._can_be_listed", None)
    (listed,) = Client(FtpService(files)).send(
        dialect.MAV_FTP_OPCODE_LISTDIRECTORY, b"/logs", offset=1
    )
    assert listed.data == b"Db\0Dc\0"


def test_no_tick_makes_a_document(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first list of the root in flight wrote 66 kB of JSON, for 12 ms."""
    (tmp_path / "run").mkdir()
    _parameters.cache_clear()
    files = vehicle_files(FlightLogs(tmp_path / "run"))
    monkeypatch.setattr("fsw.autopilot.parameters.metadata.parameter_document", None)
    (listed,) = Client(FtpService(files)).send(dialect.MAV_FTP_OPCODE_LISTDIRECTORY, b"/")
    assert b"parameters.json" in listed.data
