"""``pandion px4``: what PX4 is told about the simulated vehicle."""

from __future__ import annotations

import math
import re
import socket
import struct
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from messages.frames import FrameWriter, Losses
from messages.stream_reader import StreamReader
from pandion.px4 import main
from sitl.plant.parameters import effectiveness
from sitl.px4_parameters import px4_parameters
from sitl.scenario_file import SUITE_NAMES, load_scenario
from sitl.sensors.keys import MeasuredSensors
from tests.sitl.vehicles import random_vehicle
from vehicles.description import Vehicle
from vehicles.vehicle_file import PACKAGED, load_vehicle

PARAM_REQUEST_READ, PARAM_VALUE, PARAM_SET, SET_GPS_GLOBAL_ORIGIN = 20, 22, 23, 48
MEASURED = [name for name in SUITE_NAMES if name != "perfect"]


def sensors(suite: str) -> MeasuredSensors:
    found = load_scenario("ground", suite).sensors
    assert isinstance(found, MeasuredSensors)
    return found


def printed(capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, str]:
    assert main(["params", *words]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("param set")]
    return {name: value for _, _, name, value in map(str.split, lines)}


VEHICLES = [
    load_vehicle("paper"),
    random_vehicle(2, 4, np.random.default_rng(0)),
    random_vehicle(3, 6, np.random.default_rng(0)),
]


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_the_geometry_is_that_of_the_plant(vehicle: Vehicle) -> None:
    """PX4 takes a rotor for a thrust along its axis at its place, with KM times it against it."""
    values = px4_parameters(vehicle, sensors("mocap"), 250)
    effect = effectiveness(vehicle)
    assert values["CA_ROTOR_COUNT"] == len(vehicle.rotors)
    for k in range(len(vehicle.rotors)):
        place = np.array([values[f"CA_ROTOR{k}_P{axis}"] for axis in "XYZ"])
        up = [values.get(f"CA_ROTOR{k}_A{axis}", -float(axis == "Z")) for axis in "XYZ"]
        moment = np.cross(place, up) - np.multiply(values[f"CA_ROTOR{k}_KM"], up)
        assert np.concatenate([up, moment]) == pytest.approx(effect[:, k], abs=1e-15)


def test_the_papers_vehicle_has_the_values_that_were_flown_with_px4(
    capsys: pytest.CaptureFixture[str],
) -> None:
    values = printed(capsys, "ground")
    flown = {
        "MC_ROLLRATE_P": "1.03",
        "MC_PITCHRATE_D": "0.0288",
        "MC_PITCH_P": "7",
        "MC_YAWRATE_P": "2.73",
        "MC_AIRMODE": "1",
        "MPC_XY_P": "1.8",
        "MPC_XY_VEL_P_ACC": "5",
        "MPC_THR_HOVER": "0.5",
        "EKF2_HGT_REF": "3",
        "EKF2_GPS_CTRL": "0",
        "EKF2_MAG_TYPE": "5",
        "SYS_HAS_BARO": "0",
        "CA_ROTOR2_PX": "0.3",
    }
    assert {name: values[name] for name in flown} == flown
    assert "IMU_INTEG_RATE" not in values


@pytest.mark.parametrize("action", ["params", "env"])
def test_an_own_vehicle_is_named_by_its_file(
    action: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.toml").write_text((PACKAGED / "hexa-3r.toml").read_text())
    assert main([action, "ground", f"--airframe={tmp_path / 'mine.toml'}"]) == 0
    assert re.search(r"CA_ROTOR_COUNT[ =]6\n", capsys.readouterr().out)
    assert main([action, "ground", "--airframe=papr"]) == 2
    assert 'did you mean "paper"' in capsys.readouterr().err


def test_the_actions_of_the_help_are_apart_from_what_they_do(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["--help"]) == 0
    assert re.search(r"^  identify  find out", capsys.readouterr().out, re.M)


def test_the_rate_loop_keeps_its_bandwidth_on_another_vehicle() -> None:
    """What a 1 does to a '+': roll two rotors by 0.707 of the full thrust, yaw all four by all."""
    paper = VEHICLES[0]
    small = [
        replace(one, position=tuple(0.58 * x for x in one.position), thrust_max=8.55, lag=0.02)
        for one in paper.rotors
    ]
    for vehicle in (paper, replace(paper, rotors=tuple(small))):
        values, rotor = px4_parameters(vehicle, sensors("mocap"), 250), vehicle.rotors[3]
        lever = math.sqrt(2.0) * rotor.position[1] * rotor.thrust_max / vehicle.base.inertia[0]
        gain, slowed = values["MC_ROLLRATE_P"] * lever, 1.0 + values["MC_ROLLRATE_D"] * lever
        assert gain == pytest.approx(25.0, rel=0.01)
        poles = np.roots([rotor.lag, slowed, gain])
        assert -poles.real / np.abs(poles) == pytest.approx(0.85, rel=0.01)
        lever = 4.0 * rotor.torque_per_thrust * rotor.thrust_max / vehicle.base.inertia[2]
        assert values["MC_YAWRATE_P"] * lever == pytest.approx(5.0, rel=0.01)


def test_a_heavier_vehicle_hovers_at_more_thrust(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    heavy = tmp_path / "heavy.toml"
    ground = load_scenario("ground")
    assert ground.vehicle_scale.mass == 1.0
    heavy.write_text(
        'duration_s = 10.0\n[start]\nkind = "ground"\n[pilot]\nplan = "none"\n'
        '[trajectory]\nkind = "hold"\nposition_m = [0.0, 0.0, -1.2]\n[vehicle_scale]\nmass = 1.2\n'
    )
    assert printed(capsys, str(heavy))["MPC_THR_HOVER"] == "0.6"


@pytest.mark.parametrize("suite", MEASURED)
def test_px4_fuses_what_the_suite_has(suite: str) -> None:
    one = sensors(suite)
    values = px4_parameters(VEHICLES[0], one, 250)
    assert values["SYS_HAS_MAG"] == (one.magnetometer is not None)
    assert values["SYS_HAS_BARO"] == (one.barometer is not None)
    assert values["SYS_HAS_GPS"] == (one.gnss is not None)
    pose = one.motion_capture or one.visual_odometry
    assert ("EKF2_EV_CTRL" in values) == (pose is not None)
    if pose is not None:
        assert values["EKF2_EV_DELAY"] == pose.latency_ms


def test_500_hz_needs_a_faster_inertial_unit(capsys: pytest.CaptureFixture[str]) -> None:
    values = printed(capsys, "--rate", "500")
    assert (values["IMU_GYRO_RATEMAX"], values["IMU_INTEG_RATE"]) == ("2000", "500")


def test_the_environment_says_the_same_to_px4s_own_start_script(
    capsys: pytest.CaptureFixture[str],
) -> None:
    values = printed(capsys, "walls", "--sensors", "gnss")
    assert main(["env", "walls", "--sensors", "gnss"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == ["PX4_SYS_AUTOSTART=10016", "PX4_SIM_MODEL=none_iris"]
    assert not any(" " in line for line in lines)  # env $(pandion px4 env)
    said = dict(line.removeprefix("PX4_PARAM_").split("=") for line in lines[2:])
    assert list(said) == list(values)
    for name, value in values.items():
        assert float(said[name]) == pytest.approx(float(value), rel=2e-6, abs=2e-6)


def test_the_environment_has_no_value_that_px4_would_take_for_its_default(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """PX4 drops such a value, and its airframe's default is flown: rotors in other places."""
    assert main(["env", "walls", "--sensors", "gnss"]) == 0
    lines = capsys.readouterr().out.splitlines()
    said = dict(line.split("=") for line in lines)
    assert float(said["PX4_PARAM_CA_ROTOR0_PY"]) == pytest.approx(1e-6)
    values = px4_parameters(load_vehicle("paper"), sensors("gnss"), 250)
    assert [name for name, value in values.items() if isinstance(value, float)
            and np.float32(said[f"PX4_PARAM_{name}"]) == np.float32(value)] == []  # fmt: skip


def test_the_file_is_one_that_qgroundcontrol_loads(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    target = tmp_path / "px4.params"
    values = printed(capsys, "--out", str(target))
    rows = [line.split("\t") for line in target.read_text().splitlines() if line[0] != "#"]
    assert {row[2]: row[3] for row in rows} == values
    assert {row[2]: row[4] for row in rows}["CA_ROTOR_COUNT"] == "6"
    assert {row[2]: row[4] for row in rows}["CA_ROTOR0_PY"] == "9"


@contextmanager
def a_px4() -> Iterator[tuple[str, dict[str, float], list[tuple[float, ...]]]]:
    """A vehicle that keeps parameters as PX4 does: its address, what it holds, its origins."""
    held: dict[str, float] = {}
    origins: list[tuple[float, ...]] = []
    server = socket.create_server(("127.0.0.1", 0))
    values = px4_parameters(VEHICLES[0], sensors("mocap"), 250)

    def serve() -> None:
        client, _ = server.accept()
        reader, losses, writer = StreamReader(), Losses(), FrameWriter(1, 1)
        with closing(client):
            while data := client.recv(4096):
                for frame, _ in reader.cut(data, losses):
                    told = cast("tuple[float | bytes, ...]", frame.payload_values)
                    if frame.message_id == SET_GPS_GLOBAL_ORIGIN:
                        origins.append(cast("tuple[float, ...]", told))
                    if frame.message_id not in (PARAM_REQUEST_READ, PARAM_SET):
                        continue
                    padded = next(one for one in told if isinstance(one, bytes))
                    name = padded.partition(b"\0")[0].decode()
                    whole = isinstance(values[name], int)
                    if frame.message_id == PARAM_SET:
                        raw = struct.pack("<f", told[0])
                        (held[name],) = struct.unpack("<i" if whole else "<f", raw)
                    value = held.get(name, 0)
                    raw = struct.pack("<i" if whole else "<f", int(value) if whole else value)
                    (field,) = struct.unpack("<f", raw)
                    answer = (field, 1, 0, padded, 6 if whole else 9)
                    client.sendall(writer.frame(PARAM_VALUE, *answer))

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    with closing(server):
        yield f"tcp:127.0.0.1:{server.getsockname()[1]}", held, origins
    thread.join(5.0)  # it has read all that was sent


def test_a_running_px4_is_set_over_its_link_and_told_the_origin(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with a_px4() as (where, held, origins):
        values = printed(capsys, "--vehicle", where, "--origin=47.5,8.5,400")
    assert set(held) == set(values)
    assert held["CA_ROTOR0_KM"] == pytest.approx(0.016)
    assert held["EKF2_HGT_REF"] == 3
    assert origins == [(475_000_000, 85_000_000, 400_000, 1, 0)]


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["parms"], "unknown action parms; did you mean params?"),
        (["params", "grond"], "grond"),
        (["env", "--rate", "300"], "'300' is neither 250 nor 500"),
        (["params", "--sensors", "perfect"], "unknown suite 'perfect'"),
        (["params", "--vehicle", "tty"], "address 'tty' is not of the form"),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(
    words: list[str], why: str, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        code = main(words)
    except SystemExit as end:
        code = cast(int, end.code)
    assert code == 2
    complaint = capsys.readouterr().err
    assert why in complaint
    assert complaint.count("\n") == 1
