"""The ULog of a flight over LOGGING_DATA, by a client that does what PX4's own script does."""

from __future__ import annotations

import math
import random
import struct
from collections.abc import Sequence
from pathlib import Path

import pytest

from fsw.autopilot.signals import CommandRequest, CommandResult, StatusText
from fsw.link.files.log_stream import PIECE, LogStreamService
from fsw.link.files.vehicle_files import FlightLogs
from fsw.link.services.service import Outcome
from fsw.link.wire.outgoing import Outgoing, ServiceOutput
from messages import message_ids as ids
from messages.frames import Frame, FrameWriter, split

TICK_US = 2_000
CLIENT = (255, 190)


def message(kind: bytes, size: int, seed: int) -> bytes:
    return struct.pack("<Hc", size, kind) + random.Random(seed).randbytes(size)


DEFINITIONS = (
    b"ULog\x01\x12\x35\x01"
    + bytes(8)
    + b"".join(message(b"BFIMP"[n % 5 : n % 5 + 1], 20 + 37 * n % 400, n) for n in range(40))
)
DATA = b"".join(message(b"ADDDL"[n % 5 : n % 5 + 1], 7 + 91 * n % 700, n) for n in range(200))


class Client:
    """It acknowledges what is to be, and puts together what comes."""

    def __init__(self, folder: Path, content: bytes = DEFINITIONS + DATA) -> None:
        self.path = folder / "run" / "flight.ulg"
        self.path.parent.mkdir()
        self.path.write_bytes(content)
        self.service = LogStreamService(FlightLogs(self.path.parent))
        self.t_us = 1_000_000
        self.log = bytearray()
        self.acked = 0
        self.begins: list[int] = []  # of messages, by their offset in the log
        self.numbers: list[int] = []
        self.deaf = False

    def command(
        self, number: int, kind: float = 0.0, who: tuple[int, int] = CLIENT, armed: bool = False
    ) -> Outcome:
        request = CommandRequest(number, (kind, *(math.nan,) * 6), *who)
        return self.service.carry_out(request, self.t_us, armed)

    def take(self, answers: Sequence[ServiceOutput]) -> None:
        for piece in answers:
            assert isinstance(piece, Outgoing)
            (frame,) = split(FrameWriter(1, 1).packed_frame(piece.message_id, piece.values))
            number, system, component, length, begins, *data = frame.payload_values
            assert (system, component) == CLIENT
            if piece.message_id == ids.LOGGING_DATA_ACKED:
                if self.deaf:
                    continue
                self.acked += 1
            if begins != 255:
                self.begins.append(len(self.log) + int(begins))
            self.numbers.append(int(number))
            self.log += bytes(map(int, data[: int(length)]))
            if piece.message_id == ids.LOGGING_DATA_ACKED:
                ack = Frame(*CLIENT, 0, ids.LOGGING_ACK, (number, 1, 1))
                self.take(self.service.handle(ack, self.t_us))

    def fly(self, ticks: int) -> None:
        for _ in range(ticks):
            self.t_us += TICK_US
            self.take(self.service.poll(self.t_us))


def boundaries(content: bytes) -> list[int]:
    at, found = 16, []
    while at < len(content):
        found.append(at)
        at += 3 + int.from_bytes(content[at : at + 2], "little")
    return found


@pytest.fixture
def client(tmp_path: Path) -> Client:
    return Client(tmp_path)


def test_a_client_gets_the_log_as_it_is_and_the_definitions_acknowledged(client: Client) -> None:
    assert client.command(2510) == (CommandResult.ACCEPTED, "")
    client.fly(300)
    whole = DEFINITIONS + DATA
    assert client.log == whole[: len(client.log)]
    assert 0 <= len(whole) - len(client.log) <= PIECE + 3
    assert client.numbers == list(range(len(client.numbers)))
    assert (client.acked - 1) * PIECE < len(DEFINITIONS) <= client.acked * PIECE
    assert set(client.begins) <= set(boundaries(whole))
    assert client.begins[0] == 16


def test_it_follows_the_log_while_it_grows(client: Client) -> None:
    client.command(2510, math.nan)
    whole = DEFINITIONS + DATA
    client.fly(300)
    for n in range(30):
        more = message(b"D", 500 + 13 * n, n)
        whole += more
        with client.path.open("ab") as file:
            file.write(more)
        client.fly(40)
    assert client.log == whole[: len(client.log)]
    assert len(whole) - len(client.log) <= PIECE + 3


def test_a_log_without_data_yet_is_waited_for(tmp_path: Path) -> None:
    client = Client(tmp_path, b"")
    assert client.command(2510) == (CommandResult.ACCEPTED, "")
    client.fly(100)
    assert client.log == b""
    client.path.write_bytes(DEFINITIONS + DATA)
    client.fly(300)
    assert client.log == (DEFINITIONS + DATA)[: len(client.log)]


def test_what_is_not_acknowledged_is_sent_again_and_given_up(client: Client) -> None:
    client.deaf = True
    client.command(2510)
    answers: list[ServiceOutput] = []
    for _ in range(3000):
        client.t_us += TICK_US
        answers += client.service.poll(client.t_us)
    *pieces, text = answers
    assert len({piece.values for piece in pieces if isinstance(piece, Outgoing)}) == 1
    assert len(pieces) == 50
    assert isinstance(text, StatusText)
    assert text.text == "log stream ended: 255/190 acknowledges nothing"


def test_a_stop_ends_it_and_a_start_begins_anew(client: Client) -> None:
    client.command(2510)
    client.fly(5)
    assert client.command(2511) == (CommandResult.ACCEPTED, "")
    before = len(client.log)
    client.fly(50)
    assert len(client.log) == before
    client.log.clear()
    client.numbers.clear()
    client.command(2510)
    client.fly(300)
    assert client.log == (DEFINITIONS + DATA)[: len(client.log)]
    assert client.numbers[0] == 0


def test_what_cannot_be_is_refused_with_its_reason(client: Client, tmp_path: Path) -> None:
    assert client.command(2510, 1.0)[0] == CommandResult.DENIED
    assert "not ULog" in client.command(2510, 7.0)[1]
    assert client.command(2510)[0] == CommandResult.ACCEPTED
    assert client.command(2510, who=(1, 191))[0] == CommandResult.TEMPORARILY_REJECTED
    assert client.command(2511, who=(1, 191))[0] == CommandResult.ACCEPTED
    (tmp_path / "other").mkdir()
    without = LogStreamService(FlightLogs(tmp_path / "other"))
    request = CommandRequest(2510, (0.0,) * 7, *CLIENT)
    result, why = without.carry_out(request, 0, armed=False)
    assert (result, why) == (
        CommandResult.DENIED,
        "log not streamed: this flight writes no flight.ulg",
    )


def test_a_log_that_is_gone_ends_it(client: Client) -> None:
    client.command(2510)
    client.fly(2)
    client.path.unlink()
    client.fly(500)
    assert client.service.poll(client.t_us + 1_000_000) == ()
