"""What a real PX4 flies; `make px4 PX4_BUILD=...` runs it, and without a build it is skipped."""

from __future__ import annotations

import signal
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyulog import ULog

from messages.addresses import parse_link_address
from pandion.param_vehicle import ParameterClient
from sitl.px4_parameters import px4_parameters
from sitl.scenario_file import load_scenario
from sitl.sensors.keys import MeasuredSensors
from sitl.start import flown_vehicle
from tests.above_px4.worst_push import BOUND, KEPT, worst_push
from tests.real_px4.real_px4 import HOLD, LAND, NO_BUILD, OFFBOARD, Loop, flying, there_is_one

pytestmark = [pytest.mark.long, pytest.mark.skipif(not there_is_one(), reason=NO_BUILD)]

START = 1.45  # m, where `walls` begins
SEEDS = range(31, 41)
POINTS = ("--body", "points")  # what keeps clear of the walls, as the scenario says


def test_px4_has_every_parameter_of_the_vehicle(tmp_path: Path) -> None:
    """Its airframe has defaults of its own, which must not be left in any of them."""
    scenario = load_scenario("ground", "mocap")
    assert isinstance(scenario.sensors, MeasuredSensors)
    wanted = px4_parameters(flown_vehicle(scenario), scenario.sensors, 250)
    with flying("ground", tmp_path, planner=None) as loop:
        operator = loop.operator
        assert operator.until(lambda: operator.mode != (0, 0), 60.0), loop.said("px4")
        with ParameterClient(parse_link_address("udp:127.0.0.1:14580")) as client:
            found = {name: client.read(name) for name in wanted}
    assert found == pytest.approx(wanted, rel=2e-6, abs=2e-6)


@pytest.mark.parametrize("vehicle", ["paper", "x500-2r"])
def test_the_plant_hovers_folds_its_arm_and_lands(tmp_path: Path, vehicle: str) -> None:
    with flying(str(ground(vehicle, tmp_path)), tmp_path, planner=None, speed="max") as loop:
        operator = loop.operator
        operator.take_off(2.0)
        operator.wait(10.0)
        begun_s = operator.t_s
        operator.wait(60.0)
        hovered_s = operator.t_s
        for k in range(21):  # in one second
            operator.move_joints((-0.025 * k, 0.025 * k))
            operator.wait(0.05)
        operator.wait(10.0)
        folded_s = operator.t_s
        operator.set_mode(LAND)
        assert operator.until(lambda: operator.landed and not operator.armed, 60.0), operator.p
        result = loop.result()
    times, places, joints = truth(tmp_path)
    hover = places[(times > begun_s) & (times < hovered_s)]
    folds = (times > hovered_s) & (times < folded_s)
    folding = places[folds]
    moved = np.linalg.norm(folding - hover.mean(axis=0), axis=1).max()
    print(
        f"{vehicle}: sd {1e3 * hover.std(axis=0)} mm, the base moves {1e3 * moved:.0f} mm with "
        f"the arm, {result['real_time_factor']:.1f} times real time"
    )
    assert hover.std(axis=0).max() < 0.005
    assert moved < 0.1
    assert np.abs(joints[folds][-1]).min() > 0.3


@pytest.mark.parametrize("seed", SEEDS)
def test_walls_are_kept_by_the_planner_above_px4(tmp_path: Path, seed: int) -> None:
    result = flown("walls", tmp_path, seed)
    assert result["min_margin_m"] > 0.02
    assert result["tracking_error_rms_m"] < 0.09


@pytest.mark.parametrize("seed", SEEDS)
def test_a_sphere_with_room_for_the_hand_over_is_kept_above_px4(tmp_path: Path, seed: int) -> None:
    path = tmp_path / "workspace.toml"
    shipped = (files("sitl") / "scenarios" / "workspace.toml").read_text("utf-8")
    path.write_text(shipped.replace("radius_m = 0.075", "radius_m = 0.12"))
    assert flown(str(path), tmp_path, seed)["min_margin_m"] > 0.0


@pytest.mark.parametrize("axis", [0, 1])
def test_the_worst_push_stays_inside_the_bound_that_is_printed(tmp_path: Path, axis: int) -> None:
    push = worst_push(60.0, axis)
    path = tmp_path / "pushed.toml"
    path.write_text(
        'duration_s = 600.0\n[start]\nkind = "ground"\n[pilot]\nplan = "none"\n'
        '[trajectory]\nkind = "hold"\nposition_m = [0.0, 0.0, -1.2]\n'
        f'[[disturbances]]\nkind = "sequence"\nperiod_s = {push.period_s}\n'
        f"starts_s = {push.starts_s}\n"
        f"acceleration_m_s2 = {[list(one) for one in push.acceleration_m_s2]}\n"
    )
    with flying(str(path), tmp_path, speed="0.5", planner=POINTS) as loop:
        given(loop)
        operator = loop.operator
        assert operator.t_s < 58.0, "the push has begun"
        operator.wait(71.0 - operator.t_s)
        assert operator.mode == OFFBOARD, (operator.texts[-5:], loop.said("fsw"))
        loop.result()
    times, places, _ = truth(tmp_path)
    (log,) = (tmp_path / "fsw").glob("*.ulg")
    planned = recorded(log, "vehicle_local_position_setpoint")
    at = 1e-6 * planned["timestamp"]
    pushed = (at > 60.0) & (at < 70.0)
    off = np.interp(at, times, places[:, axis]) - planned["xy"[axis]]
    furthest = float(np.abs(off[pushed]).max())
    print(f"axis {axis}: {1e3 * furthest:.1f} mm of {1e3 * BOUND:.1f} mm")
    assert 0.5 * BOUND < furthest < BOUND < KEPT


def test_a_planner_that_is_killed_leaves_px4_to_its_failsafe(tmp_path: Path) -> None:
    with flying("walls-calm", tmp_path, seed=22, planner=POINTS) as loop:
        given(loop)
        operator = loop.operator
        operator.wait(3.0)
        assert loop.fsw is not None
        loop.fsw.kill()
        assert operator.until(lambda: operator.mode == HOLD, 10.0), operator.texts[-5:]
        operator.wait(5.0)
        assert operator.mode == HOLD
        assert operator.p[2] < -1.0
        assert loop.px4.poll() is None


@pytest.mark.parametrize("stop_s", [0.8, 1.1, 4.0])
def test_a_planner_that_stops_holds_afterwards(tmp_path: Path, stop_s: float) -> None:
    """PX4 gives the vehicle again by itself, as its pilot still means Offboard: it is held."""
    with flying("walls-calm", tmp_path, seed=23, planner=POINTS) as loop:
        given(loop)
        operator = loop.operator
        operator.wait(3.0)
        assert loop.fsw is not None
        begun_s = operator.t_s
        loop.fsw.send_signal(signal.SIGSTOP)
        operator.wait(stop_s)
        held = operator.mode == HOLD
        place = operator.p
        loop.fsw.send_signal(signal.SIGCONT)
        operator.wait(2.0)
        stopped_s = operator.t_s - begun_s - 2.0
        assert operator.until(lambda: operator.mode == OFFBOARD, 10.0), operator.texts[-5:]
        operator.wait(5.0)
        assert operator.p == pytest.approx(place, abs=0.3)
    print(f"stopped for {stopped_s:.2f} s of PX4's time, PX4 {'held' if held else 'went on'}")
    assert held or stop_s < 2.0
    assert "this planner stopped for " in loop.said("fsw")
    (log,) = (tmp_path / "fsw").glob("*.ulg")
    told = [one.message for one in ULog(str(log)).logged_messages]
    assert any(" to disarmed: " in one for one in told), told[-10:]


def test_a_px4_that_is_killed_ends_both_others_with_a_sentence(tmp_path: Path) -> None:
    with flying("walls-calm", tmp_path, seed=24, planner=POINTS) as loop:
        given(loop)
        loop.operator.wait(3.0)
        loop.px4.kill()
        assert loop.sitl.wait(30.0) == 1
        assert loop.fsw is not None
        assert loop.operator.until(lambda: "PX4 is silent" in loop.said("fsw"), 10.0)
        assert "PX4 closed the connection" in loop.said("sitl")
        assert loop.fsw.poll() is None, "it waits for PX4 to come back"


def flown(scenario: str, folder: Path, seed: int) -> dict[str, Any]:
    """What the plant found in 90 s of a scenario at half of real time, followed to the end."""
    with flying(scenario, folder, seed=seed, speed="0.5", planner=POINTS) as loop:
        given(loop)
        operator = loop.operator
        operator.wait(90.0)
        assert operator.mode == OFFBOARD, (operator.texts[-5:], loop.said("fsw"))
        result = loop.result()
    print(
        f"seed {seed}: minimum margin {1e3 * result['min_margin_m']:.1f} mm, tracking error "
        f"{1e3 * result['tracking_error_rms_m']:.1f} mm"
    )
    return result


def given(loop: Loop) -> None:
    """In the air with the arm folded, and the planner's."""
    operator = loop.operator
    operator.take_off(START)
    operator.fold()
    assert operator.give(), (operator.texts[-5:], loop.said("fsw"))


def ground(vehicle: str, folder: Path) -> Path:
    """The scenario `ground` with another vehicle."""
    path = folder / f"{vehicle}.toml"
    path.write_text(
        f'vehicle = "{vehicle}"\nduration_s = 600.0\n[start]\nkind = "ground"\n[pilot]\n'
        'plan = "none"\n[trajectory]\nkind = "hold"\nposition_m = [0.0, 0.0, -1.2]\n'
    )
    return path


def truth(folder: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times [s] of PX4, places [m] and joints [rad] of a flight that was."""
    data = recorded(folder / "truth.ulg", "sim_ground_truth")
    places = np.column_stack([data[f"p_WB[{k}]"] for k in range(3)])
    joints = np.column_stack([data[f"q_arm[{k}]"] for k in range(2)])
    return 1e-6 * data["timestamp"], places, joints


def recorded(log: Path, topic: str) -> dict[str, Any]:
    """One topic of a flight log."""
    (found,) = (one for one in ULog(str(log)).data_list if one.name == topic)
    data: dict[str, Any] = found.data
    return data
