"""Topics under PX4's names: numbers, rates and what PX4's tools ask of them."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyulog import ULog
from pyulog.px4 import PX4ULog
from scipy.spatial.transform import Rotation

from fsw.autopilot.control.pid import attitude_reference
from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.geometry.geodesy import to_local
from fsw.autopilot.measurements import ImuSample
from fsw.autopilot.signals import (
    BatteryState,
    BatteryWarning,
    FlightSnapshot,
    Mode,
    Origin,
    PredictionState,
    SensorFrame,
    TickInputs,
    frame_of_samples,
)
from fsw.log.encoder import FULL, THIN
from fsw.log.flight_log import FlightLog, LogSubject
from fsw.log.packed import Timetable
from fsw.log.px4_records import planned_rates
from pandion.logged_ticks import LoggedTick, open_flight, ticks
from tests.fsw.link.snapshots import SNAPSHOT, VEHICLE, outputs_at

ORIGIN = Origin(47.0, 8.0, 400.0)
NUMBERS = {"origin.latitude": 47.0, "origin.longitude": 8.0, "origin.altitude": 400.0}
EXACT = replace(SNAPSHOT, estimator=None, failures=())
NONE = (0.0, 0.0, 0.0)
FRAME = SensorFrame(0, NONE, NONE, (1.0, *NONE), NONE, (0.0, 0.0, -9.81), NONE[:2], NONE[:2])


def logged(
    path: Path, snapshots: Iterator[FlightSnapshot], profile: int = THIN, sampled: bool = False
) -> ULog:
    log = FlightLog(path, LogSubject({}, NUMBERS, {}, VEHICLE, profile))
    for k, snapshot in enumerate(snapshots):
        t_us = 1_000_000 + 2_000 * k
        if k == 0:
            log.begin(t_us, lockstep=True)
        samples = (ImuSample(1e-6 * t_us, (0.1 * (k % 2), 0.0, -9.81), NONE),) if sampled else ()
        inputs = TickInputs(replace(FRAME, t_us=t_us), samples=samples)
        outputs = outputs_at(t_us)
        log.add(inputs, replace(outputs, shown=replace(snapshot, t_us=t_us)))
    log.close()
    assert log.unwritten_ticks == 0
    read = ULog(str(path))
    assert not read.file_corruption
    return read


def rows(log: ULog, name: str) -> dict[str, Any]:
    return log.get_dataset(name).data


def test_each_topic_has_the_rate_that_its_plots_need(tmp_path: Path) -> None:
    """A spectrum is drawn from 100 Hz on; see DataPlotFFT of Flight Review."""
    log = logged(tmp_path / "thin.ulg", iter([EXACT] * 1500))
    for name, hertz in (
        ("vehicle_angular_velocity", 100),
        ("vehicle_torque_setpoint", 100),
        ("vehicle_local_position_setpoint", 20),
        ("vehicle_thrust_setpoint", 20),
        ("vehicle_attitude_setpoint", 20),
        ("vehicle_rates_setpoint", 20),
        ("vehicle_gps_position", 5),
        ("vehicle_global_position", 5),
        ("battery_status", 1),
        ("failsafe_flags", 1),
        ("vehicle_imu_status", 1),
    ):
        times = rows(log, name)["timestamp"]
        assert len(times) == 3 * hertz, name
        assert set(np.diff(times)) == {1_000_000 // hertz}, name
    full = logged(tmp_path / "full.ulg", iter([EXACT] * 100), FULL)
    assert len(rows(full, "vehicle_angular_velocity")["timestamp"]) == 100
    assert len(rows(full, "vehicle_thrust_setpoint")["timestamp"]) == 4


def test_without_a_plan_nothing_is_set(tmp_path: Path) -> None:
    log = logged(tmp_path / "idle.ulg", iter([replace(EXACT, plan_state=None)] * 100))
    names = {one.name for one in log.data_list}
    assert not names & {"vehicle_attitude_setpoint", "vehicle_rates_setpoint"}
    assert "vehicle_thrust_setpoint" in names


def test_thrust_and_torque_are_shares_of_the_largest(tmp_path: Path) -> None:
    log = logged(tmp_path / "flight.ulg", iter([EXACT]))
    rear, left, front, right = (force / 16.0 for force in EXACT.actuators.rotor_thrust)
    torque = rows(log, "vehicle_torque_setpoint")
    assert torque["xyz[0]"][0] == pytest.approx(left - right)
    assert torque["xyz[1]"][0] == pytest.approx(front - rear)
    assert torque["xyz[2]"][0] == pytest.approx(0.5 * (rear + front - left - right))
    thrust = rows(log, "vehicle_thrust_setpoint")
    assert thrust["xyz[2]"][0] == pytest.approx(-0.25 * (rear + left + front + right))


def test_the_attitude_setpoint_pushes_where_the_plan_accelerates(tmp_path: Path) -> None:
    log = logged(tmp_path / "flight.ulg", iter([EXACT]))
    w, x, y, z = (rows(log, "vehicle_attitude_setpoint")[f"q_d[{k}]"][0] for k in range(4))
    up = -Rotation.from_quat([x, y, z, w]).as_matrix()[:, 2]
    assert EXACT.plan_input is not None
    force = np.array(EXACT.plan_input.a) - [0.0, 0.0, 9.81]
    assert up == pytest.approx(force / np.linalg.norm(force), abs=1e-3)


def test_planned_rates_are_the_derivative_of_the_planned_attitude() -> None:
    dt, a, j = 1e-5, np.array([1.5, -0.8, 0.6]), np.array([2.0, 1.0])

    def state(t: float) -> PredictionState:
        now = (a[0] + t * j[0], a[1] + t * j[1], a[2])
        return PredictionState(
            NONE, NONE, now, (j[0], j[1]), NONE[:2], 0.7 + 0.4 * t, 0.4, NONE[:2], NONE[:2]
        )

    def attitude(t: float) -> Rotation:
        one = state(t)
        roll, pitch, yaw = attitude_reference(one.a, one.yaw)
        return Rotation.from_euler("ZYX", [yaw, pitch, roll])

    turned = (attitude(-dt).inv() * attitude(dt)).as_rotvec() / (2.0 * dt)
    assert planned_rates(state(0.0)) == pytest.approx(tuple(turned), abs=1e-6)


def test_a_place_on_earth_is_the_estimate_and_the_fix_the_receiver_s(tmp_path: Path) -> None:
    log = logged(tmp_path / "exact.ulg", iter([EXACT]))
    assert log.msg_info_dict["ver_data_format"] >= 2, "else Flight Review looks for lat and lon"
    assert PX4ULog(log).get_mav_type() == "Quadrotor", "as Flight Review shows it"
    fix = rows(log, "vehicle_gps_position")
    place = [fix[name][0] for name in ("latitude_deg", "longitude_deg", "altitude_msl_m")]
    assert to_local(ORIGIN, *place) == pytest.approx(EXACT.estimate.p_WB, abs=1e-3)
    assert (fix["fix_type"][0], fix["satellites_used"][0]) == (3, 0)
    fused = rows(log, "vehicle_global_position")
    assert fused["alt"][0] == pytest.approx(403.0)
    received = rows(logged(tmp_path / "fix.ulg", iter([SNAPSHOT])), "vehicle_gps_position")
    assert (received["fix_type"][0], received["satellites_used"][0]) == (5, 14)
    assert received["s_variance_m_s"][0] == pytest.approx(0.1)
    assert received["vel_m_s"][0] == pytest.approx(5.0)


def test_failsafe_flags_change_with_the_conditions_and_battery_and_takeover_are_there(
    tmp_path: Path,
) -> None:
    lost = replace(
        EXACT, failures=(Condition.DATALINK_LOST.value,), failsafe_from=Mode.MISSION, mode=Mode.HOLD
    )
    pilot = replace(lost, failsafe_from=None)
    weak = replace(
        EXACT, battery=BatteryState(voltage=14.0, consumed=1.5, charge=BatteryWarning.LOW)
    )
    log = logged(tmp_path / "flight.ulg", iter([EXACT] * 10 + [lost] * 10 + [pilot] * 10 + [weak]))
    flags = rows(log, "failsafe_flags")
    assert flags["gcs_connection_lost"].tolist() == [0, 1, 0]
    assert flags["battery_warning"].tolist()[-1] == 1
    assert not flags["attitude_invalid"].any()
    status = rows(log, "vehicle_status")
    assert status["failsafe_and_user_took_over"].tolist() == [0, 0, 1, 0]
    battery = rows(logged(tmp_path / "weak.ulg", iter([weak])), "battery_status")
    assert battery["discharged_mah"][0] == pytest.approx(1500.0)
    gone = replace(EXACT, failures=(Condition.POSITION_LOST.value,))
    position = rows(logged(tmp_path / "gone.ulg", iter([gone])), "vehicle_local_position")
    assert not position["xy_valid"][0]


def test_vibration_is_px4_s_measure_of_what_the_inertial_unit_feels(tmp_path: Path) -> None:
    log = logged(tmp_path / "shaken.ulg", iter([EXACT] * 1001), sampled=True)
    felt = rows(log, "vehicle_imu_status")["accel_vibration_metric"]
    assert felt[0] == 0.0
    assert felt[-1] == pytest.approx(0.1, rel=0.02)


def test_a_frame_of_which_the_samples_say_everything_takes_a_few_bytes(tmp_path: Path) -> None:
    path = tmp_path / "flight.ulg"
    log = FlightLog(path, LogSubject({}, NUMBERS, {}, VEHICLE))
    log.begin(1_000_000, lockstep=True)
    given = []
    for k in range(40):
        imu = ImuSample(1.0 + 0.002 * k, (0.1 * k, -0.0, -9.81), (0.0, 0.01 * k, -0.0))
        if k % 8 == 5:
            imu = replace(imu, rate=(0.0, 0.5, 0.0))
        frame = frame_of_samples(1_000_000 + 2_000 * k, (imu,), 2)
        if k == 17:
            frame = replace(frame, gyro_B=(0.0, 0.0, 1.0))  # it has been spoilt on its way
        given.append(TickInputs(frame, samples=(imu,)))
        log.add(given[-1], outputs_at(frame.t_us))
    log.close()
    assert len(rows(ULog(str(path)), "sensor_frame")["timestamp"]) == 1
    assert len(rows(ULog(str(path)), "tick")["timestamp"]) == 39
    found = [one.inputs for one in ticks(open_flight(path)) if isinstance(one, LoggedTick)]
    assert [repr(one) for one in found] == [repr(one) for one in given]


def test_what_has_a_rate_is_written_on_where_time_goes_back() -> None:
    """A first stamp that is ahead of all others is forgotten, and all that follow are earlier."""
    table = Timetable((10, str.encode), (25, lambda said: said.upper().encode()))
    stamps = (1000, 1005, 1010, 1024, 1025, 12, 15, 20, 26)
    assert [table.due(t_us, "a") for t_us in stamps] == [
        *(b"aA", b"", b"a", b"a", b"A"),
        *(b"aA", b"", b"a", b"A"),
    ]


def test_whatever_is_not_known_leaves_every_record_readable(tmp_path: Path) -> None:
    dice = random.Random(3)
    values = [math.nan, math.inf, -math.inf, 1e300, -1e300, 0.0]

    def wild() -> FlightSnapshot:
        x = [dice.choice(values) for _ in range(6)]
        estimate = EXACT.estimate._replace(p_WB=(x[0], x[1], x[2]), v_WB=(x[3], x[4], x[5]))
        battery = BatteryState(voltage=x[0], consumed=x[1], time_left=x[2])
        return replace(EXACT, estimate=estimate, battery=battery)

    log = logged(tmp_path / "wild.ulg", (wild() for _ in range(300)), FULL)
    assert len(rows(log, "vehicle_angular_velocity")["timestamp"]) == 300


def test_the_load_is_written_where_it_is_measured(tmp_path: Path) -> None:
    from fsw.autopilot.ports import GroupTiming

    timing = GroupTiming(2_000, 500, 0, 0, 500.0, 800.0, 900.0, 1.0, 2.0, 3.0, 0.1)
    for lockstep in (True, False):
        path = tmp_path / f"{lockstep}.ulg"
        log = FlightLog(path, LogSubject({}, {}, {}, VEHICLE))
        log.begin(1_000_000, lockstep)
        log.add(TickInputs(replace(FRAME, t_us=1_000_000)), outputs_at(1_000_000))
        log.add_timing(1_000_000, 0, timing)
        log.close()
        names = {one.name for one in ULog(str(path)).data_list}
        assert ("cpuload" in names) is not lockstep
    load = rows(ULog(str(path)), "cpuload")
    assert load["load"][0] == pytest.approx(0.25)
    assert 0.0 < load["ram_usage"][0] < 1.0
