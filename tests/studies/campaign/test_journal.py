"""The journal: on disk at once, whole after a crash, the last good line of each key."""

from __future__ import annotations

import json
import os
import random
from collections.abc import Callable
from pathlib import Path

import pytest

from studies.campaign.journal import (
    MAX_LINE,
    Journal,
    JournalError,
    JournalInUseError,
    lines,
    sealed_lines,
)


def test_what_was_appended_is_read_again_by_its_key(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "journal.jsonl"
    journal = Journal(path)
    journal.append([("a", {"x": 1}), ("b", {"x": 2})])
    assert journal.get("b") == {"x": 2}
    journal.append([("a", {"x": 3})])
    journal.close()
    again = Journal(path)
    assert again.get("a") == {"x": 3}
    assert again.get("c") is None
    assert [line["x"] for line in lines(path)] == [1, 2, 3]


def test_a_line_cut_short_costs_that_line_alone(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    Journal(path).append([("a", {"x": 1})])
    with path.open("ab") as file:
        file.write(b'{"key": "b", "x"')
    with pytest.raises(JournalError, match="line 2 has no end"):
        list(lines(path))
    journal = Journal(path)
    journal.append([("c", {"x": 3})])
    assert journal.get("a") == {"x": 1}
    assert journal.get("b") is None
    assert journal.get("c") == {"x": 3}
    journal.close()
    assert Journal(path).get("c") == {"x": 3}
    assert [line["key"] for line in lines(path)] == ["a", "c"]


ROWS = [(f"flight {k}", {"x": 0.125 * k, "reason": 'flew, "digest": here'}) for k in range(6)]


def written(path: Path, rows: list[tuple[str, dict[str, object]]] | None = None) -> list[bytes]:
    """The lines of a journal."""
    journal = Journal(path)
    journal.append(ROWS if rows is None else rows)
    journal.close()
    return path.read_bytes().splitlines(keepends=True)


def test_the_seal_names_every_line_up_to_it(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    written(path)
    seals = [seal for _, seal in sealed_lines(path)]
    assert [seal.lines for seal in seals] == [1, 2, 3, 4, 5, 6]
    assert len({seal.digest for seal in seals}) == 6
    assert list(lines(path)) == [{"key": key, **row} for key, row in ROWS]
    journal = Journal(path)
    assert journal.seal == seals[-1]
    journal.append([("more", {"x": float("nan")})])
    journal.close()
    *earlier, last = (seal for _, seal in sealed_lines(path))
    assert (earlier, last) == (seals, journal.seal)


FORGERIES: dict[str, Callable[[list[bytes]], list[bytes]]] = {
    "a number is another": lambda kept: [*kept[:2], kept[2].replace(b"0.25", b"9.25"), *kept[3:]],
    "written anew": lambda kept: [json.dumps(json.loads(one)).encode() + b" \n" for one in kept],
    "the first is another": lambda kept: [kept[0].replace(b"0.0,", b"0.5,"), *kept[1:]],
    "the last is another": lambda kept: [*kept[:-1], kept[-1].replace(b"0.625", b"0.626")],
    "a key is another": lambda kept: [kept[0].replace(b"flight 0", b"flight 9"), *kept[1:]],
    "one is missing": lambda kept: kept[:2] + kept[3:],
    "the first is missing": lambda kept: kept[1:],
    "two change places": lambda kept: [*kept[:2], kept[3], kept[2], *kept[4:]],
    "one stands twice": lambda kept: [*kept, kept[3]],
    "one follows itself": lambda kept: [*kept[:4], *kept[3:]],
    "no digests": lambda kept: [one.partition(b', "digest"')[0] + b"}\n" for one in kept],
    "a digest is another": lambda kept: [kept[0][:-5] + b'0"}\n', *kept[1:]],
    "digests change places": lambda kept: [
        kept[0].rpartition(b', "digest"')[0] + b', "digest"' + kept[1].rpartition(b', "digest"')[2],
        *kept[1:],
    ],
    "an empty line": lambda kept: [kept[0], b"\n", *kept[1:]],
    "a line of something else": lambda kept: [*kept, b"and so on\n"],
    "the first cut": lambda kept: [kept[0][:-1]],
    "the last cut": lambda kept: [*kept[:-1], kept[-1][:-9]],
    "a line without an end": lambda kept: [*kept, b'{"key": "' + b"a" * (3 * MAX_LINE)],
    "nothing but zeros": lambda kept: [*kept, bytes(100)],
}


@pytest.mark.parametrize("forgery", FORGERIES)
def test_a_journal_that_is_not_as_it_was_written_is_refused(forgery: str, tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    kept = written(path)
    forged = FORGERIES[forgery](kept)
    assert forged != kept
    path.write_bytes(b"".join(forged))
    with pytest.raises(JournalError, match=r"journal\.jsonl, line [1-7] "):
        list(lines(path))
    if not forgery.endswith("cut"):  # which is what a crash leaves
        with pytest.raises(JournalError, match=r"journal\.jsonl, line [1-7] "):
            Journal(path)


def test_lines_of_another_journal_do_not_fit(tmp_path: Path) -> None:
    mine = written(tmp_path / "mine")
    other = written(tmp_path / "other", [(key, row | {"x": 9.9}) for key, row in ROWS])
    for k in range(6):
        (tmp_path / "mixed").write_bytes(b"".join([*mine[:k], other[k], *mine[k + 1 :]]))
        with pytest.raises(JournalError, match=f"line {2 if k == 0 else k + 1} was edited"):
            list(lines(tmp_path / "mixed"))


def test_every_bit_counts(tmp_path: Path) -> None:
    path, drawn = tmp_path / "journal.jsonl", random.Random(5)
    whole = b"".join(written(path))
    for _ in range(300):
        bit = drawn.randrange(8 * len(whole))
        spoilt = bytearray(whole)
        spoilt[bit // 8] ^= 1 << bit % 8
        path.write_bytes(spoilt)
        with pytest.raises(JournalError):
            list(lines(path))


def test_a_journal_that_grows_while_it_is_read_is_refused_and_ends(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    written(path)
    journal, read = Journal(path), lines(path)
    for _ in ROWS:
        journal.append([("more", next(read))])
    with pytest.raises(JournalError, match="changes while it is read: wait for the end"):
        next(read)
    journal.close()


def test_a_line_without_an_end_is_not_read_into_the_memory(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    written(path)
    os.truncate(path, 1 << 40)  # sparse
    with pytest.raises(JournalError, match="line 7 has no end"):
        list(lines(path))
    with pytest.raises(JournalError, match="line 7 has no end"):
        Journal(path)


def test_a_journal_is_no_link_to_another_file(tmp_path: Path) -> None:
    written(tmp_path / "elsewhere")
    (tmp_path / "journal.jsonl").symlink_to(tmp_path / "elsewhere")
    for use in (lambda path: list(lines(path)), Journal):
        with pytest.raises(OSError, match="it is a symbolic link"):
            use(tmp_path / "journal.jsonl")
    (tmp_path / "nowhere").symlink_to(tmp_path / "new")
    with pytest.raises(OSError, match="it is a symbolic link"):
        Journal(tmp_path / "nowhere")
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("number", ["1e999", "1" + 400 * "0", '"\\ud800"'])
def test_a_value_that_no_journal_writes_is_refused(tmp_path: Path, number: str) -> None:
    path = tmp_path / "journal.jsonl"
    path.write_text(f'{{"key": "a", "x": {number}, "digest": "{"0" * 64}"}}\n')
    with pytest.raises(JournalError, match="line 1 is none that"):
        list(lines(path))


def test_a_row_with_an_error_is_kept_but_not_taken_for_the_flight(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "journal.jsonl")
    journal.append([("a", {"error": True, "reason": "it died"})])
    assert journal.get("a") is None
    assert len(list(lines(tmp_path / "journal.jsonl"))) == 1
    journal.append([("a", {"error": False, "x": 1})])
    assert journal.get("a") == {"error": False, "x": 1}


def test_lines_are_synchronised_with_the_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synchronised: list[int] = []
    path = tmp_path / "journal.jsonl"
    monkeypatch.setattr(
        "studies.campaign.journal.os.fsync", lambda _: synchronised.append(path.stat().st_size)
    )
    journal = Journal(path)
    journal.append([("a", {"x": 1}), ("b", {"x": 2})])
    assert synchronised == [path.stat().st_size]


def test_only_one_writer_has_a_journal(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    first = Journal(path)
    with pytest.raises(JournalInUseError, match="is being written by another process"):
        Journal(path)
    first.append([("a", {"x": 1})])
    assert [line["key"] for line in lines(path)] == ["a"]  # to read it needs no leave
    first.close()
    Journal(path).close()


def test_a_line_that_was_changed_beneath_is_not_taken_for_another_key(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    journal = Journal(path)
    journal.append([("a", {"x": 1}), ("b", {"x": 2})])
    path.write_bytes(path.read_bytes().replace(b'"a"', b'"c"')[:25])
    assert journal.get("a") is None
    assert journal.get("b") is None
    journal.close()
