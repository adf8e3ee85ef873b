"""A flight with each suite of sensors, written, read back and fed through the tick again."""

from __future__ import annotations

import math
from dataclasses import fields
from pathlib import Path

import pytest
from pyulog import ULog

from fsw.autopilot.signals import EstimatorReport, FlightSnapshot, TickInputs, TickOutputs
from fsw.link.wire.encode_health import estimator_status
from fsw.link.wire.encode_place import gps_raw, odometry
from fsw.runtime.assembly import flight_software
from messages.frames import wire_fields
from pandion.flight_replay import Replayed, replay
from pandion.logged_ticks import open_flight
from sitl.scenario_file import load_scenario
from tests.fsw.link.snapshots import CONTEXT
from tests.replay.recorded import CHOICE, Recorded, written

Ticks = list[tuple[TickInputs, TickOutputs]]
SECONDS = 0.7


def flown(suite: str) -> Ticks:
    flight = Recorded(load_scenario("walls", suite), seed=5)
    flight.follow()
    flight.run(SECONDS)
    return flight.ticks


def snapshot(ticks: Ticks) -> tuple[FlightSnapshot, EstimatorReport]:
    last = ticks[-1][1].snapshot
    assert last.estimator is not None
    return last, last.estimator


@pytest.mark.drawn(2)
@pytest.mark.requirement("REQ-TIME-8")
@pytest.mark.parametrize("suite", ["perfect", "mocap", "vio", "rtk"])
def test_a_flight_of_a_suite_is_replayed_to_the_byte(suite: str, tmp_path: Path) -> None:
    ticks = flown(suite)
    path = written(tmp_path / "flight.ulg", ticks)
    program = flight_software(CHOICE, to_plan=False)
    assert replay(open_flight(path), program, lambda *_: None) == Replayed(len(ticks), None, 0)
    topics = {one.name: one.data for one in ULog(str(path)).data_list}
    named = {"estimator_status", "estimator_innovations", "estimator_sensor_bias"}
    if suite == "perfect":
        assert not named & set(topics), "exact states have no estimator"
        return
    assert named <= set(topics)
    assert len(topics["sensor_combined"]["timestamp"]) >= len(ticks) - 1
    status, (_, report) = topics["estimator_status"], snapshot(ticks)
    assert status["pos_horiz_accuracy"][-1] == pytest.approx(report.level_accuracy, rel=1e-6)
    assert status["pos_test_ratio"][-1] == pytest.approx(report.ratios.place, rel=1e-6)
    assert status["solution_status_flags"][-1] == report.flags
    bias = topics["estimator_sensor_bias"]
    assert bias["accel_bias[2]"][-1] == pytest.approx(report.accel_bias[2], rel=1e-6)
    innovations = topics["estimator_innovations"]
    of_satellites = suite == "rtk"
    assert math.isnan(innovations["gps_vpos"][-1]) is not of_satellites
    assert math.isnan(innovations["ev_vpos"][-1]) is of_satellites
    if of_satellites:
        assert math.isfinite(innovations["heading"][-1])


def test_a_station_reads_ratios_accuracy_and_covariance() -> None:
    now, report = snapshot(flown("mocap"))
    status = dict(zip(wire_fields(230), estimator_status(now, CONTEXT), strict=True))
    assert 0.0 < status["pos_horiz_ratio"] < 1.0
    assert status["pos_horiz_accuracy"] == report.level_accuracy < 0.01
    assert math.isnan(status["vel_ratio"]), "no sensor measures it"
    assert status["flags"] & 0x3F == 0x3F, "all is known"
    place = dict(zip(wire_fields(331), odometry(now, CONTEXT), strict=True))
    variances = [place[f"pose_covariance[{k}]"] for k in (0, 6, 11, 15, 18, 20)]
    assert all(0.0 < one < 1e-3 for one in variances)
    assert place["estimator_type"] == 8
    fix = dict(zip(wire_fields(24), gps_raw(now, CONTEXT), strict=True))
    assert (fix["fix_type"], fix["satellites_visible"]) == (3, 255), "there is no receiver"
    assert 0 < fix["h_acc"] < 10, "mm, as the estimate knows its place"
    known = {field.name: getattr(now, field.name) for field in fields(FlightSnapshot)}
    exact = FlightSnapshot(**known | {"estimator": None})
    assert math.isnan(odometry(exact, CONTEXT)[14])


def test_a_receiver_is_shown_as_it_measures() -> None:
    ticks = flown("rtk")
    now, report = snapshot(ticks)
    assert report.fix is not None
    values = gps_raw(now, CONTEXT)
    assert values is not None
    raw = dict(zip(wire_fields(24), values, strict=True))
    assert raw["fix_type"] == 6
    assert raw["time_usec"] == report.fix.t_us <= now.t_us
    above = CONTEXT.origin.altitude - report.fix.p[2]
    assert raw["alt"] == pytest.approx(1000.0 * above, abs=1.0)
    assert raw["h_acc"] == round(1e3 * max(report.fix.position_sigma[:2]))
