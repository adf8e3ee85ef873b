"""``pandion campaign``: from a file to journal, table and page; resumed, refused, flown again."""

from __future__ import annotations

import json
import shutil
import tomllib
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest

from pandion.campaign import main
from sitl.scenario_file import load_scenario
from sitl.scenario_text import scenario_text
from studies.campaign.plan import load_plan
from studies.campaign.store import read, sealed_facts
from studies.flight.closed_loop import RefusedError
from studies.flight.job import Job, fly_job
from studies.flight.result import FlightResult
from vehicles.vehicle_file import PACKAGED

TINY = """
flights = 3
duration_s = 0.3
scenarios = ["walls-calm", "own.toml"]
[vary]
vehicle_scale.mass = { uniform = [0.95, 1.05] }
wind_m_s2 = { choice = [0.1] }
"""


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """File and directory of a campaign that was flown in this process."""
    folder = tmp_path_factory.mktemp("campaign")
    file, out = folder / "tiny.toml", folder / "out"
    text = Path(__file__).parents[2] / "sitl" / "scenarios" / "workspace-calm.toml"
    (folder / "own.toml").write_text(text.read_text())
    file.write_text(TINY)
    assert main([str(file), "--workers=0", f"--out={out}"]) == 0
    return file, out


def test_the_example_can_be_flown(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--example"]) == 0
    assert tomllib.loads(capsys.readouterr().out)["flights"] == 200


@pytest.mark.long
def test_the_directory_holds_everything(campaign: tuple[Path, Path]) -> None:
    _, out = campaign
    result = read(out)
    assert result.complete
    assert [row.flight for row in result.rows] == [0, 1, 2]
    assert result.rows[1].scenario == "own.toml"
    assert all(row.completed for row in result.rows)
    facts = json.loads((out / "campaign.json").read_text())
    assert facts["flown"] == 3
    assert len(facts["worst"]) == 3
    assert facts["worst"][0]["margin_m"] == min(row.margin_m or 9.0 for row in result.rows)
    page = (out / "campaign.html").read_text()
    assert f"pandion campaign {out}/campaign.toml --flight 1" in page
    assert "<svg" in page
    assert "http://" not in page.replace("http://www.w3.org", "")
    # The copy is a campaign of its own.
    assert load_plan(out / "campaign.toml").digest == result.plan.digest


def test_the_table_has_the_rows_without_what_is_of_the_machine(
    campaign: tuple[Path, Path],
) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    _, out = campaign
    table = parquet.read_table(out / "rows.parquet").to_pydict()
    rows = read(out).rows
    assert table["margin_m"] == [row.margin_m for row in rows]
    assert table["vary.vehicle_scale.mass"] == [row.values["vehicle_scale.mass"] for row in rows]
    assert not {"took_s", "tc_p50_us"} & set(table)


def test_more_flights_are_added_and_none_is_flown_twice(
    campaign: tuple[Path, Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("studies.campaign.page._figures", lambda _: [])  # they cost the most
    file, flown = campaign
    out = tmp_path / "out"
    shutil.copytree(flown, out)
    before = (out / "journal.jsonl").read_text()
    target = tmp_path / "summary.json"
    words = [str(file), "--workers=0", f"--out={out}", "--flights=4", f"--json={target}"]
    assert main(words) == 0
    after = (out / "journal.jsonl").read_text()
    assert after.startswith(before)
    assert len(after.splitlines()) == 4
    assert json.loads(target.read_text())["flown"] == 4
    # Fewer than there are would leave some out, which could be those that went wrong.
    assert main([str(file), "--workers=0", f"--out={out}", "--flights=2"]) == 2
    assert "a campaign of 4 flights, and none may be left out" in capsys.readouterr().err
    assert main([str(file), "--workers=0", f"--out={out}"]) == 0
    assert "4 of 4" in capsys.readouterr().out


def test_a_flight_is_flown_again_with_what_pandion_fly_needs(
    campaign: tuple[Path, Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    _, out = campaign
    flights: list[Job] = []

    def counted(job: Job, *, traced: bool = False) -> FlightResult:
        flights.append(job)
        return fly_job(job, traced=traced)

    monkeypatch.setattr("studies.campaign.flight.fly_job", counted)
    assert main([str(out / "campaign.toml"), "--flight=1", f"--out={tmp_path}"]) == 0
    assert flights == [load_plan(out / "campaign.toml").flight(1).job]
    traced: dict[str, Any] = json.loads((tmp_path / "flight-1.json").read_text())
    row = read(out).rows[1]
    assert traced["row"] == json.loads(json.dumps(row.compared()))
    assert len(traced["trace"]) > 3
    flown = load_scenario(str(tmp_path / "flight-1.toml"))
    assert flown.vehicle_scale.mass == row.values["vehicle_scale.mass"]
    said = capsys.readouterr().out
    assert f"pandion fly {tmp_path / 'flight-1.toml'} --seed={row.seed}" in said


def test_a_flight_of_an_own_vehicle_is_written_where_its_vehicle_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(job: Job, *, traced: bool = False) -> FlightResult:
        raise RefusedError("it will not arm")

    monkeypatch.setattr("studies.campaign.flight.fly_job", refused)
    monkeypatch.chdir(tmp_path)
    shutil.copyfile(PACKAGED / "hexa-3r.toml", "mine.toml")
    own = scenario_text(load_scenario("walls-calm", None, "hexa-3r"))
    Path("own.toml").write_text(own.replace("hexa-3r", "mine.toml"))
    Path("one.toml").write_text(TINY.replace('"walls-calm", ', ""))
    assert main(["one.toml", "--flight=1", "--out=else/where"]) == 0
    found = load_scenario("else/where/flight-1.toml")
    assert found.vehicle == str(tmp_path / "mine.toml")


def test_a_flight_that_is_refused_leaves_its_row_and_no_trace(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(job: Job, *, traced: bool = False) -> FlightResult:
        raise RefusedError("it will not arm")

    monkeypatch.setattr("studies.campaign.flight.fly_job", refused)
    file = tmp_path / "one.toml"
    file.write_text(TINY.replace(', "own.toml"', ""))
    assert main([str(file), "--flight=2", f"--out={tmp_path}"]) == 0
    assert "refused: it will not arm" in capsys.readouterr().out
    written = json.loads((tmp_path / "flight-2.json").read_text())
    assert written["row"]["refused"]
    assert "trace" not in written


def test_flights_of_another_campaign_are_not_mixed_in(
    campaign: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = campaign
    other = file.with_name("other.toml")
    other.write_text(TINY.replace("0.95", "0.9"))
    assert main([str(other), "--workers=0", f"--out={out}"]) == 2
    assert "flights of another campaign" in capsys.readouterr().err
    changed = tmp_path / "changed"
    changed.mkdir()
    for one in ("campaign.toml", "own.toml", "journal.jsonl"):
        (changed / one).write_text((out / one).read_text())
    facts = json.loads((out / "campaign.json").read_text())
    facts["digests"]["code"] = "0" * 32
    (changed / "campaign.json").write_text(json.dumps(sealed_facts(facts)))
    assert main([str(file), "--workers=0", f"--out={changed}"]) == 2
    assert "flights of other code" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ([], "--example"),
        (["nowhere.toml"], "cannot read nowhere.toml"),
        (["x.toml", "--workers=1", "--scheduler=tcp://a:1"], "not allowed with"),
        (["x.toml", f"--tls-ca-file={__file__}"], "are for a scheduler"),
        (
            ["x.toml", "--scheduler=tls://a:1", f"--tls-cert={__file__}", f"--tls-key={__file__}"],
            "need each other and --tls-ca-file",
        ),
    ],
)
def test_what_cannot_be_flown_is_refused_in_a_sentence(
    words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        code = main(words)
    except SystemExit as error:
        code = int(str(error.code))
    said = capsys.readouterr().err
    assert code == 2
    assert sentence in said
    assert len(said.strip().splitlines()) == 1


def test_the_command_that_goes_on_flies_what_was_asked_where_it_was_asked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("pandion.campaign._all", interrupted)
    file, out = tmp_path / "a b.toml", tmp_path / "out"
    file.write_text(TINY.replace(', "own.toml"', ""))
    words = ["--flights=2", "--scheduler=tcp://a:1"]
    assert main([str(file), *words, f"--out={out}"]) == 1
    said = capsys.readouterr().err
    assert f"campaign '{file}' --flights=2 --scheduler=tcp://a:1 --out {out}" in said


def test_a_flight_that_cannot_be_flown_is_refused_in_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "far.toml"
    file.write_text(
        'flights = 3\nscenarios = ["walls"]\n[vary]\nstart.position_m.0 = { choice = [90.0] }\n'
    )
    assert main([str(file), "--flight=1", f"--out={tmp_path / 'out'}"]) == 2
    said = capsys.readouterr().err
    assert "flight 1 cannot be flown" in said
    assert len(said.strip().splitlines()) == 1


@pytest.mark.long
def test_a_campaign_gives_a_server_its_flights_and_fails_where_it_must(
    campaign: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = campaign
    junit = tmp_path / "flights.xml"
    words = [str(file), "--workers=0", f"--out={out}", f"--junit={junit}"]
    assert main([*words, "--require=margin>=0.001"]) == 0
    assert "PASS margin>=0.001: minimum margin" in capsys.readouterr().out
    suite = ET.parse(junit).find("testsuite")
    assert suite is not None
    assert (suite.get("tests"), suite.get("failures"), suite.get("errors")) == ("4", "0", "0")
    assert suite.find("testcase").get("classname").startswith("walls-calm")  # type: ignore[union-attr]
    assert main([*words, "--require=margin>=9", "--require=p<0.1"]) == 1
    assert "FAIL p<0.1: 0 of 3 flights, at most 0.632 at 95 %" in capsys.readouterr().out
    assert (out / "campaign.html").read_text(encoding="utf-8").count(">FAIL<") == 2
    failed = ET.parse(junit).findall("testsuite/testcase/failure")
    assert len(failed) == 2
    assert main(words) == 0
    assert "PASS 3 of 3 flights completed without a violation" in capsys.readouterr().out
    assert main([*words, "--flight=1"]) == 2
