"""What ``pandion falsify`` refuses, each in one sentence, and what its exit code says."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pandion.falsify import main
from studies.search.falsify import Bounds, Found, Outcome, WholeFound, WholeOutcome
from studies.search.plan_record import PlanRecord, Start
from studies.search.surfaces import BEYOND
from studies.search.tracked_flight import Disturbance
from studies.search.whole_flight import Flown

GOOD = {
    "format": "pandion-disturbance-1",
    "scenario": "workspace",
    "first_step": 700,
    "acceleration_m_s2": [[0.8, 0.0, 0.0]],
}


def _refusal(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert main(list(words)) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    return said


@pytest.mark.parametrize("scenario", ["ground", "hop"])
def test_a_flight_that_does_not_start_on_a_trajectory_is_refused(
    scenario: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "does not start in the air" in _refusal(capsys, scenario)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"format": "other"}, "is no disturbance"),
        ({"acceleration_m_s2": [[1.0, 2.0]]}, "is no disturbance"),
        ({"acceleration_m_s2": "abc"}, "is no disturbance"),
        ({"acceleration_m_s2": []}, "there must be some"),
        ({"acceleration_m_s2": [[1e9, 0.0, 0.0]]}, "within ±50"),
        ({"acceleration_m_s2": [[float("nan"), 0.0, 0.0]]}, "holds NaN"),
        ({"first_step": -1}, "there must be some"),
        ({"first_step": float("inf")}, "is no disturbance"),
        ({"first_step": 700.5}, "is no disturbance"),
        ({"first_step": 10**9}, "first_step is after the end"),
        ({"first_step": 10**400}, "an integer must have at most 64 bits"),
        ({"note": [[[[[[[[[[[[[[[[[[]]]]]]]]]]]]]]]]]]}, "is nested too deeply"),
        ({"scenario": "walls"}, "was found in walls"),
    ],
)
def test_a_file_that_is_no_kept_disturbance_is_refused(
    change: dict[str, object], why: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "worst.json"
    path.write_text(json.dumps(GOOD | change), encoding="utf-8")
    assert why in _refusal(capsys, "workspace", "--replay", str(path))


def test_a_missing_file_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    missing = tmp_path / "none.json"
    assert "none.json" in _refusal(capsys, "workspace", "--replay", str(missing))


def test_a_flight_that_ends_before_there_is_a_plan_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    nothing = PlanRecord(*np.zeros((3, 0)), np.zeros((0, 2), dtype=np.int64), ())
    monkeypatch.setattr("studies.search.falsify.record", lambda *_: nothing)
    assert main(["workspace", f"--out={tmp_path}", "--evaluations=20"]) == 2
    assert "before the vehicle has a plan" in capsys.readouterr().err


START = Start(0, 700, np.zeros(21), None)  # type: ignore[arg-type]  # not flown here
PUSHED = Disturbance(0.8, 50, np.zeros((0, 3)), np.eye(3))


def _found(share: float, axes: int) -> Found:
    return Found(
        share=share,
        off_m=(0.08, 0.0, 0.0),
        margin_m=-0.01,
        axes=axes,
        start=START,
        kind="adversary, held 100 ms",
        filtered_ticks=0,
        pushes=((0.8, 0.0, 0.0),),
        disturbance=PUSHED,
    )


@pytest.mark.parametrize(
    ("one", "many", "claims_many", "contact", "code", "said"),
    [
        (0.9, 0.9, True, None, 0, "claim holds"),
        (0.9, 1.5, False, None, 0, "no claim at this amplitude"),
        (0.9, 1.5, True, None, 1, "claim BROKEN"),
        (1.1, 0.9, False, None, 1, "claim BROKEN"),
        (0.9, 0.9, True, "the base hit the wall", 1, "the base hit the wall"),
    ],
)
def test_the_exit_code_follows_what_is_claimed(
    one: float,
    many: float,
    claims_many: bool,
    contact: str | None,
    code: int,
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    bounds = Bounds(
        one_axis=0.07,
        one_up=0.01,
        across=0.09,
        up=0.02,
        all_axes_up_to=0.5,
        claims_one_axis=True,
        claims_all_axes=claims_many,
    )
    single, several = _found(one, 1), _found(many, 3)
    outcome = Outcome(bounds, 9, several, single, several, several)
    flown = Flown((0.1, 0.0, 0.0), -0.01, contact, 1, 1, ())
    stretch = WholeFound(START, "adversary, held 100 ms", flown)
    whole = WholeOutcome(1, int(contact is not None), 1, 1, stretch, stretch)
    monkeypatch.setattr("studies.search.falsify.search_and_fly", lambda *_: (outcome, whole))
    written = tmp_path / "result.json"
    assert main(["walls", "--out", str(tmp_path), "--json", str(written)]) == code
    assert said in capsys.readouterr().out
    result = json.loads(written.read_text())
    assert result["holds"] == (code == 0)
    assert result["claims"] == {
        "one_axis": one <= 1.0,
        "all_axes": many <= 1.0 if claims_many else None,
        "no_contact": contact is None,
    }


@pytest.mark.requirement("REQ-SAFE-13")
@pytest.mark.parametrize(
    ("share", "whole_share", "unclaimed", "left", "code", "said"),
    [
        (0.7, 0.7, 0.9, False, 0, "force      70% of the largest, surface as it is"),
        (1.1, 0.7, 0.9, False, 1, "claim BROKEN, 110% of it"),
        (0.7, 1.1, 0.9, False, 1, "force      110% of the largest, whole stack"),
        (0.7, 0.7, 1.5, True, 0, "1 pressed on too hard (comes)"),
        (0.7, 0.7, 1.5, False, 1, "claim BROKEN, 1 in silence"),
    ],
)  # fmt: skip
def test_the_exit_code_follows_the_force_and_what_was_said_of_it(
    share: float,
    whole_share: float,
    unclaimed: float,
    left: bool,
    code: int,
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    bounds = Bounds(0.07, 0.01, 0.09, 0.02, 0.5, True, True, claims_force=True)
    found = replace(_found(0.9, 3), force_share=share)
    outcome = Outcome(bounds, 9, found, None, found, found, found)
    flown = Flown((0.1, 0.0, 0.0), 0.01, None, 0, 0, (), whole_share)
    stretch = WholeFound(START, "adversary, held 100 ms", flown)
    comes = next(met for met in BEYOND if met.name == "comes")
    past = replace(stretch, met=comes, flown=replace(flown, force_share=unclaimed, left=left))
    whole = WholeOutcome(1, 0, 0, 0, stretch, stretch, None, stretch, (past,))
    monkeypatch.setattr("studies.search.falsify.search_and_fly", lambda *_: (outcome, whole))
    written = tmp_path / "result.json"
    assert main(["probe", "--out", str(tmp_path), "--json", str(written)]) == code
    assert said in capsys.readouterr().out
    claims = json.loads(written.read_text())["claims"]
    assert claims["force"] == (max(share, whole_share) <= 1.0)
    assert claims["not_in_silence"] == (unclaimed <= 1.0 or left)
    assert claims["no_contact"]
    assert (tmp_path / "hardest.json").exists()
