"""Readers of files that somebody else may have written take no more than linear time."""

from __future__ import annotations

import contextlib
import gc
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from command_line.bounded_json import json_object
from command_line.bounded_toml import MAX_PARTS, toml_table
from fsw.storage.parameter_file import parse
from messages import ulog
from messages.frames import cut
from messages.ulog_reader import UlogError, open_log
from studies.campaign.journal import Journal, lines

SHORT, LONG = 10_000, 40_000  # pieces; a scenario may have 256 kB
# Four times the text takes four times as long, or sixteen where time is quadratic.
MAX_RATIO = 10.0
RESOLVED_S = 0.02  # what is quicker with the long one is linear enough

CHAIN = ".".join("a" * (MAX_PARTS - 1))
TOML: dict[str, Callable[[int], str]] = {
    "escaped quotes, no end": lambda n: '"' + '\\"' * n,
    "escaped quotes, no end, in a key": lambda n: 'a.b."' + '\\"' * n,
    "escaped quotes, no end, a line each": lambda n: ('"' + '\\"' * 99 + "\n") * (n // 100),
    "backslashes, no end": lambda n: '"' + "\\" * (2 * n),
    "quotes": lambda n: '"' * n,
    "quotes after a word": lambda n: 'a"' * n,
    "three quotes, then others": lambda n: 'a = """' + '"" ' * n,
    "three apostrophes, then others": lambda n: "a = '''" + "'' " * n,
    "escapes in a long text": lambda n: 'a = """' + '\\""' * n,
    "both kinds of quotes": lambda n: "\"'" * n,
    "apostrophes": lambda n: "' " * n,
    "keys of the most parts": lambda n: f"{CHAIN} " * (n // 15),
    "quoted parts": lambda n: ".".join(['"' + '\\"' * (n // 15) + '"'] * 15),
    "words and blanks": lambda n: ("a" + " " * 50) * (n // 50),
    "a word, then blanks": lambda n: "a" + " \t" * n,
    "dots": lambda n: "a . . " * n,
    "comments": lambda n: "# it's \"\n" * n,
    "tables": lambda n: "".join(f"[t{k}.a.b]\nc = 1\n" for k in range(n // 4)),
    "arrays of tables": lambda n: "[[a.b]]\n" * (n // 2),
    "an inline table": lambda n: "a = {" + ", ".join(f"b{k}.c = 1" for k in range(n // 4)) + "}",
    "brackets": lambda n: "a = " + "[" * n,
    "digits": lambda n: "a = " + "1_" * n,
    "a hexadecimal": lambda n: "a = 0x" + "f" * n,
    "a text that is read": lambda n: "a = '" + "." * n + "'",
}
READERS: dict[str, Callable[[str], object]] = {
    "TOML": toml_table,
    "JSON": json_object,
    "parameters": parse,
    "datagram": lambda text: list(cut(text.encode("latin-1"))),
}
OTHERS: dict[str, tuple[str, Callable[[int], str]]] = {
    "JSON of brackets": ("JSON", lambda n: "[" * n),
    "JSON of quotes": ("JSON", lambda n: '{"' + '\\"' * n),
    "JSON of digits": ("JSON", lambda n: '{"a": ' + "9" * n + "}"),
    "JSON of a fraction": ("JSON", lambda n: '{"a": 0.' + "9" * n + "}"),
    "JSON of objects": ("JSON", lambda n: '{"a": [' + "{}, " * n + "{}]}"),
    "JSON of texts": ("JSON", lambda n: '{"a": [' + '"\\u00fc", ' * n + '""]}'),
    "parameters of commas": ("parameters", lambda n: "," * n),
    "parameters of words": ("parameters", lambda n: "a " * n),
    "parameters of lines": ("parameters", lambda n: "TRK_WIND_MAX 9\n" * n),
    "parameters of digits": ("parameters", lambda n: "TRK_WIND_MAX " + "9" * n),
    "start markers": ("datagram", lambda n: "\xfd" * n),
    "start markers of MAVLink 1": ("datagram", lambda n: "\xfe" * n),
    "markers and noise": ("datagram", lambda n: "\xfd\xff\xfe\0" * n),
}


def seconds(use: Callable[[], object]) -> float:
    """The shortest of three tries; a refusal is an answer."""
    took = []
    gc.collect()
    gc.disable()  # it looks at all that other tests have left
    try:
        for _ in range(3):
            begin = time.thread_time()
            with contextlib.suppress(ValueError, UlogError):
                use()
            took.append(time.thread_time() - begin)
            if took[-1] > 2.0:
                break
    finally:
        gc.enable()
    return min(took)


def assert_linear(short: Callable[[], object], long: Callable[[], object]) -> None:
    took = seconds(long)
    assert took < max(MAX_RATIO * seconds(short), RESOLVED_S)


@pytest.mark.drawn(3)
@pytest.mark.requirement("REQ-LINK-9")
@pytest.mark.parametrize("kind", [*TOML, *OTHERS])
def test_a_text_of_four_times_the_length_takes_about_four_times_as_long(kind: str) -> None:
    reader, made = ("TOML", TOML[kind]) if kind in TOML else OTHERS[kind]
    short, long = made(SHORT), made(LONG)
    assert_linear(lambda: READERS[reader](short), lambda: READERS[reader](long))


@pytest.mark.requirement("REQ-LINK-9")
def test_a_journal_takes_linear_time(tmp_path: Path) -> None:
    for name, count in (("short", 1000), ("long", 4000)):
        journal = Journal(tmp_path / name)
        journal.append((f"flight {k}", {"x": 0.1}) for k in range(count))
        journal.close()
    short, long = tmp_path / "short", tmp_path / "long"
    assert_linear(lambda: list(lines(short)), lambda: list(lines(long)))
    assert_linear(lambda: Journal(short).close(), lambda: Journal(long).close())


@pytest.mark.requirement("REQ-LINK-9")
@pytest.mark.parametrize("declared", ["uint8_t[65526] a;uint8_t b;", "uint8_t[60000] a;" * 3000])
def test_a_record_that_no_log_can_have_is_refused_before_it_takes_memory(
    declared: str, tmp_path: Path
) -> None:
    path = tmp_path / "flight.ulg"
    text = f"huge:uint64_t timestamp;{declared}".encode("ascii")
    begins = ulog.message(ulog.SUBSCRIPTION, b"\0\0\0huge")
    path.write_bytes(ulog.opening(0) + ulog.message(ulog.FORMAT, text) + begins)
    with pytest.raises(UlogError, match=r"huge has records of more than 65533|too many fields"):
        open_log(path)
