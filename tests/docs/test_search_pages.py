"""The files and commands of the pages about searching and tuning."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from pandion.__main__ import main
from studies.campaign.flight_space import spaces
from studies.campaign.plan import load_plan
from studies.search.scenario_search import load_task as load_search
from studies.search.tune import load_task
from tests.docs.fences import DOCS, commands, fences

FALSIFY, TUNE, SEARCH = (
    DOCS / "how-to" / f"{name}.md" for name in ("falsify", "tune", "search-a-scenario")
)


def file_of(page: Path, folder: Path, small: dict[str, str] | None = None) -> Path:
    """The file that a page shows, with numbers replaced."""
    (fence,) = [one for one in fences(page) if one.language == "toml" and one.mark == "run in"]
    found = re.match(r"# (\S+\.toml)\n", fence.text)
    assert found
    text = fence.text
    for old, new in (small or {}).items():
        text, count = re.subn(old, new, text)
        assert count == 1, old
    file = folder / found[1]
    file.write_text(text, encoding="utf-8")
    return file


def test_the_file_of_the_search_is_one(tmp_path: Path) -> None:
    (space,) = spaces(load_plan(file_of(FALSIFY, tmp_path)))
    assert space.values == 5  # the wind's direction comes with the wind
    assert space.entries == 600


def test_the_file_of_the_tuning_is_one(tmp_path: Path) -> None:
    task = load_task(file_of(TUNE, tmp_path))
    assert [one.parameter.name for one in task.parameters] == ["WALL_LAMBDA", "TRK_EFFORT"]
    assert (task.plan.count, task.judge_flights) == (30, 100)


def test_the_file_of_the_scenario_search_is_one(tmp_path: Path) -> None:
    task = load_search(file_of(SEARCH, tmp_path))
    assert [str(mark) for mark in task.marks] == ["softened hc + 60 mm", "blf"]
    assert (task.train, task.judge) == (range(1), range(1000, 1020))


@pytest.mark.long
def test_the_scenario_search_can_be_typed_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    small = {
        r"candidates = \d+": "candidates = 2",
        r"judge_seeds = \d+": "judge_seeds = 1",
        r"search_s = [\d.]+": "search_s = 1.0",
        r"scenarios": "duration_s = 2.0\nscenarios",
    }
    file_of(SEARCH, tmp_path, small)
    code = typed(SEARCH)
    said = capsys.readouterr().out
    assert ("NOT as wanted" in said) == (code == 1)
    assert (tmp_path / "runs" / "sphere" / "found.toml").exists()


def typed(page: Path, *more: str) -> int:
    """Exit code of the page's command with more options."""
    (fence,) = [one for one in fences(page) if one.language == "console" and one.mark == "run in"]
    ((line, _),) = commands(fence)
    words = shlex.split(line)
    assert words[0] == "pandion"
    return main([*words[1:], "--workers=0", *more])


@pytest.mark.long
def test_the_search_can_be_typed_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    file_of(FALSIFY, tmp_path, {r"duration_s = [\d.]+": "duration_s = 0.5"})
    assert typed(FALSIFY, "--evaluations=20") == 0
    assert (tmp_path / "runs" / "worst" / "find-1.toml").exists()


@pytest.mark.long
def test_the_tuning_can_be_typed_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    small = {
        r"\nflights = \d+": "\nflights = 7",
        r"duration_s = [\d.]+": "duration_s = 0.5",
        r"candidates = \d+": "candidates = 6",
        r"judge_flights = \d+": "judge_flights = 10",
        r"probability = [\d.]+": "probability = 0.4",
    }
    file_of(TUNE, tmp_path, small)
    code = typed(TUNE)
    said = capsys.readouterr().out
    assert code in (0, 1)
    assert ("nothing better" in said) == (code == 1)
    assert (tmp_path / "runs" / "tuned" / "tuned.params").exists() == (code == 0)
