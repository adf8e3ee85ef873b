"""What ``pandion falsify`` refuses, each in one sentence."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pandion.falsify import main

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
        ({"acceleration_m_s2": [[float("nan"), 0.0, 0.0]]}, "within ±50"),
        ({"first_step": -1}, "there must be some"),
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
