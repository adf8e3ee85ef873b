"""Tables, figures and pages: the shapes that others read."""

from __future__ import annotations

import html
import itertools
import json
import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from pandion import reproduce
from studies.campaign.campaign import Campaign, silent
from studies.paper.cases import CASES, TUNING_SEEDS, grazing, reference_floor_m, scenario
from studies.paper.catalogue import STUDIES, study
from studies.paper.page import write
from studies.paper.published import TABLE_3, TABLE_4
from studies.paper.settings import Report, Settings

TINY = Settings(plant="double-integrator", seeds=range(100, 101), duration_s=0.5)
PROMISED = {
    "plant",
    "case",
    "disturbance",
    "controller",
    "comparison",
    "passed",
    "total",
    "te_m",
    "cs_mean",
    "ce_mean",
    "worst_margin_m",
    "wilson_low",
    "wilson_high",
    "cs_sum",
    "ce_sum",
}


@pytest.fixture(scope="module")
def table4() -> Report:
    return study("table4")(TINY, Campaign(0))


@pytest.mark.long
def test_table_4_has_a_row_for_everyone_in_every_case(table4: Report) -> None:
    rows = table4.rows
    for row in rows:
        assert set(row) >= PROMISED
        assert row["total"] == 1
        assert 0 <= row["wilson_low"] <= row["passed"] <= row["wilson_high"] <= 1
    paper = {
        (row["controller"], row["case"], row["disturbance"])
        for row in rows
        if row["comparison"] == "paper"
    }
    assert paper >= set(TABLE_4)
    fair = {
        (row["controller"], row["case"])
        for row in rows
        if row["comparison"] == "like-for-like" and row["disturbance"]
    }
    everyone = {"naive", "hc", "hc-tightened", "sc", "blf"}
    assert fair == {(name, case) for name in everyone for case in CASES} | {("naive-centred", "II")}
    assert_timed_and_named(table4)


@pytest.mark.long
def test_table_4_at_speed_has_every_tightening_and_scenarios_of_its_own() -> None:
    report = study("table4")(replace(TINY, family="dash"), Campaign(0))
    assert {row["scenario"] for row in report.rows} == {
        "dash", "dash-calm", "chase", "chase-calm"
    }  # fmt: skip
    names = {row["controller"] for row in report.rows if row["case"] == "I"}
    assert "hc-tightened-100-mm" in names
    assert {(row["controller"], row["case"], row["disturbance"]) for row in report.rows} >= set(
        TABLE_4
    )


@pytest.mark.long
def test_rivals_have_their_settings_and_a_front_of_what_nobody_beats(tmp_path: Path) -> None:
    tiny = replace(TINY, family="dash", duration_s=0.2)
    report = study("rivals")(tiny, Campaign(0))
    families = {row["family"] for row in report.rows}
    assert {"naive", "hc", "hc softened, n = 20", "hc softened, terminal set", "sc"} < families
    for case, air in itertools.product(CASES, (False, True)):
        rows = [r for r in report.rows if (r["case"], r["disturbance"]) == (case, air)]
        for row in (r for r in rows if r["on_front"]):
            assert row["passed"] == row["total"]
            assert not any(
                other["te_m"] <= row["te_m"] and other["worst_margin_m"] > row["worst_margin_m"]
                for other in rows
                if other["passed"] == other["total"]
            )
        assert any(row["on_front"] for row in rows)
    assert "<svg" in write(report, tiny, (), "rivals", tmp_path).read_text()


@pytest.mark.long
def test_rows_are_json_without_numbers_that_are_none(table4: Report, tmp_path: Path) -> None:
    write(table4, TINY, ("Command: test",), "table4", tmp_path)
    rows = json.loads((tmp_path / "table4-rows.json").read_text())
    assert rows == table4.rows


def test_the_page_is_self_contained_and_names_the_seeds(table4: Report, tmp_path: Path) -> None:
    page = write(table4, TINY, ("Command: test",), "table4", tmp_path).read_text()
    assert_self_contained(page)
    assert "Seeds 0 to 29 were used for tuning" in page
    assert "disjoint" in page
    for line in table4.deviations:
        assert html.escape(line) in page


def test_a_page_of_tuning_seeds_says_so(table4: Report, tmp_path: Path) -> None:
    tuned = Settings(plant="double-integrator", seeds=range(29, 31))
    assert tuned.tuned_on == (29,)
    page = write(table4, tuned, (), "table4", tmp_path).read_text()
    assert "disjoint" not in page
    assert "not how well it carries over" in page


@pytest.mark.long
@pytest.mark.parametrize("name", ["fig2", "fig6", "fig7", "fig8"])
def test_a_figure_has_its_numbers_beside_it(name: str, tmp_path: Path) -> None:
    report = study(name)(TINY, Campaign(0, report=silent))
    page = write(report, TINY, (), name, tmp_path).read_text()
    assert_self_contained(page)
    assert "<svg" in page
    assert_timed_and_named(report)
    assert (tmp_path / f"{name}.svg").read_text().startswith("<?xml")
    numbers = json.loads((tmp_path / f"{name}.json").read_text())
    if name != "fig2":
        assert set(numbers) == {"naive", "hc", "sc", "blf"}
        for arrays in numbers.values():
            assert len({len(values) for values in arrays.values()}) == 1
            assert arrays["t_s"][0] == 0.0


def test_table_3_has_the_papers_columns_and_ours() -> None:
    report = study("table3")(TINY, Campaign(0))
    assert {(row["horizon"], row["lambda"]) for row in report.rows} > set(TABLE_3)
    assert {row["horizon"] for row in report.rows if row["ours"]} == {1, 5, 10}
    assert all(row["tc_s"] > 0.0 for row in report.rows)
    assert_timed_and_named(report)


def test_the_reference_costs_tracking_error_only_where_it_is_unsafe() -> None:
    walls = scenario("I", disturbed=False)
    assert 0.005 < reference_floor_m(walls) < 0.03
    assert reference_floor_m(grazing(walls)) == 0.0
    assert reference_floor_m(scenario("II", disturbed=False)) == 0.0


@pytest.mark.parametrize("name", STUDIES)
def test_every_name_has_a_study_of_its_own(name: str) -> None:
    assert callable(study(name))
    assert sum(study(other) == study(name) for other in STUDIES) == 1


def test_default_seeds_are_fresh() -> None:
    assert not set(Settings().seeds) & set(TUNING_SEEDS)


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["table5"], "did you mean table4"),
        (["table4", "--plant", "ful"], "did you mean full"),
        (["table4", "--seeds", "5:5"], "A:B"),
        (["table4", "--seeds=-3:5"], "A:B"),
        (["table4", "--duration", "nan"], "duration"),
        (["table4", "--workers=-1"], "from 0 to 1024"),
        (["robustness", "--sensors", "mokap"], "did you mean mocap"),
        (["table4", "--scenario", "dahs"], "did you mean dash"),
        (["table4", "--sedes", "1:2"], "did you mean --seeds"),
    ],
)
def test_a_slip_is_refused_in_one_sentence(
    words: list[str], reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as exit_code:
        reproduce.main(words)
    assert exit_code.value.code == 2
    reported = capsys.readouterr().err
    assert reason in reported
    assert len(reported.splitlines()) == 1


def test_the_command_writes_rows_page_and_a_verdict_on_the_seeds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, rows, junit = (tmp_path / name for name in ("out", "rows.json", "junit.xml"))
    words = ["smallest-sphere", "--plant", "double-integrator", "--seeds", "0:1"]
    words += ["--duration", "0.3", "--workers", "0", "--out", str(out), "--json", str(rows)]
    words += ["--junit", str(junit)]
    assert reproduce.main(words) == 0
    reported = capsys.readouterr().out
    assert "used for tuning" in reported
    found = json.loads(rows.read_text())
    assert [row["radius_m"] for row in found][:2] == [0.075, 0.070]
    assert (out / "smallest-sphere.html").exists()
    lines = (out / "smallest-sphere.md").read_text().splitlines()
    assert len([line for line in lines if line.startswith("| 0.")]) == len(found)
    assert (out / "journal.jsonl").exists()
    assert [one.get("time") for one in cases(junit)] == [f"{row['took_s']:.3f}" for row in found]
    assert all(row["took_s"] > 0.0 for row in found)
    assert reproduce.main(words) == 0  # from the journal, with the times that it keeps
    assert json.loads(rows.read_text()) == found


def cases(junit: Path) -> list[ET.Element]:
    return ET.parse(junit).findall("testsuite/testcase")


def assert_timed_and_named(report: Report) -> None:
    """As tests of a night's JUnit XML: each with the time it took, and the same name each night."""
    found = reproduce._cases(report)
    assert all(case.seconds > 0.0 for case in found)
    assert len({case.name for case in found}) == len(found)
    assert not any(result in case.name for case in found for result in ("tc_s", "radius_m"))


def assert_self_contained(page: str) -> None:
    for attribute in re.findall(r"""(?:src|href)\s*=\s*["']([^"']*)""", page):
        assert attribute.startswith(("#", "data:")), attribute
    assert "@import" not in page
    assert not re.search(r"url\((?!#)", page)
    assert "<script" not in page
