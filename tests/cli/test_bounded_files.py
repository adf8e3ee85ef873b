"""What is given as a file and is none is refused at once, in one sentence."""

from __future__ import annotations

import os
import signal
import socket
import stat
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from command_line.bounded_file import open_regular, read_bounded
from command_line.bounded_json import MAX_DEPTH, JsonError, json_numbers, json_object, read_json
from command_line.bounded_toml import MAX_PARTS, TomlError, toml_table
from pandion.__main__ import main
from tests.cli.command import one_sentence

_PATIENCE_S = 20  # of a test: what waits for a writer waits for ever


@pytest.fixture(autouse=True)
def impatience() -> Iterator[None]:
    def over(number: int, frame: object) -> None:
        raise TimeoutError("it waits for a writer that never comes")

    before = signal.signal(signal.SIGALRM, over)
    signal.alarm(_PATIENCE_S)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def _socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as bound:
        before = Path.cwd()
        os.chdir(path.parent)  # the name of a socket must be short
        try:
            bound.bind(path.name)
        finally:
            os.chdir(before)


KINDS: dict[str, Callable[[Path], None]] = {
    "pipe": os.mkfifo,
    "endless device": lambda path: path.symlink_to("/dev/zero"),
    "directory": Path.mkdir,
    "socket": _socket,
}
READERS = {
    "scenario": ("given.toml", ["fly", "FILE"]),
    "scenario of sitl": ("given.toml", ["sitl", "FILE", "--listen", "udp:127.0.0.1:0"]),
    "parameters": ("given.params", ["fly", "walls", "--params", "FILE"]),
    "parameters alone": ("given.params", ["param", "list", "--file", "FILE"]),
    "campaign": ("given.toml", ["campaign", "FILE"]),
    "tuning": ("given.toml", ["tune", "FILE"]),
    "expectation": ("given.toml", ["faults", "land", "none", "--expect", "FILE"]),
    "disturbance": ("given.json", ["falsify", "walls", "--replay", "FILE"]),
    "log": ("given.ulg", ["replay", "FILE"]),
    "log to report": ("given.ulg", ["report", "FILE"]),
    "log to view": ("given.ulg", ["view", "FILE"]),
    "log to export": ("given.ulg", ["export", "FILE", "--csv", "csv"]),
    "telemetry log": ("given.tlog", ["view", "FILE"]),
}


@pytest.mark.requirement("REQ-LINK-9")
@pytest.mark.parametrize(
    ("reader", "kind"),
    [*((reader, "pipe") for reader in READERS), *(("scenario", kind) for kind in KINDS)],
)
def test_what_is_no_regular_file_is_refused_and_not_waited_for(
    reader: str,
    kind: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    name, words = READERS[reader]
    KINDS[kind](tmp_path / name)
    try:
        code: object = main([name if word == "FILE" else word for word in words])
    except SystemExit as end:
        code = end.code
    said = capsys.readouterr().err
    assert code == 2, said
    assert one_sentence(said), said
    if kind != "directory":
        assert "it is not a regular file" in said
    assert not (tmp_path / "csv").exists()


@pytest.mark.parametrize("kind", ["pipe", "endless device", "socket"])
def test_only_a_regular_file_is_opened_to_append(kind: str, tmp_path: Path) -> None:
    KINDS[kind](tmp_path / "journal")
    with pytest.raises(OSError, match="it is not a regular file"):
        open_regular(tmp_path / "journal", append=True)
    with open_regular(tmp_path / "new", append=True) as file:
        file.write(b"a")
    with open_regular(tmp_path / "new", append=True) as file:
        file.write(b"b")
    assert (tmp_path / "new").read_bytes() == b"ab"
    assert not stat.S_IMODE((tmp_path / "new").stat().st_mode) & 0o111


def test_a_name_that_no_file_can_have_is_refused() -> None:
    with pytest.raises(OSError, match="cannot be the name of a file"):
        read_bounded(Path("a\0b"), 10)


def test_a_file_of_its_length_is_read_and_a_longer_one_is_not(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"12345")
    assert read_bounded(tmp_path / "file", 5) == b"12345"
    with pytest.raises(OSError, match="must be at most 4 bytes"):
        read_bounded(tmp_path / "file", 4)
    with pytest.raises(OSError, match="must be at most 2 bytes"):
        read_bounded(Path("/proc/self/status"), 2)  # whose length is 0 by its status


LONG = 200_000  # bytes, as much as a scenario may have


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[" * 200_000, "is nested too deeply"),
        ('{"a":' * (MAX_DEPTH + 1) + "1" + "}" * (MAX_DEPTH + 1), "is nested too deeply"),
        ("[]", "must be a JSON object"),
        ("", "is not JSON"),
        ('{"a": NaN}', "holds NaN"),
        ('{"a": [-Infinity]}', "holds -Infinity"),
        ('{"a": -1e999}', "holds -1e999"),
        ('{"a": 18446744073709551616}', "must have at most 64 bits"),
        ('{"a": %s}' % ("9" * 5000), "must have at most 64 bits"),
        ('{"a": {"\\ud800": 1}}', "has a text that is not Unicode"),
        ('{"a": 6000, "b": 1, "a": 6}', "has 'a' 2 times in one object: leave one"),
        ('{"b": [{"a": 1, "\\u0061": 1}]}', "has 'a' 2 times"),
        ('{"%s": 1, "%s": 1}' % (("k" * LONG,) * 2), "has 'k{79}… 2 times in one object"),
    ],
)  # fmt: skip
def test_json_that_nobody_of_us_writes_is_refused(text: str, said: str) -> None:
    with pytest.raises(JsonError, match=said) as refusal:
        json_object(text)
    assert len(str(refusal.value)) < 300


def test_json_that_we_write_is_read() -> None:
    assert json_object('{"a": {"b": [1, -2.5e300, null, true, "ü😀"]}}') == {
        "a": {"b": [1, -2.5e300, None, True, "ü😀"]}
    }
    assert json_numbers('{"a": 1, "b": 0.5, "c": true}') == {"a": 1, "b": 0.5, "c": True}
    with pytest.raises(JsonError, match="b must be a number"):
        json_numbers('{"a": 1, "b": "2"}')


def test_json_in_a_file_that_is_missing_or_too_long(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_json(tmp_path / "none.json", 10)
    (tmp_path / "long.json").write_text('{"a": 123456}')
    with pytest.raises(JsonError, match="cannot be read: it is too long: must be at most 10 bytes"):
        read_json(tmp_path / "long.json", 10)


CHAIN = f"a{'.a' * (MAX_PARTS - 1)}"  # a key of as many parts as it may have


@pytest.mark.requirement("REQ-LINK-9")
@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("a" + ".a" * (LONG // 2) + " = 1", "nested too deeply"),
        ("[a" + ".a" * (LONG // 2) + "]", "nested too deeply"),
        ("x = {a" + " . a" * (LONG // 4) + " = 1}", "nested too deeply"),
        ('"a b"' + "\t.'c.d'" * (LONG // 8) + " = 1", "nested too deeply"),
        (r'"\"".' * (LONG // 5) + "a = 1", "nested too deeply"),
        (r'"\\".' * (LONG // 5) + "a = 1", "nested too deeply"),
        (f"{CHAIN}.a = 1", "nested too deeply"),
        (f"{CHAIN} = 1", None),
        ("a" * LONG + " = 1", "a key must have at most 128 characters, and this has"),
        (f"[[a]]\nb = [{{{'c' * 129} = 1}}]", "a key must have at most 128 characters"),
        (f"{'a' * 128} = 1", None),
        (f"[{'a' * LONG}]\n[{'a' * LONG}]", "not TOML: Cannot declare .*a…a.* twice"),
        ("a = " + "9" * 5000, "an integer of thousands of digits: an integer must have at most 64"),
        (f"[[a]]\nb = [0, {10**400}]", r"a\[0\].b\[1\] = 1000+…: an integer must have at most 64"),
        (f"a = 0x1{'0' * 5000}", "a = a number too long to show: an integer must have at most 64"),
        (f"a = {-(1 << 64) + 1}", None),
        ("a" + " " * LONG + "= 1", None),
        (f"a = [{'1.5, ' * (LONG // 5)}]", None),
        (f"a = '{'.' * LONG}'", None),
        (f"# {'and so on. ' * (LONG // 11)}", None),
        ("".join(f"{CHAIN[:-1]}{k} = 1\n" for k in range(5000)), None),
        ("[" * LONG, "not TOML|nested too deeply"),
        ("'" * LONG, "not TOML"),
        ('"' * LONG, "not TOML"),
        ("a.'" * (LONG // 3), "not TOML"),
    ],
)
def test_toml_is_read_or_refused_in_bounded_time(text: str, complaint: str | None) -> None:
    signal.alarm(5)
    if complaint is None:
        toml_table(text)
    else:
        with pytest.raises(TomlError, match=complaint) as refusal:
            toml_table(text)
        assert len(str(refusal.value)) < 300
