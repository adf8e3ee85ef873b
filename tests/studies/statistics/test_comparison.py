"""Two campaigns beside each other."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from pandion.compare import main
from studies.campaign.flight import CampaignFlight
from studies.campaign.journal import Journal
from studies.campaign.plan import load_plan
from studies.campaign.store import FACTS, JOURNAL, begin, read_rows
from studies.statistics.comparison import changes, differences, newcombe

FILE = """\
flights = {flights}
seed = {seed}
duration_s = {duration}
scenarios = ["walls-calm"]
[vary]
vehicle_scale.mass = {{ uniform = [0.95, {most}] }}
"""


def campaign(
    folder: Path, shift_m: float = 0.0, spread_m: float = 0.0, *, contacts: int = 0,
    flights: int = 40, seed: int = 0, most: float = 1.05, duration: float = 2.0,
) -> Path:  # fmt: skip
    """The directory of a campaign whose margins are shifted, without flying."""
    folder.mkdir()
    source, out = folder / "small.toml", folder / "out"
    text = FILE.format(flights=flights, seed=seed, most=most, duration=duration)
    source.write_text(text, encoding="utf-8")
    plan = load_plan(source)
    begin(out, source, plan, flights)
    noise = np.random.default_rng(0).normal(0.0, 0.02, flights)  # the same in each campaign
    own = np.random.default_rng(1).normal(0.0, spread_m, flights)
    journal = Journal(out / JOURNAL)
    rows = [
        replace(
            CampaignFlight(plan, k).broken(""), error=False, completed=k >= contacts,
            contact=k < contacts, margin_m=0.1 + noise[k] + shift_m + own[k], took_s=0.25,
        )
        for k in range(flights)
    ]  # fmt: skip
    journal.append((CampaignFlight(plan, row.flight).key(), asdict(row)) for row in rows)
    journal.close()
    return out


def compared(one: Path, other: Path) -> Any:
    (found,) = differences(read_rows(one), read_rows(other), 0.95)
    return found


def test_pairs_show_a_change_that_means_would_hide(tmp_path: Path) -> None:
    before = campaign(tmp_path / "a")
    worse = compared(before, campaign(tmp_path / "b", -0.002, 0.001))
    assert worse.paired
    assert worse.worse == "margins are smaller"
    low, high = worse.margin_interval_m
    assert low < -0.002 < high < 0.0
    other = compared(before, campaign(tmp_path / "c", -0.002, 0.001, seed=7))
    assert not other.paired
    assert other.worse == ""
    better = compared(campaign(tmp_path / "d", -0.002, 0.001), before)
    assert (better.worse, better.better) == ("", "margins are larger")


def test_equal_campaigns_differ_in_nothing(tmp_path: Path) -> None:
    one, other = (campaign(tmp_path / name) for name in "ab")
    found = compared(one, other)
    assert found.margin_m == 0.0
    assert found.margin_interval_m == (0.0, 0.0)
    assert (found.worse, found.better) == ("", "")
    assert changes(read_rows(one), read_rows(other)) == []
    assert main([str(one), str(other)]) == 0


def test_more_violations_are_shown_to_be_more(tmp_path: Path) -> None:
    before, after = campaign(tmp_path / "a"), campaign(tmp_path / "b", contacts=12)
    found = compared(before, after)
    assert found.violations == (0, 12)
    assert "violations are more frequent" in found.worse
    assert compared(before, campaign(tmp_path / "c", contacts=1)).worse == ""


def test_what_changed_between_the_plans_is_named(tmp_path: Path) -> None:
    one = campaign(tmp_path / "a")
    other = campaign(tmp_path / "b", most=1.1, duration=3.0, flights=41)
    lines = changes(read_rows(one), read_rows(other))
    assert "duration_s: 2.0 -> 3.0" in lines
    assert "flights: 40 -> 41" in lines
    assert "vary.vehicle_scale.mass.uniform: [0.95, 1.05] -> [0.95, 1.1]" in lines


@pytest.mark.parametrize("text", ["a = " + "9" * 5000, "a = " + "[" * 5000, "a." * 5000 + "b = 1"])
def test_a_campaign_file_that_cannot_be_read_is_a_difference(tmp_path: Path, text: str) -> None:
    one, other = read_rows(campaign(tmp_path / "a")), read_rows(campaign(tmp_path / "b"))
    (line,) = changes(one, replace(other, file=text))
    assert "one of them cannot be read" in line


def test_a_campaign_of_other_code_is_compared_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with monkeypatch.context() as earlier:
        earlier.setattr("studies.campaign.flight.code", lambda: "a" * 64)
        earlier.setattr("studies.campaign.store.code", lambda: "a" * 64)
        before = campaign(tmp_path / "a")
    # With other defaults the plan has another digest today, and cannot be drawn again.
    facts = json.loads((before / FACTS).read_text(encoding="utf-8"))
    assert facts["digests"]["code"] == "a" * 64
    after = campaign(tmp_path / "b", -0.01, 0.001)
    report, junit = tmp_path / "compared.json", tmp_path / "compared.xml"
    assert main([str(before), str(after), f"--json={report}", f"--junit={junit}"]) == 1
    said = capsys.readouterr().out
    assert "code: aaaaaaaaaaaa -> " in said
    assert said.splitlines()[-1] == "FAIL 1 of 1 configurations worse"
    assert json.loads(report.read_text(encoding="utf-8"))["worse"] is True
    (case,) = ET.parse(junit).findall("testsuite/testcase")
    assert case.find("failure") is not None
    took_s = sum(row.took_s for one in (before, after) for row in read_rows(one).rows)
    assert float(case.attrib["time"]) == pytest.approx(took_s, abs=5e-4)


def test_what_is_no_campaign_is_refused_in_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = campaign(tmp_path / "a")
    (tmp_path / "empty").mkdir()
    assert main([str(one), str(tmp_path / "empty")]) == 2
    assert "is no directory of a campaign" in capsys.readouterr().err
    (one / JOURNAL).write_text("", encoding="utf-8")
    assert main([str(one), str(one)]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize(
    ("one", "other", "interval"),
    # Newcombe 1998, table II: 56/70 against 48/80, and 9/10 against 3/10, here the other way round.
    [((48, 80), (56, 70), (0.0524, 0.3339)), ((3, 10), (9, 10), (0.1705, 0.8090))],
)
def test_the_interval_is_newcombes(
    one: tuple[int, int], other: tuple[int, int], interval: tuple[float, float]
) -> None:
    assert newcombe(one, other, 0.95) == pytest.approx(interval, abs=5e-5)


def test_the_interval_of_equal_shares_without_a_violation_holds_nought() -> None:
    low, high = newcombe((0, 20), (0, 20), 0.95)
    assert low < 0.0 < high
    assert math.isclose(low, -high)
