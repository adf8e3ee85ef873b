"""What stops a verb that asks a campaign, and an answer that cannot be written, are sentences."""

from __future__ import annotations

from pathlib import Path

import pytest

from pandion import search
from pandion.campaign_run import CampaignRun, begin, exit_code
from pandion.cluster_options import ClusterOptions
from studies.campaign.keys import CampaignError
from studies.campaign.plan import parse_plan
from studies.campaign.ports import SchedulerGoneError

PLAN = """
flights = 2
duration_s = 0.3
scenarios = ["walls-calm"]
"""


@pytest.mark.parametrize(
    ("stopped", "code", "sentence"),
    [
        (CampaignError("no such key"), 2, "no such key"),
        (SchedulerGoneError("it is gone"), 2, "it is gone"),
        (PermissionError(13, "Permission denied", "runs"), 2, "Permission denied"),
        (KeyboardInterrupt(), 1, "interrupted; the same command with --out goes on"),
    ],
)
def test_what_stops_a_verb_is_a_sentence(
    stopped: BaseException, code: int, sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    def answer() -> int:
        raise stopped

    assert exit_code("tune", answer) == code
    said = capsys.readouterr().err
    assert said.startswith("pandion tune: ")
    assert sentence in said
    assert "Traceback" not in said


def test_what_is_wrong_in_the_program_is_no_sentence() -> None:
    def answer() -> int:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        exit_code("tune", answer)


def test_a_search_between_our_controllers_takes_no_part_of_ones_own(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for part in ("--planner", "--controller"):
        with pytest.raises(SystemExit) as stop:
            search.main(["x.toml", f"{part}=a:B"])
        assert stop.value.code == 2
        assert f"unknown option {part}" in capsys.readouterr().err


def test_a_directory_of_that_name_is_made_where_none_is_given(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    plan, cluster = parse_plan(PLAN, "tiny", tmp_path), ClusterOptions()
    run = begin("tune", plan, "2 flights", cluster, None, None)
    assert run.folder.is_dir()
    assert run.folder.parent == Path("runs")
    assert "tune-tiny" in run.folder.name
    assert f"tiny, 2 flights, {cluster.words}" in capsys.readouterr().out


def test_an_answer_that_cannot_be_written_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plan = parse_plan(PLAN, "tiny", tmp_path)

    def run(json: Path) -> CampaignRun:
        return begin("tune", plan, "2 flights", ClusterOptions(), tmp_path / "out", str(json))

    assert run(tmp_path / "there.json").written("{}")
    assert (tmp_path / "there.json").read_text() == "{}"
    assert not run(tmp_path / "none" / "there.json").written("{}")
    assert "pandion tune: cannot write" in capsys.readouterr().err
