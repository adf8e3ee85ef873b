"""A certificate counts everything, belongs to its rows, and says so when it does not."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sitl
from pandion.certify import main
from studies.campaign.flight import CampaignFlight, CampaignRow
from studies.campaign.journal import Journal, Seal
from studies.campaign.keys import CampaignError
from studies.campaign.plan import CampaignPlan, load_plan
from studies.campaign.store import FACTS, JOURNAL, begin, read
from studies.statistics.binomial import bounds
from studies.statistics.certificate import ANY, certificate, violates
from studies.statistics.certificate_page import sentences, statement_in
from tests.studies.campaign.test_store import seal, write_anew

FILE = """\
flights = {flights}
duration_s = 2.0
scenarios = ["{scenario}"]
{more}
[vary]
{vary}
"""
MASS = "vehicle_scale.mass = { uniform = [0.95, 1.05] }"
GRID = 'design = "grid"'
MASSES = "vehicle_scale.mass = { uniform = [0.95, 1.05], points = 3 }"


def row(plan: CampaignPlan, number: int, **changed: Any) -> CampaignRow:
    """A row as the flight would leave it, without flying; good unless changed."""
    margin = 0.05 + 0.01 * float(np.random.default_rng(number).exponential())
    flown = CampaignFlight(plan, number).broken("")
    good = {
        "completed": True,
        "error": False,
        "margin_m": margin,
        "reason": "flown to the end",
        "duration_s": 2.0,
    }
    return replace(flown, **(good | changed))


def key(plan: CampaignPlan, one: CampaignRow) -> str:
    """Under which the journal has the row."""
    return CampaignFlight(plan, one.flight).key()


def flown(
    folder: Path,
    changed: dict[int, dict[str, Any]],
    flights: int = 40,
    more: str = "",
    vary: str = MASS,
    scenario: str = "walls",
) -> Path:
    """The directory of a campaign, some of whose rows are changed; None leaves one out."""
    source, directory = folder / "small.toml", folder / "out"
    folder.mkdir(exist_ok=True)
    text = FILE.format(flights=flights, more=more, vary=vary, scenario=scenario)
    source.write_text(text, encoding="utf-8")
    plan = load_plan(source)
    begin(directory, source, plan, flights)
    journal = Journal(directory / JOURNAL)
    rows = [row(plan, k, **changed.get(k, {})) for k in range(flights)]
    journal.append((key(plan, one), asdict(one)) for one in rows if one.reason != "lost")
    journal.close()
    seal(directory)
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


def test_flights_that_were_refused_clear_nothing(tmp_path: Path) -> None:
    refused = {"refused": True, "completed": False, "margin_m": None, "reason": "refused: arming"}
    directory = flown(tmp_path, dict.fromkeys(range(4), refused), flights=4)
    stated = certificate(read(directory), directory, 0.95)
    assert {found["count"] for found in stated["findings"].values()} == {4}
    assert {found["upper"] for found in stated["findings"].values()} == {1.0}


def test_a_margin_that_is_no_number_is_below_0(tmp_path: Path) -> None:
    directory = flown(tmp_path, {}, flights=1)
    (good,) = read(directory).rows
    lost = replace(good, margin_m=float("nan"))
    assert not violates(good, "margin below 0")
    assert lost.violated
    assert violates(lost, "margin below 0")
    assert violates(lost, ANY)


def test_a_grid_says_which_of_its_points_were_flown_and_whether_anything_is_random(
    tmp_path: Path,
) -> None:
    def stated(name: str, flights: int, scenario: str) -> dict[str, Any]:
        directory = flown(tmp_path / name, {}, flights, more=GRID, vary=MASSES, scenario=scenario)
        return certificate(read(directory), directory, 0.95)

    calm = stated("calm", 5, "walls-calm")
    assert calm["varied"] == ["vehicle_scale.mass: 3 of 3 values of a grid: 0.95, 1, 1.05"]
    assert "3 of the 3 points of a grid; a point was flown this often: 1 to 2" in calm["assumed"]
    assert "nothing is random" in calm["assumed"]
    assert calm["random"] == []
    part = stated("part", 1, "walls")
    assert part["varied"] == ["vehicle_scale.mass: 1 of 3 values of a grid: 0.95"]
    assert "1 of the 3 points" in part["assumed"]
    assert "with other random numbers" in part["assumed"]
    assert part["random"]


def test_flights_that_are_all_one_flight_are_no_sample(tmp_path: Path) -> None:
    directory = flown(tmp_path, {}, vary="", scenario="walls-calm")
    assert (
        "all their flights are one flight"
        in certificate(read(directory), directory, 0.9)["assumed"]
    )


def test_what_another_key_moves_was_varied_and_all_the_rest_is_listed(tmp_path: Path) -> None:
    vary = "wind_m_s = { uniform = [0.0, 1.0] }\nlatency_ms = { choice = [0.0, 2.0] }"
    walls = Path(str(sitl.__file__)).parent / "scenarios" / "walls.toml"
    windy = walls.read_text(encoding="utf-8") + "\n[air]\nbody_drag_m2 = 0.1\n"
    (tmp_path / "windy.toml").write_text(windy, encoding="utf-8")
    more = 'suites = ["mocap"]'
    directory = flown(tmp_path, {}, 2, vary=vary, scenario="windy.toml", more=more)
    held = "\n".join(certificate(read(directory), directory, 0.95)["not_varied"])
    assert "air: turbulence_m_s" in held
    assert "wind_m_s.0" not in held
    assert "latency_ms" not in held
    assert "sensors: " in held
    assert "imu.rate_hz = 500" in held
    other = flown(tmp_path / "other", {}, 2)
    held = "\n".join(certificate(read(other), other, 0.95)["not_varied"])
    assert "wind_m_s.0 = 0" in held
    assert "imu.latency_ms = 0" in held
    assert "latency_ms: no added latency" in held
    assert "disturbances: 0.amplitude_m_s2 = 0.8" in held


def test_margins_of_a_part_of_the_flight_are_counted(tmp_path: Path) -> None:
    cut = {
        1: {"contact": True, "completed": False, "margin_m": -0.1, "duration_s": 1.2},
        2: {"completed": False, "modes": "land"},
        3: {"completed": False, "duration_s": 0.5},
        4: {"error": True, "completed": False, "margin_m": None, "duration_s": 0.0},
    }
    directory = flown(tmp_path, cut)
    stated = certificate(read(directory), directory, 0.95)
    (margins,) = stated["margins"]
    assert (margins["ended_at_contact"], margins["cut_short"]) == (1, 3)
    assert "3 ended early or left their trajectory (1 by contact)" in "\n".join(sentences(stated))


@pytest.mark.parametrize("design", ["sobol", "latin-hypercube", "grid"])
def test_no_tail_is_fitted_to_flights_that_are_not_independent(tmp_path: Path, design: str) -> None:
    directory = flown(tmp_path, {}, 150, more=f'design = "{design}"', vary=MASSES)
    (margins,) = certificate(read(directory), directory, 0.95, refits=3)["margins"]
    assert f"of design {design}, not drawn independently" in margins["tail"]["none"]


def test_flights_without_a_row_are_not_left_out(tmp_path: Path) -> None:
    directory = flown(tmp_path, {4: {"reason": "lost"}, 6: {"reason": "lost"}})
    with pytest.raises(CampaignError, match=r"2 of 40 flights have no row.*finish with `pandion"):
        certificate(read(directory), directory, 0.95)


def test_fewer_flights_than_the_file_asks_for_are_not_certified(tmp_path: Path) -> None:
    directory = flown(tmp_path, {k: {"reason": "lost"} for k in range(3, 8)}, 8)
    write_anew(directory, flights=3)
    assert read(directory).complete
    with pytest.raises(CampaignError, match="5 of 8 flights have no row"):
        certificate(read(directory), directory, 0.95)


def test_facts_of_before_the_first_flight_hold_no_journal(tmp_path: Path) -> None:
    directory = flown(tmp_path, {}, 2)
    write_anew(directory, journal=asdict(Seal()))
    with pytest.raises(CampaignError, match=r"before the first of 2 flights.*finish with `pandion"):
        certificate(read(directory), directory, 0.95)


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"seed": 1}, "seed"),
        ({"scenario": "walls-calm", "fault": "wind"}, "scenario, fault"),
        ({"values": {"vehicle_scale.mass": 1.0}}, "values"),
        ({"duration_s": 2.1}, "duration_s"),
        ({"duration_s": 1.0}, "duration_s"),
        ({"duration_s": float("nan"), "completed": False}, "duration_s"),
        ({"margin_m": float("inf")}, "margin_m"),
    ],
)
def test_a_row_that_no_flight_of_the_plan_can_leave_is_refused(
    tmp_path: Path, wrong: dict[str, Any], named: str
) -> None:
    directory = flown(tmp_path, {1: wrong}, 2)
    with pytest.raises(CampaignError, match=f"flight 1 is none of .*, by its {named}: fly"):
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
    """Write the journal again with another row of a flight."""
    result = read(directory)
    rows = [replace(one, **fields) if one.flight == number else one for one in result.rows]
    (directory / JOURNAL).unlink()
    journal = Journal(directory / JOURNAL)
    journal.append((key(result.plan, one), asdict(one)) for one in rows)
    journal.close()
    seal(directory)


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
    write_anew(directory, **facts)
    with pytest.raises(
        CampaignError, match=r"flown by other code \(ffffffff.*read it with Pandion"
    ):
        read(directory)
