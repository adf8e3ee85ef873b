"""What is written as a scenario file is read as the same scenario."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from sitl.faults.keys import Fault
from sitl.scenario import Scenario, Sensors, Sequence, Wind, vehicle_of
from sitl.scenario_file import (
    ScenarioError,
    load_scenario,
    parse_scenario,
    scenario_digest,
    scenario_names,
    with_vehicle,
)
from sitl.scenario_text import scenario_text, write_scenario
from vehicles.vehicle_file import PACKAGED


@pytest.mark.parametrize("name", scenario_names())
def test_every_packaged_scenario_comes_back(name: str) -> None:
    scenario = load_scenario(name)
    assert parse_scenario(scenario_text(scenario), name) == scenario


@pytest.mark.parametrize("suite", ["mocap", "vio", "rtk"])
def test_every_suite_of_sensors_comes_back_with_changed_numbers(suite: str) -> None:
    scenario = load_scenario("walls", suite)
    assert not isinstance(scenario.sensors, Sensors)
    imu = replace(scenario.sensors.imu, latency_ms=6.0, gyro_turn_on_rad_s=0.1 + 0.2)
    scenario = replace(scenario, sensors=replace(scenario.sensors, imu=imu))
    assert parse_scenario(scenario_text(scenario), "walls") == scenario


def _found() -> Scenario:
    values = ((0.1 + 0.2, -0.8, 1e-17), (0.0, 0.8, -1.0 / 3.0))
    return replace(
        load_scenario("crossing"),
        disturbances=(Sequence(values, period_s=0.05, name="worst"), Wind((0.1, 0.0, 0.0))),
        faults=(Fault("motor", "weak", start_s=3.0, share=0.9),),
        description='"quoted", a \\ and µ',
    )


def test_a_vehicles_file_is_the_same_wherever_the_scenario_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "byo").mkdir()
    text = (PACKAGED / "hexa-3r.toml").read_text(encoding="utf-8")
    (tmp_path / "byo" / "mine.toml").write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    found = with_vehicle(load_scenario("walls"), "byo/mine.toml")
    write_scenario(found, Path("byo/beside.toml"))
    assert 'vehicle = "mine.toml"' in Path("byo/beside.toml").read_text(), "both can be moved"
    write_scenario(found, Path("above.toml"))
    monkeypatch.chdir("/")
    (tmp_path / "else").mkdir()
    write_scenario(found, tmp_path / "else" / "there.toml")
    for place in ("byo/beside.toml", "above.toml", "else/there.toml"):
        again = load_scenario(str(tmp_path / place))
        assert vehicle_of(again) == vehicle_of(found)
        assert again.vehicle == str(tmp_path / "byo" / "mine.toml")
        assert scenario_digest(str(tmp_path / place))


def test_what_a_search_found_comes_back_to_the_last_digit_after_its_comment() -> None:
    scenario = _found()
    text = scenario_text(scenario, "least margin -3.2 mm\nof flight 7")
    assert text.startswith("# least margin -3.2 mm\n# of flight 7\n")
    assert parse_scenario(text, "crossing") == scenario


def test_only_what_differs_from_the_defaults_is_written() -> None:
    table = tomllib.loads(scenario_text(replace(load_scenario("walls"), disturbances=())))
    assert "disturbances" not in table
    assert "vehicle_scale" not in table
    assert table["body"] == "points"


def test_a_sequence_that_is_no_array_of_vectors_is_refused_by_its_key() -> None:
    text = scenario_text(_found()).replace("acceleration_m_s2 = [0.1, 0.0, 0.0]", "")
    wrong = text.replace("period_s = 0.05", "period_s = 0.0501")
    with pytest.raises(ScenarioError, match=r"disturbances\[0\]\.period_s = 0.0501: must be 0.002"):
        parse_scenario(wrong, "found")
    flat = '[[disturbances]]\nkind = "sequence"\nacceleration_m_s2 = 3\n'
    walls = scenario_text(replace(load_scenario("walls"), disturbances=()))
    with pytest.raises(ScenarioError, match="must be an array of arrays of 3 numbers"):
        parse_scenario(walls + flat, "found")
