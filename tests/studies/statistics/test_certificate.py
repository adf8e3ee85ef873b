"""A certificate counts everything, belongs to its rows, and says so when it does not."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pandion.certify import main
from studies.campaign.flight import CampaignFlight, CampaignRow
from studies.campaign.journal import Journal
from studies.campaign.keys import CampaignError
from studies.campaign.plan import CampaignPlan, load_plan
from studies.campaign.store import FACTS, JOURNAL, begin, read
from studies.statistics.binomial import bounds
from studies.statistics.certificate import ANY, certificate
from studies.statistics.certificate_page import statement_in

FILE = """\
flights = {flights}
duration_s = 2.0
scenarios = ["walls"]
{more}
[vary]
vehicle_scale.mass = {{ uniform = [0.95, 1.05] }}
"""


def row(plan: CampaignPlan, number: int, **changed: Any) -> CampaignRow:
    """A row as the flight would leave it, without flying; good unless changed."""
    margin = 0.05 + 0.01 * float(np.random.default_rng(number).exponential())
    flown = CampaignFlight(plan, number).broken("")
    good = {"completed": True, "error": False, "margin_m": margin, "reason": "flown to the end"}
    return replace(flown, **(good | changed))


def key(plan: CampaignPlan, one: CampaignRow) -> str:
    """Under which the journal has the row."""
    return CampaignFlight(plan, one.flight).key()


def flown(
    folder: Path, changed: dict[int, dict[str, Any]], flights: int = 40, more: str = ""
) -> Path:
    """The directory of a campaign, some of whose rows are changed; None leaves one out."""
    source, directory = folder / "small.toml", folder / "out"
    folder.mkdir(exist_ok=True)
    source.write_text(FILE.format(flights=flights, more=more), encoding="utf-8")
    plan = load_plan(source)
    begin(directory, source, plan, flights)
    journal = Journal(directory / JOURNAL)
    rows = [row(plan, k, **changed.get(k, {})) for k in range(flights)]
    journal.append((key(plan, one), one.as_line()) for one in rows if one.reason != "lost")
    journal.close()
    return directory


BROKEN: dict[int, dict[str, Any]] = {
    3: {"contact": True, "margin_m": -0.12, "completed": False},
    5: {"margin_m": -1e-6},
    7: {"limits_kept": False},
    8: {"completed": False, "reason": "diverged"},
    9: {"error": True, "completed": False, "margin_m": None, "reason": "RuntimeError: burst"},
}


def test_each_kind_is_counted_and_what_was_not_flown_counts_in_all(tmp_path: Path) -> None:
    directory = flown(tmp_path, BROKEN)
    stated = certificate(read(directory), directory, 0.9)
    counts = {name: found["count"] for name, found in stated["findings"].items()}
    assert counts == {
        "contact": 2,
        "margin below 0": 3,
        "a limit broken": 2,
        "not completed": 3,
        "not flown": 1,
        ANY: 5,
    }
    found = stated["findings"][ANY]
    truth = bounds(5, 40, 0.9)
    assert found["total"] == 40
    assert found["upper"] == pytest.approx(truth.upper, rel=1e-9)
    assert tuple(found["interval"]) == pytest.approx(truth.interval, rel=1e-9)
    assert stated["configurations"][0]["counted"][ANY] == 5
    assert stated["margins"][0]["flights"] == 39
    assert "at least 100" in stated["margins"][0]["tail"]["none"]


def test_it_says_what_was_varied_and_what_was_not(tmp_path: Path) -> None:
    directory = flown(tmp_path, {})
    stated = certificate(read(directory), directory, 0.95)
    assert stated["varied"] == ["vehicle_scale.mass: uniform from 0.95 to 1.05"]
    assert stated["random"] == ["disturbance uniform: uniform within ±0.8 m/s² an axis"]
    held = "\n".join(stated["not_varied"])
    assert "inertia = 1" in held
    assert "mass" not in held
    assert "faults: none" in held
    assert "independently" in stated["assumed"]
    sobol = flown(tmp_path / "sobol", {}, more='design = "sobol"')
    assert "no proof" in certificate(read(sobol), sobol, 0.95)["assumed"]


def test_flights_without_a_row_are_not_left_out(tmp_path: Path) -> None:
    directory = flown(tmp_path, {4: {"reason": "lost"}, 6: {"reason": "lost"}})
    with pytest.raises(CampaignError, match=r"2 of 40 flights have no row.*finish with `pandion"):
        certificate(read(directory), directory, 0.95)


def test_a_tail_is_fitted_and_the_same_again(tmp_path: Path) -> None:
    directory = flown(tmp_path, {}, flights=300)
    stated = certificate(read(directory), directory, 0.95, refits=9)
    tail = stated["margins"][0]["tail"]
    assert tail["tail"] == 30
    assert tail["refits"] == 9
    assert tail["threshold_m"] == pytest.approx(0.051, abs=5e-4)
    assert stated == certificate(read(directory), directory, 0.95, refits=9)


def changed(directory: Path, number: int, **fields: Any) -> None:
    """Append another row of a flight, as a repeated flight would."""
    result = read(directory)
    old = next(one for one in result.rows if one.flight == number)
    journal = Journal(directory / JOURNAL)
    journal.append([(key(result.plan, old), replace(old, **fields).as_line())])
    journal.close()


def test_the_command_writes_a_page_that_verifies_until_a_row_changes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    directory = flown(tmp_path, BROKEN)
    written = tmp_path / "stated.json"
    assert main([str(directory), "--confidence", "0.99", "--json", str(written)]) == 0
    said = capsys.readouterr().out
    assert "5 of 40 flights with a violation: with 99 % confidence" in said
    assert "(one-sided)" in said
    assert "two-sided" in said
    page = directory / "certificate.html"
    text = page.read_text(encoding="utf-8")
    assert "http" not in text.replace("http://www.w3.org", "")
    stated = json.loads(written.read_text())
    assert statement_in(text) == stated
    for certified in (page, written):
        assert main([str(directory), "--verify", str(certified)]) == 0
    changed(directory, 11, took_s=99.0)  # of the machine
    assert main([str(directory), "--verify", str(page)]) == 0
    capsys.readouterr()
    changed(directory, 12, margin_m=0.0123)
    assert main([str(directory), "--verify", str(page)]) == 1
    said = capsys.readouterr().out
    assert "digests.rows: the certificate says" in said
    assert "margins[0].quantiles_m" in said
    assert "findings" not in said


def test_a_certificate_that_was_changed_is_found_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    directory = flown(tmp_path, BROKEN)
    stated = certificate(read(directory), directory, 0.95)
    stated["findings"][ANY]["count"] = 0
    forged = tmp_path / "forged.json"
    forged.write_text(json.dumps(stated))
    assert main([str(directory), "--verify", str(forged)]) == 1
    said = capsys.readouterr().out
    assert "its digest is not that of its statement" in said
    assert f"findings.{ANY}.count: the certificate says 0, the campaign 5" in said


@pytest.mark.parametrize("content", ["", "[]", "{}", "<html></html>", '{"format": "other"}'])
def test_what_is_no_certificate_is_refused_in_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str
) -> None:
    directory = flown(tmp_path, {}, flights=2)
    other = tmp_path / "other.html"
    other.write_text(content)
    assert main([str(directory), "--verify", str(other)]) == 2
    assert "holds no certificate of this version" in capsys.readouterr().err
    assert main([str(tmp_path)]) == 2
    assert "is no directory of a campaign" in capsys.readouterr().err


def test_a_campaign_of_other_code_is_not_taken_for_a_changed_file(tmp_path: Path) -> None:
    directory = flown(tmp_path, {}, flights=2)
    facts = json.loads((directory / FACTS).read_text())
    facts["digests"] |= {"plan": "0" * 32, "code": "f" * 32}
    (directory / FACTS).write_text(json.dumps(facts))
    with pytest.raises(
        CampaignError, match=r"flown by other code \(ffffffff.*read it with Pandion"
    ):
        read(directory)
