"""A log with a wrong byte or without its end is read up to there, or refused in one sentence."""

from __future__ import annotations

import json
import random
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from fsw.autopilot.signals import TickInputs
from fsw.log.json_codec import JsonCodec
from fsw.log.topics import BY_NAME, NUMBERS
from messages import ulog
from messages.ulog_reader import open_log
from pandion import export, replay
from tests.cli.command import one_sentence
from tests.replay.recorded import flight, written

SECONDS = 0.12
SENSORS = ulog.data_head(NUMBERS["sensor_frame"], BY_NAME["sensor_frame"])
COMMANDS: dict[str, Callable[[Path], int]] = {
    "verify": lambda log: replay.main([str(log), "--verify", "--json", str(log.parent / "j")]),
    "show": lambda log: replay.main([str(log)]),
    "csv": lambda log: export.main([str(log), "--csv", str(log.parent / "csv")]),
    "mcap": lambda log: export.main([str(log), "--mcap", str(log.parent / "mcap")]),
}
each_command = pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return written(tmp_path_factory.mktemp("whole") / "flight.ulg", flight(SECONDS)).read_bytes()


@pytest.fixture
def definitions(whole: bytes, tmp_path: Path) -> int:
    """Bytes that stand before the data."""
    (tmp_path / "whole.ulg").write_bytes(whole)
    return open_log(tmp_path / "whole.ulg").at


class Attempt:
    """Runs a command on a file, and looks at how it ends."""

    def __init__(
        self, command: Callable[[Path], int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        self.log = tmp_path / "flight.ulg"
        self._command = command
        self._capsys = capsys

    def __call__(self, content: bytes | bytearray) -> int:
        self.log.write_bytes(content)
        code = self._command(self.log)
        output = self._capsys.readouterr()
        assert "Traceback" not in output.err + output.out
        assert code in (0, 1, 2)
        assert output.err == "" if code < 2 else one_sentence(output.err)
        return code


@pytest.mark.drawn(1)
@pytest.mark.parametrize(
    ("flips", "refused_least"), [(8, 2), pytest.param(120, 41, marks=pytest.mark.long)]
)
@each_command
def test_a_byte_flipped_anywhere_is_no_traceback(
    flips: int,
    refused_least: int,
    command: Callable[[Path], int],
    whole: bytes,
    definitions: int,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    attempt, chance = Attempt(command, tmp_path, capsys), random.Random(1)
    assert attempt(whole) == 0
    refused = 0
    for first, last in ((0, definitions), (definitions, len(whole))):
        for _ in range(flips):
            damaged = bytearray(whole)
            damaged[chance.randrange(first, last)] ^= chance.randrange(1, 256)
            refused += attempt(damaged) == 2
    # Most flips are in text and numbers, which may be anything, and eight are few.
    assert refused >= refused_least


@pytest.mark.long
@each_command
def test_a_log_cut_among_its_definitions_is_refused_and_among_its_data_read_up_to_there(
    command: Callable[[Path], int],
    whole: bytes,
    definitions: int,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    attempt, chance = Attempt(command, tmp_path, capsys), random.Random(2)
    second_tick = whole.index(SENSORS, whole.index(SENSORS) + 1)
    for _ in range(20):
        assert attempt(whole[: chance.randrange(definitions)]) == 2
    for _ in range(20):
        assert attempt(whole[: chance.randrange(second_tick + len(SENSORS), len(whole))]) == 0


@pytest.mark.long
def test_a_log_cut_between_two_records_is_compared_up_to_its_last_whole_tick(
    whole: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    attempt = Attempt(COMMANDS["verify"], tmp_path, capsys)
    attempt.log.write_bytes(whole)
    log = open_log(attempt.log)
    ends = [(log.at, record) for record in log.records()]
    starts = [k for k, (_, r) in enumerate(ends) if r.number == NUMBERS["sensor_frame"]]
    ticks = len(starts)
    for k in range(starts[-2], len(ends)):
        assert attempt(whole[: ends[k][0]]) == 0
        found = json.loads((tmp_path / "j").read_text())
        complete = k == len(ends) - 1
        begun = sum(start <= k for start in starts)
        assert (found["ticks"], found["whole"]) == (ticks if complete else begun - 1, complete)
        assert found["difference"] is None


@pytest.mark.parametrize(
    ("was", "becomes", "reported"),
    [
        (b":uint64_t timestamp;double", b":uint64_t timestamp;doublx", "unknown type 'doublx'"),
        (b"sensor_frame:", b"sensor_frume:", "fields than this build"),
        (b"\0\0\0sensor_frame", b"\0\0\0sensor_frume", "topic 'sensor_frume' was not declared"),
        (b"char[3] controller", b"char[3] contrXller", "its controller is missing"),
        (b'"origin.latitude"', b'"origin.latitudX"', "its origin is missing"),
        (b"D\x00\x00", b"X\x00\x00", "is damaged at byte"),
    ],
    ids=["type", "format", "subscription", "fact", "number", "kind"],
)
def test_what_is_wrong_is_named(
    was: bytes,
    becomes: bytes,
    reported: str,
    whole: bytes,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    log = tmp_path / "flight.ulg"
    log.write_bytes(whole)
    data = open_log(log).at if was.startswith(b"D") else 0  # numbers among definitions look so too
    assert was in whole[data:]
    log.write_bytes(whole[:data] + whole[data:].replace(was, becomes, 1))
    assert replay.main([str(log), "--verify"]) == 2
    sentence = capsys.readouterr().err
    assert reported in sentence
    assert one_sentence(sentence)


@pytest.mark.requirement("REQ-LINK-9")
@pytest.mark.parametrize(
    ("numbers", "said"),
    [
        ("[" * 7679, "its information numbers is nested too deeply"),
        ("[]", "its information numbers must be a JSON object"),
        ('{"a": "b"}', "a must be a number"),
        ('{"a": NaN}', "holds NaN"),
    ],
)
def test_numbers_that_are_none_are_refused(
    numbers: str, said: str, whole: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    key = re.search(rb"char\[\d+\] numbers", whole)
    assert key is not None
    head = key.start() - 4  # length, kind and the key's own length
    end = head + 3 + int.from_bytes(whole[head : head + 2], "little")
    log = tmp_path / "flight.ulg"
    log.write_bytes(whole[:head] + ulog.information("numbers", numbers) + whole[end:])
    assert COMMANDS["verify"](log) == 2
    sentence = capsys.readouterr().err
    assert said in sentence
    assert one_sentence(sentence)


def test_an_input_that_is_nested_deeply_is_refused() -> None:
    with pytest.raises(ValueError, match="input announced cannot be read: nested too deeply"):
        JsonCodec(TickInputs).decode("announced", b"[" * 50_000)


def test_an_unknown_type_is_refused_where_it_is_used(
    whole: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "flight.ulg"
    log.write_bytes(whole.replace(b"double[3] p_WB", b"nested[3] p_WB", 1))
    assert COMMANDS["csv"](log) == 2
    assert "p_WB has the unknown type 'nested'" in capsys.readouterr().err


def test_a_last_record_whose_length_is_wrong_is_not_taken_for_one_that_was_cut(
    whole: bytes, definitions: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    damaged = bytearray(whole)
    last = whole.rindex(SENSORS)
    damaged[last + 1] ^= 0x80  # the length's upper byte: far behind the end
    log = tmp_path / "flight.ulg"
    log.write_bytes(damaged)
    assert COMMANDS["verify"](log) == 2
    assert f"is damaged at byte {last}" in capsys.readouterr().err
