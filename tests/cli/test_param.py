"""``pandion param`` on files, in this process."""

from __future__ import annotations

import contextlib
import json
import math
import socket
import threading
import time
from collections.abc import Iterator
from itertools import repeat
from pathlib import Path

import pytest

from fsw.autopilot.parameters.param_type import field_of
from fsw.autopilot.parameters.registry import PARAMETERS
from fsw.storage.parameter_file import load
from messages import message_ids as ids
from messages.addresses import parse_link_address
from messages.frames import FrameWriter, split
from pandion import param, param_vehicle
from pandion.param_vehicle import NoAnswer, ParameterClient, ParameterRefused
from tests.speakers import Flood

DEFAULTS = {parameter.name: parameter.default for parameter in PARAMETERS}


def test_a_file_is_listed_with_defaults_for_what_it_does_not_say(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "v.params"
    file.write_text("PID_YAW_P 5\n")
    assert param.main(["list", "--json", "--file", str(file)]) == 0
    listed = {entry["name"]: entry for entry in json.loads(capsys.readouterr().out)}
    assert {name: entry["value"] for name, entry in listed.items()} == {
        **DEFAULTS,
        "PID_YAW_P": 5.0,
    }
    assert listed["PID_YAW_P"]["default"] == 4.0
    assert param.main(["list", "--changed", "--file", str(file)]) == 0
    (line,) = capsys.readouterr().out.splitlines()
    assert line.split()[:3] == ["PID_YAW_P", "*", "5"]


def test_set_and_get_in_a_new_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    where = ["--file", str(tmp_path / "v.params")]
    assert param.main(["set", "PID_YAW_P", "5", *where]) == 0
    assert param.main(["set", "LND_SPEED", "0.3", *where]) == 0
    assert load(tmp_path / "v.params").values == {"PID_YAW_P": 5.0, "LND_SPEED": 0.3}
    capsys.readouterr()
    assert param.main(["get", "PID_YAW_P", "PID_YAW_D", *where, "--json"]) == 0
    assert [entry["value"] for entry in json.loads(capsys.readouterr().out)] == [5.0, 4.0]


@pytest.mark.parametrize(
    ("arguments", "code", "reported"),
    [
        (["set", "PID_YAW_P", "99"], 1, "PID_YAW_P is to be 0..50, 99 is refused"),
        (["set", "PID_YAW_P", "nan"], 2, "'nan' is not a number"),
        (["set", "PID_YAW_Q", "1"], 1, "unknown parameter PID_YAW_Q; did you mean PID_YAW_P?"),
        (["get", "WAL_ALPHA"], 1, "did you mean WALL_ALPHA?"),
        (["set", "PID_YAW_P", "much"], 2, "'much' is not a number"),
        (["import", "nowhere.params"], 2, "nowhere.params"),
        (["export", "nowhere/x.params"], 2, "nowhere"),
        (["lost"], 2, "unknown action lost; did you mean list?"),
        (["list", "--vehicle=here"], 2, "not of the form udp:HOST:PORT"),
    ],
)
def test_what_cannot_be_done_is_one_sentence(
    arguments: list[str],
    code: int,
    reported: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("v.params").touch()
    where = [] if "--vehicle=here" in arguments else ["--file", "v.params"]
    try:
        ended = param.main([*arguments, *where])
    except SystemExit as exit_:
        ended = exit_.code  # type: ignore[assignment]
    assert ended == code
    error = capsys.readouterr().err
    assert reported in error
    assert error.count("\n") == 1
    assert Path("v.params").read_text() == "", "nothing is written"


@pytest.mark.parametrize(
    ("text", "code", "reported"),
    [
        ("MIS_TAKEOFF_ALT 2\nNAV_DLL_ACT 3\n", 0, "2 parameters read, 2 changed, 0 refused"),
        ("COM_OBL_RC_ACT 0\nMIS_TAKEOFF_ALT 2\n", 1, "1 parameters read, 1 changed, 1 refused"),
        ("NOT_OURS 1\n" * 30, 1, "0 parameters read, 0 changed, 30 refused"),
        ("SYS_AUTOSTART 13\n", 1, "0 parameters read, 0 changed, 1 refused"),
        # The file of another vehicle: what a vehicle states is no parameter to change.
        ("MAV_TYPE 13\n", 0, "0 parameters read, 0 changed, 0 refused"),
    ],
)
def test_an_import_that_refuses_a_line_fails(
    text: str, code: int, reported: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "wanted.params").write_text(text)
    arguments = ["import", str(tmp_path / "wanted.params"), "--file", str(tmp_path / "v.params")]
    assert param.main(arguments) == code
    assert reported in capsys.readouterr().out


def test_an_integer_is_said_and_kept_as_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "v.params"
    where = ["--file", str(file)]
    assert param.main(["set", "NAV_DLL_ACT", "3.0", *where]) == 0
    assert "\tNAV_DLL_ACT\t3\t6\n" in file.read_text()
    assert param.main(["set", "MPC_XY_VEL_MAX", "1.25", *where]) == 0
    assert load(file).values == {"NAV_DLL_ACT": 3, "STR_V_MAX": 1.25}
    assert param.main(["set", "NAV_DLL_ACT", "2.5", *where]) == 1
    assert "NAV_DLL_ACT is an INT32 and must be a whole number" in capsys.readouterr().err
    assert param.main(["get", "NAV_DLL_ACT", "--json", *where]) == 0
    (entry,) = json.loads(capsys.readouterr().out)
    assert (entry["value"], entry["type"]) == (3, "INT32")


@pytest.mark.parametrize(
    ("asked", "sent"), [(2.0, (field_of(2)[0], 6)), (2.5, (2.5, 9)), (float("inf"), (math.inf, 9))]
)
def test_a_vehicle_s_own_type_is_written(asked: float, sent: tuple[float, int]) -> None:
    """An INT32 of another vehicle, which the command cannot know from its table."""
    held, type_ = field_of(1)
    answer = FrameWriter(1, 1).frame(ids.PARAM_VALUE, held, 1, 0, b"OF_ANOTHER", type_)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        vehicle.bind(("127.0.0.1", 0))
        written: list[tuple[object, object]] = []

        def answers() -> None:
            while not written:
                datagram, client = vehicle.recvfrom(2048)
                written.extend(
                    (frame.payload_values[0], frame.payload_values[4])
                    for frame in split(datagram)
                    if frame.message_id == ids.PARAM_SET
                )
                vehicle.sendto(answer, client)

        thread = threading.Thread(target=answers)
        thread.start()
        with ParameterClient(vehicle.getsockname()) as client, pytest.raises(ParameterRefused):
            client.write("OF_ANOTHER", asked)
        thread.join()
    assert written == [sent]


@pytest.mark.parametrize("suffix", ["params", "parm"])
def test_an_export_imported_again_changes_nothing(
    suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source, copy, target = (str(tmp_path / n) for n in ("a.params", f"b.{suffix}", "c.params"))
    param.main(["set", "WALL_LAMBDA", "0.4", "--file", source])
    assert param.main(["export", copy, "--file", source]) == 0
    assert param.main(["import", copy, "--file", target]) == 0
    assert load(Path(target)).values == {"WALL_LAMBDA": 0.4}
    assert "74 parameters read, 1 changed" in capsys.readouterr().out.replace(
        f"{len(PARAMETERS)} parameters read", "74 parameters read"
    )


@contextlib.contextmanager
def vehicle_that_sends(
    datagrams: Iterator[bytes], every_s: float = 0.02
) -> Iterator[tuple[str, int]]:
    """It sends these to the first that speaks to it; where it listens."""
    over = threading.Event()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        vehicle.bind(("127.0.0.1", 0))

        def sends() -> None:
            _, client = vehicle.recvfrom(2048)
            while not over.wait(every_s):
                vehicle.sendto(next(datagrams), client)

        thread = threading.Thread(target=sends)
        thread.start()
        yield vehicle.getsockname()
        over.set()
        thread.join()


def value_of(name: bytes, value: float, count: int, index: int) -> bytes:
    return FrameWriter(1, 1).frame(ids.PARAM_VALUE, value, count, index, name, 9)


@pytest.mark.drawn(1)
@pytest.mark.parametrize(
    ("frame", "missing"),
    [
        (value_of(b"A", 1.0, 2, 0), "1 of 2 parameters came"),
        (value_of(b"_HASH_CHECK", 1.0, 2, 0xFFFF), "nothing came"),
    ],
    ids=["a value", "the checksum"],
)
def test_a_vehicle_that_repeats_itself_is_not_waited_for_again(frame: bytes, missing: str) -> None:
    with (
        vehicle_that_sends(repeat(frame)) as where,
        ParameterClient(where, patience_s=0.3) as client,
        pytest.raises(NoAnswer, match=missing),
    ):
        client.read_all()


def test_a_list_that_only_grows_ends_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(param_vehicle, "_LONGEST_S", 0.2)
    begin, sender = time.monotonic(), FrameWriter(1, 1)
    endless = (
        sender.frame(ids.PARAM_VALUE, 1.0, 4096, index, b"P%d" % index, 9) for index in range(4096)
    )
    with (
        vehicle_that_sends(endless, 0.05) as where,
        ParameterClient(where) as client,
        pytest.raises(NoAnswer),
    ):
        client.read_all()
    assert time.monotonic() - begin < 30.0, "4096 of them would take minutes"


def test_a_stream_that_never_pauses_is_not_waited_for_longer() -> None:
    flood = Flood()
    with contextlib.closing(flood):
        began = time.monotonic()
        with (
            ParameterClient(parse_link_address(flood.address), 0.2) as client,
            pytest.raises(NoAnswer, match="nothing came"),
        ):
            client.read_all()
        with (
            ParameterClient(parse_link_address(flood.address), 0.2) as client,
            pytest.raises(NoAnswer, match="no answer"),
        ):
            client.read("MPC_V_MAX")
    assert time.monotonic() - began < 5.0


def test_an_export_leaves_out_what_a_reader_would_refuse(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "v.params"
    sent = (
        value_of(b"PID_YAW_P", 5.0, 3, 0),
        value_of(b"LND_SPEED", float("nan"), 3, 1),
        value_of(b"WALL_LAMBDA", float("inf"), 3, 2),
    )
    with vehicle_that_sends(repeat(b"".join(sent))) as (host, port):
        assert param.main(["export", str(file), f"--vehicle=udp:{host}:{port}"]) == 1
    printed = capsys.readouterr()
    assert printed.out == f"1 parameters written to {file}\n"
    assert printed.err.count("\n") == 1
    assert "not a finite number: LND_SPEED, WALL_LAMBDA" in printed.err
    loaded = load(file)
    assert (loaded.values, loaded.complaints) == ({"PID_YAW_P": 5.0}, ())


def test_a_file_that_is_not_there_has_no_values(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A name mistyped showed the defaults, as if the file had them."""
    where = ["--file", str(tmp_path / "none.params")]
    for words in (["list"], ["get", "WALL_LAMBDA"], ["export", str(tmp_path / "copy.params")]):
        assert param.main([*words, *where]) == 2
        said = capsys.readouterr()
        assert said.out == ""
        assert "No such file" in said.err
    assert param.main(["set", "WALL_LAMBDA", "0.36", *where]) == 0, "this begins one"
