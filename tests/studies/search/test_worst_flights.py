"""The search finds what a formula hides, within its bounds, and keeps it as files that fly."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pandion.falsify import main
from sitl.scenario import Sequence
from sitl.scenario_file import load_scenario
from studies.campaign.flight_space import FlightSpace, spaces
from studies.campaign.keys import CampaignError
from studies.campaign.plan import parse_plan
from studies.flight.fly_again import flown_again, keep
from studies.flight.job import Job
from studies.search.worst_flights import search
from tests.studies.cheap_flights import CheapCampaign

FILE = """\
flights = 4
duration_s = {duration}
scenarios = {scenarios}
[vary]
vehicle_scale.mass = {{ uniform = [0.9, 1.1] }}
start.yaw_deg = {{ uniform = [-20.0, 20.0] }}
trajectory.amplitude_m.0 = {{ uniform = [0.2, 0.4] }}
"""


def cases(scenarios: str = '["walls"]', duration: float = 1.0) -> tuple[FlightSpace, ...]:
    """Spaces of all cases."""
    text = FILE.format(scenarios=scenarios, duration=duration)
    return spaces(parse_plan(text, "small", Path()))


def bowl(job: Job) -> float:
    """Least at a mass of 0.93, a yaw of 12 deg and full pushes along a pattern."""
    (item,) = job.scenario.disturbances
    assert isinstance(item, Sequence)
    pushes = np.array(item.acceleration_m_s2) / 0.8
    wanted = np.where(np.arange(len(pushes))[:, None] % 4 < 2, 1.0, -1.0)
    off = (job.scenario.vehicle_scale.mass - 0.93) ** 2 / 0.01
    off += (job.scenario.start.yaw_deg - 12.0) ** 2 / 400.0
    return 0.05 * off + 0.001 * float(np.square(pushes - wanted).sum())


def test_it_comes_near_the_least_margin_within_the_bounds() -> None:
    campaign: Any = CheapCampaign(bowl)
    found = search(cases(), campaign, 500, 3)
    best = found.finds[0]
    assert 500 - 20 < found.flights <= 500 + 20
    assert found.flights == len(campaign.flown)
    assert best.values["vehicle_scale.mass"] == pytest.approx(0.93, abs=0.03)
    assert best.values["start.yaw_deg"] == pytest.approx(12.0, abs=6.0)
    drawn = [bowl(job) for job in campaign.flown[:14]]
    assert best.margin_m == bowl(best.job) < 0.5 * min(drawn)
    masses = [job.scenario.vehicle_scale.mass for job in campaign.flown]
    assert 0.9 <= min(masses) < max(masses) <= 1.1
    assert not best.violates


def test_a_search_that_stalls_begins_again_elsewhere() -> None:
    flat: Any = CheapCampaign(lambda _: 0.3)
    found = search(cases(duration=0.2), flat, 800, 3)
    assert len(found.finds) >= 2
    assert len({find.job.scenario.start.yaw_deg for find in found.finds}) == len(found.finds)


def test_every_case_gets_its_share_and_the_worst_is_first() -> None:
    campaign: Any = CheapCampaign(lambda job: 0.1 if job.scenario.name == "gate" else 0.2)
    found = search(cases('["walls", "gate"]'), campaign, 120, 1)
    names = [job.scenario.name for job in campaign.flown]
    assert abs(names.count("walls") - names.count("gate")) <= 20
    assert found.finds[0].flights.case.scenario == "gate"


def test_what_touches_is_worse_than_what_only_comes_near() -> None:
    def margin(job: Job) -> float:
        return -0.15 if job.scenario.start.yaw_deg > 0.0 else -0.05

    campaign: Any = CheapCampaign(margin)
    found = search(cases(), campaign, 60, 1)
    assert found.finds[0].outcome.contact
    assert found.finds[0].violates


def test_flights_that_cannot_be_flown_are_counted_and_are_no_finds() -> None:
    campaign: Any = CheapCampaign(
        lambda job: 0.2 + 0.01 * job.scenario.vehicle_scale.mass,
        broken=lambda job: job.scenario.vehicle_scale.mass < 1.0,
    )
    found = search(cases(), campaign, 100, 1)
    assert 5 < found.broken < 100
    assert "outside its safe set" in found.why
    assert found.finds[0].values["vehicle_scale.mass"] >= 1.0
    nothing: Any = CheapCampaign(bowl, broken=lambda _: True)
    assert search(cases(), nothing, 30, 1).finds == ()


def test_a_case_that_would_get_no_flight_is_refused() -> None:
    campaign: Any = CheapCampaign(lambda _: 0.1)
    with pytest.raises(CampaignError, match="1 flights are fewer than the 2 combinations"):
        search(cases('["walls", "gate"]'), campaign, 1, 1)
    assert campaign.flown == []


@pytest.mark.parametrize(("words", "together"), [([], 1), (["--generation=12"], 12)])
def test_what_is_found_does_not_depend_on_the_workers(
    words: list[str], together: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[int] = []

    def seen(*_: Any, together: int, **__: Any) -> None:
        asked.append(together)
        raise CampaignError("enough")

    monkeypatch.setattr("studies.search.worst_flights.search", seen)
    file = tmp_path / "small.toml"
    file.write_text(FILE.format(scenarios='["walls"]', duration=1.0))
    for workers in ("--workers=1", "--workers=64"):
        assert main([f"--over={file}", f"--out={tmp_path}", workers, *words]) == 2
    assert asked == [together, together]


def test_the_same_seed_searches_the_same_and_more_at_once_makes_larger_generations() -> None:
    first: Any = CheapCampaign(bowl)
    again: Any = CheapCampaign(bowl)
    assert search(cases(), first, 60, 7).finds == search(cases(), again, 60, 7).finds
    wide: Any = CheapCampaign(bowl)
    assert search(cases(), wide, 60, 7, together=30).flights == 60


def test_nothing_to_search_and_no_zones_are_refused() -> None:
    text = 'flights = 1\nscenarios = ["walls-calm"]\n'
    anything: Any = CheapCampaign(bowl)
    with pytest.raises(CampaignError, match="nothing to search"):
        search(spaces(parse_plan(text, "x", Path())), anything, 10, 1)
    free: Any = CheapCampaign(lambda _: None)
    with pytest.raises(CampaignError, match="no zones"):
        search(cases(), free, 10, 1)


def test_a_find_is_a_file_that_holds_the_same_flight(tmp_path: Path) -> None:
    campaign: Any = CheapCampaign(bowl)
    job = search(cases(), campaign, 20, 1).finds[0].job
    command = keep(job, "hc", tmp_path / "find", "a find\nof a test")
    kept = load_scenario(str(tmp_path / "find.toml"))
    assert kept.disturbances == job.scenario.disturbances
    assert kept.start == job.scenario.start
    assert kept.vehicle_scale == job.scenario.vehicle_scale
    assert f"--seed={job.seed}" in command
    assert "--controller=hc" in command


@pytest.mark.long
def test_the_command_keeps_finds_that_fly_to_the_same_margin(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "search.toml"
    file.write_text(FILE.format(scenarios='["walls"]', duration=1.0))
    options = [f"--over={file}", "--evaluations=40", "--workers=0", f"--out={tmp_path / 'out'}"]
    assert main(options) == 0
    said = capsys.readouterr().out
    assert "no flight leaves its safe set" in said
    assert "no proof" in said
    (find, *_) = json.loads((tmp_path / "out" / "finds.json").read_text())["finds"]
    assert find["same_from_file"]
    assert math.isfinite(find["margin_m"])
    (job,) = [one.job(np.full(3, 0.5), np.zeros(one.entries)) for one in cases(duration=1.0)]
    assert find["margin_m"] < (job.row().margin_m or 0.0)
    assert flown_again(job, tmp_path / "out" / "find-1").margin_m is not None


def test_a_margin_that_is_no_number_is_a_violation() -> None:
    campaign: Any = CheapCampaign(lambda _: math.nan)
    assert search(cases(duration=0.2), campaign, 40, 1).finds[0].violates
