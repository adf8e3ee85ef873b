"""What has moved still answers for one release, and names its new place."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.__main__ import BENCHMARKS
from benchmarks.__main__ import main as benchmarks
from pandion import moved_bench
from pandion.__main__ import main
from tests.cli.command import one_sentence


def test_the_old_verb_names_the_new_command_and_runs_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["bench", "loop", "--help"])
    assert stop.value.code == 0
    out, err = capsys.readouterr()
    assert one_sentence(err)
    assert "`python -m benchmarks loop`" in err
    assert "--hogs" in out


def test_without_the_folder_it_says_where_to_find_it(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(moved_bench, "CHECKOUT", tmp_path)
    assert main(["bench", "loop"]) == 2
    assert one_sentence(err := capsys.readouterr().err)
    assert "checkout" in err
    assert "python -m benchmarks" in err


@pytest.mark.parametrize("name", BENCHMARKS)
def test_every_benchmark_of_the_list_has_help(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert benchmarks([]) == 0
    assert name in capsys.readouterr().out
    with pytest.raises(SystemExit) as stop:
        benchmarks([name, "--help"])
    assert stop.value.code == 0
    assert f"benchmarks {name}" in capsys.readouterr().out


def test_an_unknown_benchmark_is_answered_with_the_nearest(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert benchmarks(["lokstep"]) == 2
    assert one_sentence(err := capsys.readouterr().err)
    assert "lockstep" in err
