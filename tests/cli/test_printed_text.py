"""What is printed of files, links and command lines: no control character, no NaN in JSON."""

from __future__ import annotations

import ast
import errno
import io
import json
import math
import re
import socket
import threading
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from command_line.output import command_name, json_text, print_error
from command_line.printable import printable
from messages import message_ids as ids
from messages.frames import FrameWriter
from pandion.__main__ import main
from pandion.display import Display
from pandion.param_vehicle import NoAnswer, ParameterClient

ESCAPE = "\x1b[2J\x1b]0;owned\x07\r\nPASS\u202e\udc80"


@given(st.text(st.characters()))
def test_every_text_prints_as_one_line_and_printable_ones_as_they_are(text: str) -> None:
    shown = printable(text)
    assert shown.isprintable()
    if text.isprintable():
        assert shown == text
    shown.encode()


def test_sentences_and_tables_show_escapes_as_text(capsys: pytest.CaptureFixture[str]) -> None:
    print_error("pandion", f"no file {ESCAPE}")
    stream = io.StringIO()
    display = Display(stream)
    display.say(f"text {ESCAPE}")
    result = {"completed": False, "end_reason": ESCAPE, "logs": {"ulg": ESCAPE}}
    display.result(result, [(ESCAPE, ESCAPE)], [(f"margin {ESCAPE}", ESCAPE)])
    for printed in (capsys.readouterr().err, stream.getvalue()):
        assert printed.replace("\n", "").isprintable()
        assert "\\x1b[2J" in printed
        assert "\nPASS" not in printed


@pytest.mark.requirement("REQ-LINK-9")
@pytest.mark.parametrize(
    "words",
    [
        [ESCAPE],
        ["fly", f"{ESCAPE}.toml"],
        ["fly", "walls", f"--{ESCAPE}"],
        ["param", "get", ESCAPE, "--file", "none.params"],
        ["param", "import", f"{ESCAPE}.params", "--file", "none.params"],
        ["replay", ESCAPE],
        ["export", ESCAPE, "--csv", "x"],
    ],
)
def test_no_word_of_a_command_line_reaches_the_terminal_raw(
    words: list[str], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    try:
        code = main(words)
    except SystemExit as end:
        code = int(str(end.code))
    printed = "".join(capsys.readouterr())
    assert code in (1, 2)
    assert printed.replace("\n", "").isprintable(), printed
    assert len(printed.splitlines()) == 1


def test_a_parameter_file_with_escapes_is_reported_without_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "wild.params"
    path.write_text("1\t1\t\x1b[2JX\t\x1b[31m\t9\nMPC_X\x9b2J 3\n")
    main(["param", "list", "--changed", "--file", str(path)])
    printed = "".join(capsys.readouterr())
    assert len(printed.splitlines()) == 2
    assert printed.replace("\n", "").isprintable(), printed


@pytest.mark.parametrize(
    ("error", "sentence"),
    [
        (OSError(errno.ENOENT, "No such file or directory", "a.params"), "a.params: No such file"),
        (OSError(errno.ENOSPC, "No space left on device"), "No space left on device\n"),
        (OSError("the file is too long"), "the file is too long\n"),
    ],
)
def test_an_error_of_the_system_is_said_without_its_number(
    error: OSError, sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    print_error("pandion", error)
    assert capsys.readouterr().err.startswith(f"pandion: {sentence}")


def test_a_sentence_with_a_name_of_any_length_is_printed_short(
    capsys: pytest.CaptureFixture[str],
) -> None:
    print_error("pandion", f"unknown scenario {'k' * 1_000_000}; known: walls")
    said = capsys.readouterr().err
    assert said.startswith("pandion: unknown scenario kkk")
    assert said.endswith("kkk; known: walls\n")
    assert len(said) < 1100
    print_error("pandion", "k" * 1000)
    assert capsys.readouterr().err == f"pandion: {'k' * 1000}\n"


def test_json_knows_no_nan() -> None:
    value = {"a": math.nan, "b": [math.inf, (-math.inf, 1.5)], "c": {"d": math.nan}, "e": "NaN"}
    assert json.loads(json_text(value)) == {
        "a": None,
        "b": [None, [None, 1.5]],
        "c": {"d": None},
        "e": "NaN",
    }


@pytest.fixture(scope="module")
def calls() -> list[tuple[str, str, ast.Call]]:
    """File, name and tree of every call to print or to write JSON in the programs."""
    root = Path(__file__).parents[2]
    return [
        (str(path.relative_to(root)), name, node)
        for folder in ("fsw", "sitl", "pandion", "studies", "benchmarks", "command_line", "view")
        for path in (root / folder).rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call)
        and (name := _name(node.func)) in ("json.dumps", "json.dump", "print")
    ]


def _name(called: ast.expr) -> str:
    """``print`` or ``json.dumps``; empty for what is no name, or one of more parts."""
    if isinstance(called, ast.Attribute) and isinstance(called.value, ast.Name):
        return f"{called.value.id}.{called.attr}"
    return called.id if isinstance(called, ast.Name) else ""


def test_no_program_writes_json_that_may_hold_nan(calls: list[tuple[str, str, ast.Call]]) -> None:
    """``json_text`` is the one way out."""
    wild = {
        file
        for file, name, node in calls
        if name != "print" and "allow_nan" not in [keyword.arg for keyword in node.keywords]
    }
    assert wild == KNOWN


@pytest.mark.requirement("REQ-LINK-9")
def test_every_complaint_is_made_printable(calls: list[tuple[str, str, ast.Call]]) -> None:
    """``complain`` and ``say`` are the one way to standard error."""
    raw = [
        file
        for file, name, node in calls
        if name == "print"
        and any(ast.unparse(keyword.value) == "sys.stderr" for keyword in node.keywords)
    ]
    assert raw == []


# Of a key, of names, or of numbers for a reader of our own.
KNOWN = {
    "benchmarks/bare_loop.py",
    "fsw/log/flight_log.py",
    "fsw/log/json_codec.py",
    "studies/campaign/journal.py",
}


@pytest.mark.parametrize(
    ("count", "index", "name", "sentence"),
    [
        (65_535, 0, b"A", "announces parameter 0 of 65535: there must be at most 4096"),
        (2, 2, b"A", "announces parameter 2 of 2"),
        (1, 0, b"A\nB 1", r"names a parameter 'A\\nB 1'"),
        (1, 0, b"\x1b[2J", r"names a parameter '\\x1b\[2J'"),
        (1, 0, b"", "names a parameter ''"),
    ],
)
def test_a_vehicle_that_lists_nonsense_is_one_sentence(
    count: int, index: int, name: bytes, sentence: str
) -> None:
    vehicle = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    vehicle.bind(("127.0.0.1", 0))
    answer = FrameWriter(1, 1).frame(ids.PARAM_VALUE, 1.0, count, index, name, 9)

    def answers() -> None:
        _, client = vehicle.recvfrom(2048)
        vehicle.sendto(answer, client)

    threading.Thread(target=answers).start()
    with ParameterClient(vehicle.getsockname(), 2.0) as client, pytest.raises(NoAnswer) as refusal:
        client.read_all()
    vehicle.close()
    assert re.search(sentence, str(refusal.value))


def test_a_printed_command_can_be_typed_where_it_was_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "bin" / "pandion"
    program.parent.mkdir()
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", [str(program)])
    monkeypatch.setenv("PATH", "/nowhere")
    assert command_name() == "bin/pandion"
    monkeypatch.setenv("PATH", str(program.parent))
    assert command_name() == "pandion"
    monkeypatch.setattr("sys.argv", ["pytest"])
    assert command_name() == "pandion"
