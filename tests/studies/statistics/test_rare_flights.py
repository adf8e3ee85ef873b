"""The adapter from points to flights: known probabilities of flights that are formulas."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from pandion.splitting import main
from sitl.scenario import Sequence
from studies.campaign.keys import CampaignError
from studies.campaign.plan import parse_plan
from studies.flight.job import Job
from studies.statistics.rare_flights import FlightScore, as_json, only_case, sentences
from studies.statistics.splitting import Effort, estimate
from tests.studies.cheap_flights import CheapCampaign

FILE = """\
flights = 4
duration_s = 2.0
scenarios = ["walls"]
{more}
[vary]
vehicle_scale.mass = {{ uniform = [0.9, 1.1] }}
"""


def pushed_north(job: Job) -> float:
    """Minus the sum of 20 uniform pushes north, in deviations of one."""
    (item,) = job.scenario.disturbances
    assert isinstance(item, Sequence)
    north = sum(push[0] for push in item.acceleration_m_s2)
    return -north / (0.8 / math.sqrt(3.0)) / math.sqrt(20.0)


def score(campaign: CheapCampaign, threshold: float, more: str = "") -> FlightScore:
    """Scores of flights that are a formula."""
    plan = parse_plan(FILE.format(more=more), "small", Path())
    anything: Any = campaign
    return FlightScore(only_case(plan), anything, threshold)


EFFORT = Effort(particles=100, runs=3)
FULL = Effort(particles=150, runs=4)


def test_uniform_pushes_keep_their_distribution_on_the_way_to_the_tail() -> None:
    """The sum of twenty uniform numbers is known well enough from many of them."""
    drawn = np.random.default_rng(1).uniform(-1.0, 1.0, (200_000, 20)).sum(axis=1)
    truth = float(np.mean(-drawn * math.sqrt(3.0 / 20.0) <= -3.2))
    points = score(CheapCampaign(pushed_north), -3.2)
    found = estimate(points, points.space, 0.0, FULL, 0.99, 4)
    assert 4e-4 < truth < 8e-4
    assert found.interval[0] < truth < found.interval[1]
    assert found.interval[1] / found.interval[0] < 60.0
    text = "\n".join(sentences(found, points))
    assert "probability of a minimum margin below -3200 mm" in text
    assert "only the scatter of the runs" in text
    assert as_json(found, points)["probability"] == found.probability


def test_a_varied_value_keeps_its_distribution() -> None:
    light = CheapCampaign(lambda job: job.scenario.vehicle_scale.mass - 0.9)
    points = score(light, 0.2 * 0.002)
    found = estimate(points, points.space, 0.0, EFFORT, 0.99, 1)
    assert found.interval[0] < 2e-3 < found.interval[1]


def test_the_seed_of_the_noise_is_drawn_anew() -> None:
    noisy = CheapCampaign(lambda job: norm.ppf((job.seed + 0.5) / (1 << 53)))
    points = score(noisy, float(norm.ppf(0.02)), 'suites = ["mocap"]')
    assert points.space.redrawn == 1
    found = estimate(points, points.space, 0.0, EFFORT, 0.99, 1)
    assert found.interval[0] < 0.02 < found.interval[1]
    assert len({job.seed for job in noisy.flown}) > 100


def test_what_could_not_be_flown_counts_as_below_and_is_said() -> None:
    campaign = CheapCampaign(lambda _: 1.0, broken=lambda job: pushed_north(job) > 1.0)
    points = score(campaign, 0.0)
    found = estimate(points, points.space, 0.0, EFFORT, 0.95, 1)
    assert found.probability == pytest.approx(norm.sf(1.0), abs=0.07)
    assert "could not be flown and count as below: ScenarioError" in "\n".join(
        sentences(found, points)
    )


def test_what_is_never_reached_has_no_interval() -> None:
    points = score(CheapCampaign(lambda _: 0.2), 0.0)
    found = estimate(points, points.space, 0.0, EFFORT, 0.95, 1)
    text = list(sentences(found, points))
    assert text[0].startswith("no run reached a minimum margin below 0 mm")
    assert "smallest +200.0 mm" in text[0]
    assert as_json(found, points)["probability"] is None


def test_several_configurations_and_flights_without_zones_are_refused() -> None:
    two = parse_plan(FILE.format(more='suites = ["perfect", "mocap"]'), "x", Path())
    with pytest.raises(CampaignError, match="one probability is of one"):
        only_case(two)
    with pytest.raises(CampaignError, match="no zones"):
        score(CheapCampaign(lambda _: None), 0.0)(np.zeros((1, 61)))


@pytest.mark.long
def test_at_a_hundredth_flights_agree_with_plain_counting(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of real flights: the threshold is one that about one in eighty stays below."""
    file = tmp_path / "rare.toml"
    file.write_text(FILE.format(more="").replace("duration_s = 2.0", "duration_s = 1.5"))
    plan = parse_plan(file.read_text(), "rare", tmp_path)
    rows = [plan.flight(k).job.row() for k in range(400)]
    margins = sorted(row.margin_m for row in rows if row.margin_m is not None)
    threshold = margins[5] + 1e-6
    written = tmp_path / "found.json"
    options = ["--particles=100", "--runs=3", "--workers=0", f"--out={tmp_path}"]
    options += [f"--threshold={1e3 * threshold!r}", "--confidence=0.99", f"--json={written}"]
    assert main([str(file), *options]) == 0
    low, high = json.loads(written.read_text())["interval"]
    assert low < 6 / 400 < high
    least = json.loads(written.read_text())["runs"]
    assert min(run["min_margin_m"] for run in least) <= threshold
    assert "pandion fly" in capsys.readouterr().out
    assert (tmp_path / "least.toml").exists()
