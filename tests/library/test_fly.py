"""``pandion.fly`` is the flight of a campaign, of ``pandion fly``, and of a simulator by hand."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

import pandion
from fsw.autopilot.parameters.flight_config import flight_config
from pandion.result import table_rows
from sitl.scenario_file import load_scenario
from sitl.scenario_text import scenario_text
from studies.campaign.plan import load_plan
from studies.flight.closed_loop import simulate
from tests.cli.test_full_disk import no_file_longer_than
from tests.library.conftest import BRIEF_S
from vehicles.vehicle_file import PACKAGED

Flown = Callable[[str], pandion.Result]
# The suite gnss knows its height too badly to fly between these walls, and refuses to.
each_suite = pytest.mark.parametrize(
    "suite",
    ["perfect", "mocap", *(pytest.param(one, marks=pytest.mark.long) for one in ("vio", "rtk"))],
)
OF_THE_MACHINE = {"took_s", "tc_p50_us", "tc_p99_us"}


def _same(row: object) -> dict[str, object]:
    return {key: value for key, value in asdict(row).items() if key not in OF_THE_MACHINE}  # type: ignore[call-overload]


@each_suite
def test_it_is_the_row_of_a_campaign(suite: str, flown: Flown, tmp_path: Path) -> None:
    file = tmp_path / "one.toml"
    file.write_text(
        f'scenarios = ["walls"]\nsuites = ["{suite}"]\nflights = 1\nduration_s = {BRIEF_S}\n'
    )
    job = replace(load_plan(file).flight(0).job, seed=3)
    result = flown(suite)
    assert result.row is not None
    assert _same(result.row) == _same(job.row())


@each_suite
def test_a_simulator_by_hand_with_our_autopilot_flies_the_same(suite: str, flown: Flown) -> None:
    simulator = pandion.Simulator("walls", seed=9, sensors=suite, duration_s=BRIEF_S)
    simulator.reset(seed=3)
    autopilot = pandion.Autopilot(simulator)
    while not simulator.over:
        simulator.step(*autopilot())
    assert simulator.result == flown(suite).truth
    assert autopilot.result.planner.texts == flown(suite).texts


def test_without_its_log_it_is_the_same_flight(flown: Flown) -> None:
    quick = pandion.fly("walls", seed=3, sensors="perfect", duration_s=BRIEF_S, log=False)
    assert quick.truth == flown("perfect").truth
    with pytest.raises(FileNotFoundError, match="log=True"):
        _ = quick.topics


def test_a_log_that_ends_early_is_told_with_the_result() -> None:
    with no_file_longer_than(150_000):
        result = pandion.fly("walls", seed=3, sensors="perfect", duration_s=BRIEF_S)
    names = [one.rpartition("/")[2] for one in result.metrics["unwritten"]]
    assert "flight.ulg: File too large" in names
    assert result.completed


@pytest.mark.long
@each_suite
def test_two_processes_are_pandion_fly_to_the_byte(
    suite: str, flown: Flown, tmp_path: Path
) -> None:
    out = tmp_path / "cli"
    words = ["fly", "walls", "--seed=3", f"--sensors={suite}", f"--duration={BRIEF_S}"]
    subprocess.run(
        [sys.executable, "-m", "pandion", *words, "--api=none", f"--out={out}"],
        check=True,
        capture_output=True,
    )
    ours = pandion.fly("walls", seed=3, sensors=suite, duration_s=BRIEF_S, processes=True)
    assert (ours.path / "flight.ulg").read_bytes() == (out / "flight.ulg").read_bytes()
    result = json.loads((out / "result.json").read_text())
    for key in ("mpc", "inner", "real_time_factor", "logs"):
        assert result.pop(key) is not None
        assert dict(ours.metrics)[key] is not None
    assert result == {key: ours.metrics[key] for key in result}
    # In one process nothing is rounded by messages: the flights are alike, and not the same. With
    # satellites, whose heights come in millimetres, they are 0.6 mm apart.
    assert ours.tracking_rms == pytest.approx(flown(suite).tracking_rms, abs=1e-3)
    assert ours.metrics.keys() == flown(suite).metrics.keys()


def test_topics_are_arrays_and_files_are_those_of_a_flight(flown: Flown, tmp_path: Path) -> None:
    result = flown("mocap")
    position = result.topics["sim_ground_truth"]["p_WB"]
    assert position.shape == (40, 3)
    assert result.topics["sim_ground_truth"]["t"][0] == 0.0
    saved = result.save(tmp_path / "kept")
    log = pandion.load_log(saved)
    np.testing.assert_array_equal(log.topics["sim_ground_truth"]["p_WB"], position)
    assert log.metrics["completed"]
    assert log.information["scenario"] == "walls"
    page = log.report(tmp_path / "page.html").read_text(encoding="utf-8")
    assert "front" in page  # a margin: the scenario beside the log was found
    rows = dict(table_rows(dict(result.metrics), result.truth.tracking_error_max_m))
    assert (rows["vehicle"], rows["sensors"]) == ("paper", "mocap")
    assert "completed, flew 0.8 s; minimum margin" in repr(result)


def test_a_log_of_no_flight_is_refused(tmp_path: Path) -> None:
    with pytest.raises(Exception, match=r"flight\.ulg"):
        pandion.load_log(tmp_path)


def test_parameters_change_the_flight_and_their_ranges_hold(tmp_path: Path) -> None:
    calm = pandion.fly("walls", duration_s=0.4, params={"PLN_TILT_MAX": 20.0}, log=False)
    config = flight_config(body="points")
    tilt = replace(config.planner.limits, tilt=np.radians(20.0))
    same = replace(config, planner=replace(config.planner, limits=tilt))
    scenario = replace(load_scenario("walls"), duration_s=0.4)
    assert calm.truth == simulate(scenario, 0, same).truth
    (tmp_path / "my.parm").write_text("PLN_TILT_MAX 20\n")
    again = pandion.fly("walls", duration_s=0.4, params=tmp_path / "my.parm", log=False)
    assert again.truth == calm.truth
    for wrong in ({"PLN_TILT_MAX": 500.0}, {"NO_SUCH": 1.0}, {"PLN_TILT_MAX": float("nan")}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            pandion.fly("walls", params=wrong)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"scenario": "wals"}, 'did you mean "walls"'),
        ({"scenario": "ground"}, "starts on the ground"),
        ({"controller": "lqr"}, 'unknown controller "lqr"'),
        ({"sensors": "gps"}, "must be one of"),
        ({"tracking": "pi"}, 'unknown tracking "pi"; known: lqr, pid'),
        ({"body": "arm"}, 'unknown body "arm"; known: points, full'),
        ({"duration_s": -1.0}, "duration_s = -1.0"),
        ({"duration_s": float("nan")}, "duration_s"),
        ({"seed": -1}, "seed = -1"),
        ({"seed": 1.5}, "whole number"),
        ({"duration_s": math.inf}, "give duration_s"),
        ({"planner": "none", "processes": True}, "processes=True"),
    ],
)
def test_what_cannot_be_flown_is_one_sentence(arguments: dict[str, object], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence) as found:
        pandion.fly(**arguments)  # type: ignore[arg-type]
    assert "\n" not in str(found.value)


def test_a_scenario_is_changed_saved_and_flown_again(tmp_path: Path) -> None:
    scenario = pandion.load_scenario("walls", sensors="mocap", duration_s=0.4)
    near = replace(scenario, walls=scenario.walls[:1])
    path = pandion.save_scenario(near, tmp_path / "near.toml")
    assert replace(pandion.load_scenario(path), name=near.name) == near
    first, again = (pandion.fly(one, log=False) for one in (near, path))
    assert first.truth == again.truth


def test_an_own_vehicle_is_flown_by_a_relative_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "byo").mkdir()
    shutil.copyfile(PACKAGED / "hexa-3r.toml", tmp_path / "byo" / "mine.toml")
    monkeypatch.chdir(tmp_path)
    result = pandion.fly("walls", vehicle="byo/mine.toml", duration_s=0.1)
    assert result.metrics["vehicle"] == "mine"
    assert result.topics["sim_ground_truth"]["q_arm"].shape[1] == 3
    (tmp_path / "one.toml").write_text(
        'vehicle = "byo/mine.toml"\n' + scenario_text(pandion.load_scenario("walls"))
    )
    found = pandion.load_scenario("one.toml", duration_s=0.1)
    monkeypatch.chdir("/")
    assert pandion.fly(found).truth == result.truth


@pytest.mark.long
def test_another_vehicle_and_body_fly_in_two_processes() -> None:
    result = pandion.fly("crossing", vehicle="hexa-3r", duration_s=0.1, processes=True, body="full")
    assert result.metrics["vehicle"] == "hexa-3r"
    assert pandion.load_log(result.path).information["body"] == "full"


def test_what_keeps_clear_is_the_scenarios_or_another() -> None:
    free = replace(pandion.load_scenario("walls", duration_s=0.1), walls=())
    for body, flown in ((None, "points"), ("full", "full")):
        result = pandion.fly(free, body=body)  # type: ignore[arg-type]
        assert pandion.load_log(result.path).information["body"] == flown


def test_a_flight_that_is_over_is_not_stepped() -> None:
    simulator = pandion.Simulator("walls", duration_s=0.1)
    thrust, torque = simulator.hover
    while not simulator.over:
        simulator.step(thrust, torque)
    assert simulator.end_reason == "flew 0.1 s"
    with pytest.raises(RuntimeError, match="reset"):
        simulator.step(thrust, torque)
    assert simulator.reset().t == 0.0
    with pytest.raises(pandion.OwnPartError, match=r"thrust: must have shape \(4,\), has \(3,\)"):
        simulator.step(thrust[:3], torque)
    simulator.step(thrust, torque)
    with pytest.raises(RuntimeError, match="has begun"):
        pandion.Autopilot(simulator)


@pytest.mark.drawn(1)
@pytest.mark.parametrize("vehicle", ["hexa-3r", "octo-4r"])
def test_any_vehicle_is_stepped_by_hand_as_it_flies(vehicle: str) -> None:
    simulator = pandion.Simulator("walls", seed=9, duration_s=BRIEF_S, vehicle=vehicle)
    thrust, torque = simulator.hover
    A, B = simulator.linear_model()
    assert A.shape == (12 + 2 * len(torque),) * 2
    assert B.shape == (len(A), len(thrust) + len(torque))
    # z points down. An arm whose joints give way is not lifted whole.
    bodies = simulator._airframe.bodies
    up = -B[5, : len(thrust)].sum() / (0.002 * len(thrust))
    assert 1.0 / simulator._airframe.mass < up < 1.0 / bodies.base_mass
    autopilot = pandion.Autopilot(simulator)
    while not simulator.over:
        simulator.step(*autopilot())
    flown = pandion.fly("walls", seed=9, duration_s=BRIEF_S, vehicle=vehicle, log=False)
    assert simulator.result == flown.truth
