"""Own parts by import path, in campaign files and on the command line, on workers too."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from pyarrow import parquet

from pandion.__main__ import main
from studies.campaign.keys import CampaignError
from studies.campaign.plan import OwnNames, load_plan
from studies.campaign.store import PLAN as PLAN_FILE
from studies.campaign.store import begin
from studies.flight.fly_again import fly_command
from tests.cli.command import environment

MODULE = '''
import numpy as np
from fsw.autopilot.mpc.planner import Planner
from fsw.autopilot.parameters.flight_config import flight_config

class Ours:
    def __init__(self):
        config = flight_config(body="points")
        self.planner = Planner(config.planner, config.airframe, lambda: 0.0)
    def plan(self, request):
        return self.planner.plan(request)

class Idle:
    """Gives up at once."""
    def plan(self, request):
        return None

def hold(seen):
    """Carries the weight, whatever happens."""
    return np.full(4, 3.5 * 9.81 / 4.0), np.zeros(2)
'''
PLAN = 'scenarios = ["walls"]\nflights = {flights}\nduration_s = 0.4\n'


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a module and a campaign file, as a user has them."""
    (tmp_path / "ownlaws.py").write_text(MODULE)
    (tmp_path / "plan.toml").write_text(PLAN.format(flights=1))
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "ownlaws", raising=False)
    monkeypatch.setattr(sys, "path", list(sys.path))
    return tmp_path


def rows(folder: Path) -> list[dict[str, object]]:
    found: list[dict[str, object]] = parquet.read_table(folder / "rows.parquet").to_pylist()
    return found


@pytest.mark.long
def test_a_plan_flies_the_parts_that_its_file_or_the_command_line_names(place: Path) -> None:
    ours = load_plan(place / "plan.toml")
    named = load_plan(place / "plan.toml", OwnNames("ownlaws:Ours"))
    idle = load_plan(place / "plan.toml", OwnNames("ownlaws:Idle"))
    assert len({ours.digest, named.digest, idle.digest}) == 3
    assert named.cases[0].controller == "ownlaws:Ours"
    flown = [plan.flight(0).job.row() for plan in (ours, named, idle)]
    assert flown[0].te_m == flown[1].te_m
    assert (flown[1].failures, flown[2].plans) == (0, 0)
    held = load_plan(place / "plan.toml", OwnNames(controller="ownlaws:hold")).flight(0).job
    assert held.row().te_m != flown[0].te_m
    # Kept as a whole: the copy says what was flown.
    begin(place / "kept", place / "plan.toml", named, None)
    assert load_plan(place / "kept" / PLAN_FILE).digest == named.digest
    assert load_plan(place / "kept" / PLAN_FILE, OwnNames("ownlaws:Ours")).head == ""
    with pytest.raises(CampaignError, match='not flown with "ownlaws:Idle"'):
        load_plan(place / "kept" / PLAN_FILE, OwnNames("ownlaws:Idle"))
    again = fly_command("pandion", held, "blf", place / "s.toml", None)
    assert "controller='ownlaws:hold'" in again


def test_the_text_of_a_module_is_part_of_its_flights(place: Path) -> None:
    before = load_plan(place / "plan.toml", OwnNames("ownlaws:Ours")).digest
    (place / "ownlaws.py").write_text(MODULE + "\n# changed\n")
    del sys.modules["ownlaws"]
    assert load_plan(place / "plan.toml", OwnNames("ownlaws:Ours")).digest != before


@pytest.mark.parametrize(
    "words",
    [
        ["campaign", "plan.toml", "--planner=nomodule:X"],
        ["campaign", "plan.toml", "--planner=ownlaws:Nothing"],
        ["campaign", "plan.toml", "--controller=ownlaws"],
        ["falsify", "walls", "--controller=ownlaws:hold"],
        ["falsify", "walls", "--planner=ownlaws:Nothing"],
        ["reproduce", "robustness", "--planner=ownlaws:Ours"],
        ["reproduce", "table4", "--controller=ownlaws:hold", "--plant=double-integrator"],
        ["reproduce", "table4", "--planner=ownlaws:Nothing", "--seeds=100:101", "--workers=0"],
    ],
)
def test_a_part_that_is_not_there_is_one_sentence(
    words: list[str], place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


@pytest.mark.long
def test_workers_import_it_too(place: Path) -> None:
    (place / "plan.toml").write_text(PLAN.format(flights=4))
    for k, words in enumerate(([], ["--planner=ownlaws:Ours"])):
        command = ["campaign", "plan.toml", "--workers=2", f"--out=out{k}", *words]
        done = subprocess.run(
            [sys.executable, "-m", "pandion", *command],
            cwd=place,
            env=environment(),
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
    plain, own = rows(place / "out0"), rows(place / "out1")
    assert [one["te_m"] for one in plain] == [one["te_m"] for one in own]
    assert {one["controller"] for one in own} == {"ownlaws:Ours"}


@pytest.mark.long
def test_table_4_has_one_more_row(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--seeds=100:101", "--duration=1", "--workers=0", "--json=rows.json", "--out=t4"]
    main(["reproduce", "table4", "--planner=ownlaws:Ours", *words])
    found = json.loads((place / "rows.json").read_text())
    names = {row["controller"] for row in found}
    assert {"Ours", "blf"} <= names
