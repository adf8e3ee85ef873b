"""The journal: on disk at once, whole after a crash, the last good line of each key."""

from __future__ import annotations

from pathlib import Path

import pytest

from studies.campaign.journal import Journal, JournalInUseError, lines


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
    journal = Journal(path)
    journal.append([("c", {"x": 3})])
    assert journal.get("a") == {"x": 1}
    assert journal.get("b") is None
    assert journal.get("c") == {"x": 3}
    journal.close()
    assert Journal(path).get("c") == {"x": 3}
    assert [line["key"] for line in lines(path)] == ["a", "c"]


@pytest.mark.parametrize("number", ["1e999", "1" + 400 * "0", '"\\ud800"'])
def test_a_line_that_no_journal_writes_is_damaged(tmp_path: Path, number: str) -> None:
    path = tmp_path / "journal.jsonl"
    path.write_text(f'{{"key": "a", "x": {number}}}\n{{"key": "b", "x": NaN}}\n')
    assert [line["key"] for line in lines(path)] == ["b"]  # a flight that diverged leaves NaN
    journal = Journal(path)
    assert journal.get("a") is None
    assert journal.get("b") is not None
    journal.close()


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


def test_a_line_with_a_key_that_is_no_text_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    path.write_text('{"key": [1]}\n{"key": "a", "x": 1}\n' + "[" * 100_000 + "\n")
    journal = Journal(path)
    assert journal.get("a") == {"x": 1}
    journal.close()
