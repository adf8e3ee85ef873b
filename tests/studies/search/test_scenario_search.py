"""The search finds a scenario that decides as wanted, and judges it on seeds it has not used."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pandion import search as command
from sitl.scenario_file import load_scenario
from studies.campaign.keys import CampaignError
from studies.flight.job import Job, Outcome
from studies.search.scenario_search import EXAMPLE, as_json, load_task, search, sentences
from tests.studies.cheap_flights import CheapCampaign

FILE = """\
flights = 1
scenarios = ["walls"]
allow_inconsistent = true
[vary]
walls.0.offset_m = { uniform = [-1.2, -0.8] }
[search]
candidates = 80
train_seeds = 2
judge_seeds = 3
search_s = 5.0
margin_m = 0.02
beyond_m = 0.005
[[search.marks]]
controller = "naive"
fails = "both"
[[search.marks]]
controller = "hc"
fails = "disturbed"
[[search.marks]]
controller = "hc"
tightening_m = 0.05
softened = true
fails = "either"
[[search.marks]]
controller = "blf"
fails = "none"
"""


def margin(job: Job) -> float:
    """BLF keeps most at an offset of -0.95; what HC keeps shrinks with it, more if pushed."""
    x, planner = job.scenario.walls[0].offset_m + 1.0, job.config.planner
    pushed = 0.04 if job.scenario.disturbances else 0.0
    if planner.controller == "naive":
        return -0.1
    if planner.controller == "hc":
        return 0.08 - x - pushed - planner.tightening
    return 0.06 - abs(x - 0.05) - 0.25 * pushed


class Judged(CheapCampaign):
    """Flights that are completed where they have a margin."""

    def run(self, jobs: Any) -> list[Outcome]:
        return [
            replace(row, completed=(row.margin_m or 0.0) >= 0.0, te_m=0.02)
            for row in super().run(jobs)
        ]


def write(folder: Path, text: str = FILE) -> Path:
    file = folder / "dash.toml"
    file.write_text(text, encoding="utf-8")
    return file


def test_a_scenario_is_found_that_decides_as_wanted(tmp_path: Path) -> None:
    campaign: Any = Judged(margin)
    found = search(load_task(write(tmp_path)), campaign, 1)
    assert found.shortfall_m == 0.0
    assert found.decides
    disturbed = found.task.scenarios(found.shares, whole=True)[1]
    assert 0.045 <= disturbed.walls[0].offset_m + 1.0 <= 0.06
    text = "\n".join(sentences(found))
    assert "softened hc + 50 mm: calm 0/1" in text
    assert "NOT as wanted" not in text
    assert as_json(found)["marks"][0]["fails"] == "both"


def test_of_either_one_flight_that_is_not_completed_is_enough(tmp_path: Path) -> None:
    def rare(job: Job) -> float:
        if job.config.planner.hard_slack is not None:  # the softened one
            return -0.1 if job.scenario.disturbances and job.seed % 2 else 0.5
        return margin(job)

    campaign: Any = Judged(rare)
    found = search(load_task(write(tmp_path)), campaign, 1)
    assert found.shortfall_m == 0.0
    assert found.decides


def test_the_judge_flies_the_whole_duration_with_other_seeds(tmp_path: Path) -> None:
    campaign: Any = Judged(margin)
    search(load_task(write(tmp_path)), campaign, 1)
    short = {job.seed for job in campaign.flown if job.scenario.duration_s == 5.0}
    whole = {job.seed for job in campaign.flown if job.scenario.duration_s != 5.0}
    assert short == {0, 1}
    assert whole == {1000, 1001, 1002}
    assert load_scenario("walls").duration_s in {job.scenario.duration_s for job in campaign.flown}


def test_what_cannot_be_had_is_named_and_not_found(tmp_path: Path) -> None:
    text = FILE.replace('"naive"\nfails = "both"', '"naive"\nfails = "none"')
    campaign: Any = Judged(margin)
    found = search(load_task(write(tmp_path, text)), campaign, 1)
    assert not found.decides
    assert found.shortfall_m >= 0.2
    assert any("naive" in line and "NOT as wanted" in line for line in sentences(found))


def test_a_flight_that_cannot_be_flown_is_no_failure_of_a_controller(tmp_path: Path) -> None:
    campaign: Any = Judged(margin, broken=lambda job: job.config.planner.controller == "naive")
    found = search(load_task(write(tmp_path)), campaign, 1)
    assert found.shortfall_m >= 1.0
    assert not found.decides


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ("[search]", "[seach]", "seach"),
        ('fails = "none"', 'fails = "never"', "fails"),
        ("walls.0.offset_m = { uniform = [-1.2, -0.8] }", "", "nothing to search"),
        ('["walls"]', '["walls-calm"]', "no disturbances"),
        ('["walls"]', '["walls", "walls-grazing"]', "name one scenario"),
        ("candidates = 80", "candidates = 0", "candidates"),
        (
            "flights = ",
            'own_planner = "fractions:Fraction"\nflights = ',
            "between Pandion's controllers",
        ),
    ],
)
def test_a_file_that_makes_no_sense_is_refused_in_a_sentence(
    tmp_path: Path, before: str, after: str, said: str
) -> None:
    with pytest.raises(CampaignError, match=said) as refused:
        load_task(write(tmp_path, FILE.replace(before, after)))
    assert "\n" not in str(refused.value)


def test_the_example_is_a_task(capsys: pytest.CaptureFixture[str]) -> None:
    assert command.main(["--example"]) == 0
    assert capsys.readouterr().out == EXAMPLE.read_text(encoding="utf-8")
    assert len(load_task(EXAMPLE).marks) >= 4
