"""A child process leaves its results on disk and changes nothing in its parent."""

from __future__ import annotations

from pathlib import Path

import pytest

from fsw.runtime.process import in_a_child


def test_work_in_a_child_leaves_files_and_no_memory(tmp_path: Path) -> None:
    done: list[str] = []

    def work() -> None:
        done.append("in the child")
        (tmp_path / "left").write_text("behind")

    in_a_child(work)
    assert (tmp_path / "left").read_text() == "behind"
    assert done == []


def test_work_that_fails_in_a_child_is_silent(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    def work() -> None:
        (tmp_path / "begun").touch()
        raise ValueError("no such controller")

    in_a_child(work)
    assert (tmp_path / "begun").exists()
    assert capfd.readouterr() == ("", "")
