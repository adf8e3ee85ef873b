"""Rows of the study of robustness: what each is flown with, and what fails in it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fsw.autopilot.barriers.safe_approach import stand_off
from fsw.autopilot.control.tube import base_reach, beyond_covered
from fsw.autopilot.estimation.faults.sensor_fault import SensorFault, sentence
from fsw.autopilot.measurements import ImuSample, JointSample, PoseSample, Sample, Sensor
from fsw.autopilot.parameters.consistency import loop_tube
from fsw.autopilot.parameters.registry import BY_NAME
from fsw.autopilot.signals import SensorFrame
from sitl.mission_clock import MissionClock
from sitl.scenario import AirKeys
from sitl.scenario_file import load_scenario, scenario_names, suite_of
from sitl.sensors.keys import MeasuredSensors
from sitl.simulation import START_US, STEP_US
from studies.campaign.campaign import Campaign
from studies.flight.job import Job, Outcome
from studies.flight.sensor_faults import Fault, FaultKind, FaultySensors
from studies.paper import robustness
from studies.paper.robustness import CHANGES, SCENARIOS, cells, chosen, config_of
from studies.paper.settings import NoCellError, Settings

TWO_SECONDS = Settings(seeds=range(300, 302), duration_s=2.0)
LEVEL = (1.0, 0.0, 0.0, 0.0)


def frame(time_s: float, mark: float = 0.0) -> SensorFrame:
    """Exact states at a time of the flight, told apart by a mark."""
    return SensorFrame(
        t_us=START_US + round(1e6 * time_s),
        p_WB=(mark, 0.0, -1.0),
        v_WB=(mark, 0.0, 0.0),
        q_WB=LEVEL,
        gyro_B=(mark, 0.0, 0.0),
        accel_B=(mark, 0.0, -9.81),
        q_arm=(mark, 0.0),
        qd_arm=(mark, 0.0),
    )


def samples(time_s: float, mark: float = 0.0) -> tuple[Sample, ...]:
    """What a suite says at a time of the flight, told apart by a mark."""
    time, variance = 1e-6 * START_US + time_s, (1e-6, 1e-6, 1e-6)
    return (
        PoseSample(time, (mark, 0.0, -1.0), LEVEL, variance, variance),
        JointSample(time, (mark, 0.0)),
        ImuSample(time, (mark, 0.0, -9.81), (mark, 0.0, 0.0)),
    )


def fault(sensor: Sensor, kind: FaultKind, seconds: float) -> Fault:
    return Fault(sensor, kind, seconds, (1.0,))


def test_every_row_is_flown_with_the_suite_and_the_scenario_that_it_names() -> None:
    rows = cells()
    names = [(row.suite, row.case, row.change) for row in rows]
    assert len(set(names)) == len(names)
    for row in rows:
        assert suite_of(row.flown) == row.suite
        assert row.flown.name == SCENARIOS[row.case]
        assert row.flown.duration_s >= 120.0
        assert bool(row.flown.disturbances) == ("no other disturbance" not in row.change)
        config = config_of(row, Settings())
        assert (config.soft, config.planner.body) == (False, row.flown.body)
    assert {row.flown.duration_s for row in cells(7.0)} == {7.0}


def test_the_rows_of_the_milestone_are_there() -> None:
    rows = {(row.suite, row.case, row.change) for row in cells()}
    for case in ("I", "II"):
        assert ("mocap", case, "as the suite is") in rows
        for latency in (10, 20, 30):
            assert ("mocap", case, f"pose {latency} ms late") in rows
    assert ("vio", "I", "as the suite is") in rows
    assert (("rtk", "field", "as the suite is") in rows) == ("field" in scenario_names())
    for suite in ("mocap", "perfect"):
        assert (suite, "I", "real air, 0.5 m/s of wind") in rows
        found = {change for flown, _, change in rows if flown == suite}
        assert found >= {
            "no pose for 2 s",
            "no pose for 10 ms",
            "one frame of 1e6 m/s",
            "all sensors 14 ms late",
            "all sensors 20 ms late",
        }
        lies = {
            "IMU frozen for 2 s",
            "encoders frozen for 2 s",
            "pose frozen for 0.3 s",
            "one attitude 75 deg over",
            "one time stamp 10 s ahead",
        }
        assert found & lies == (lies if suite == "mocap" else set())
    assert {change for suite, case, change in rows if (suite, case) == ("perfect", "II")} == set(
        CHANGES
    )


def sensors_of(suite: str, change: str) -> MeasuredSensors:
    row = next(row for row in cells() if (row.suite, row.change) == (suite, change))
    assert isinstance(row.flown.sensors, MeasuredSensors)
    return row.flown.sensors


def test_latencies_are_of_the_sensors_that_the_row_names() -> None:
    usual = sensors_of("mocap", "as the suite is")
    assert usual.motion_capture is not None
    late = sensors_of("mocap", "pose 30 ms late")
    assert late == replace(usual, motion_capture=replace(usual.motion_capture, latency_ms=30.0))
    later = sensors_of("mocap", "all sensors 14 ms late")
    assert later.motion_capture is not None
    more = [
        after.latency_ms - before.latency_ms
        for after, before in (
            (later.imu, usual.imu),
            (later.encoders, usual.encoders),
            (later.motion_capture, usual.motion_capture),
        )
    ]
    assert more == [14.0, 14.0, 14.0]
    assert later.motion_capture.stamp_error_ms == 0.0


def test_real_air_has_every_effect() -> None:
    (row,) = chosen(Settings(suite="mocap", only="real air, 0.5"))
    off = AirKeys()
    for key in AirKeys.__slots__:
        if key != "turbulence_height_m":
            assert getattr(row.flown.air, key) != getattr(off, key), key
    actuators = row.flown.actuators
    assert actuators.quadratic_thrust
    assert min(actuators.dead_time_ms, actuators.battery_a_h, actuators.backlash_deg) > 0.0
    config = config_of(row, Settings())
    assert config.airframe.joint_armature == actuators.motor_inertia_kg_m2 > 0.0
    wind, loop = config.tuning.tracking.wind_limit, loop_tube(config)
    assert wind == BY_NAME["TRK_WIND_MAX"].default, "as every vehicle flies, not tuned for the row"
    room, reach = stand_off(config.planner.walls), base_reach(loop, config.surroundings.disturbance)
    grown, _ = beyond_covered(loop, (wind, 0.0))
    assert grown == pytest.approx(loop.wind_beyond)
    assert reach < room < reach + grown, "what the plan has no room for, clearances grow by"
    assert Job("full", replace(row.flown, disturbances=()), config_of(row, Settings()), 1).random


@pytest.mark.parametrize(
    ("sensor", "kind", "changed"),
    [
        (Sensor.POSE, "silent", {"p_WB", "v_WB", "q_WB"}),
        (Sensor.IMU, "silent", {"gyro_B", "accel_B"}),
        (Sensor.ENCODERS, "silent", {"q_arm", "qd_arm"}),
        (Sensor.POSE, "fast", {"v_WB"}),
    ],
)
def test_a_fault_of_exact_states_changes_its_sensor_while_it_lasts(
    sensor: Sensor, kind: FaultKind, changed: set[str]
) -> None:
    faulty = FaultySensors(fault(sensor, kind, 0.01), seed=3)
    for step in range(490, 520):
        true = frame(1e-6 * STEP_US * step, mark=float(step))
        given = faulty.frame(true)
        differs = {
            name
            for name in ("p_WB", "v_WB", "q_WB", "gyro_B", "accel_B", "q_arm", "qd_arm")
            if getattr(given, name) != getattr(true, name)
        }
        assert differs == (changed if 500 <= step < 505 else set()), step


@pytest.mark.parametrize("kind", ["frozen", "over", "ahead"])
def test_exact_states_have_no_fault_that_would_be_believed(kind: FaultKind) -> None:
    with pytest.raises(ValueError, match="exact states are believed"):
        FaultySensors(fault(Sensor.POSE, kind, 0.01), seed=3).frame(frame(1.0))


@pytest.mark.parametrize(
    ("sensor", "kind"),
    [
        (Sensor.POSE, "silent"),
        (Sensor.POSE, "frozen"),
        (Sensor.IMU, "frozen"),
        (Sensor.ENCODERS, "frozen"),
        (Sensor.POSE, "over"),
        (Sensor.POSE, "fast"),
        (Sensor.POSE, "ahead"),
    ],
)
def test_a_fault_of_a_suite_changes_its_samples_and_no_others(
    sensor: Sensor, kind: FaultKind
) -> None:
    kinds = {Sensor.POSE: PoseSample, Sensor.IMU: ImuSample, Sensor.ENCODERS: JointSample}
    faulty = FaultySensors(fault(sensor, kind, 0.01), seed=3)
    for step in range(490, 520):
        true = samples(1e-6 * STEP_US * step, mark=float(step))
        given = faulty.samples(true)
        lasts = 500 + (kind == "frozen") <= step < 505
        differs = {type(one) for one in true if one not in given}
        assert differs == ({kinds[sensor]} if lasts else set()), step
        assert len(given) == (2 if lasts and kind == "silent" else 3)


def test_a_fault_of_one_message_is_of_one_message() -> None:
    faulty = FaultySensors(fault(Sensor.POSE, "ahead", 0.0), seed=0)
    times = [faulty.samples(samples(time))[0].time for time in (0.99, 1.0, 1.0, 1.01)]
    assert times == pytest.approx([1.99, 12.0, 2.0, 2.01])


def test_the_seed_chooses_one_of_the_times() -> None:
    every = Fault(Sensor.POSE, "silent", 2.0, robustness.BESIDE_S)
    assert {every.start_s(seed) for seed in range(300, 320)} == set(robustness.BESIDE_S)
    (brief,) = chosen(Settings(suite="mocap", only="no pose for 2 s", duration_s=25.0))
    assert brief.fault is not None
    assert brief.fault.begins_s == (12.0, 17.0)
    (briefer,) = chosen(Settings(suite="mocap", only="no pose for 2 s", duration_s=4.0))
    assert briefer.fault is not None
    assert briefer.fault.begins_s == (2.0,)


def test_a_fault_begins_a_second_before_the_path_is_nearest_to_a_wall() -> None:
    walls = load_scenario("walls")
    clock = MissionClock(walls)

    def room(time_s: float) -> float:
        p = clock.target_at(time_s).p
        return min(
            sum(n * x for n, x in zip(wall.normal, p, strict=True)) - wall.offset_m
            for wall in walls.walls
        )

    for begins in robustness.BESIDE_S:
        nearest = room(begins + 1.0)
        assert nearest < 0.08
        assert nearest < min(room(begins + 0.5), room(begins + 1.5))


def test_a_report_names_the_sensor_and_the_fault_by_the_time_that_it_is_over() -> None:
    stuck, jump = (sentence(Sensor.POSE, it) for it in (SensorFault.STUCK, SensorFault.JUMP))
    frozen = fault(Sensor.POSE, "frozen", 0.3)
    assert frozen.reported([(0.5, "armed"), (1.1, f"{stuck}, for 0.1 s")], 0).startswith(stuck)
    assert frozen.reported([(1.1, jump), (2.4, stuck)], 0) == ""
    assert frozen.reported([(1.1, sentence(Sensor.IMU, SensorFault.STUCK))], 0) == ""
    over = fault(Sensor.POSE, "over", 0.0)
    assert over.reported([(0.2, jump)], 0) == jump, "not repeated while it comes back"


class NothingFlown(Campaign):
    """Answers every job with what it would be if half of them failed."""

    def run(self, jobs: list[Job]) -> list[Outcome]:
        return [
            Outcome(job.seed, completed=True, reason="flew", margin_m=0.02, te_m=0.07)
            if job.seed % 2
            else Outcome(
                job.seed,
                completed=False,
                reason="hit",
                margin_m=-0.1,
                contact=True,
                modes="hold, land",
                reported="pose silent" if job.fault is not None else "",
            )
            for job in jobs
        ]


def test_rows_say_what_was_flown_and_what_came_of_it() -> None:
    report = robustness.run(TWO_SECONDS, NothingFlown())
    assert [table.caption for table in report.tables] == [
        robustness.SUITES,
        robustness.AIR,
        robustness.FAULTS,
        robustness.MODELS,
    ]
    assert sum(len(table.rows) for table in report.tables) == len(report.rows) == len(cells())
    for row in report.rows:
        assert (row["passed"], row["total"], row["contacts"]) == (1, 2, 1)
        assert row["worst_margin_m"] == -0.1
        assert row["te_m"] == 0.07
        assert row["modes"] == {"hold, land": 1}
        assert row["reported"] == (1 if row["fault"] else 0)
    for table in report.tables:
        for printed in table.rows:
            assert len(printed) == len(table.headers)
            assert printed[-3:-1] in (("1/2", "1/2"), ("1/2", "–"))
            assert printed[-1] == "hold, land 1/2"


def test_rows_are_chosen_by_suite_and_by_name() -> None:
    assert {row.suite for row in chosen(Settings(suite="vio"))} == {"vio"}
    late = chosen(Settings(suite="mocap", only="pose 20"))
    assert [(row.case, row.change) for row in late] == [
        ("I", "pose 20 ms late"),
        ("II", "pose 20 ms late"),
    ]
    with pytest.raises(NoCellError, match="no pose for 2 s"):
        chosen(Settings(suite="vio", only="encoders"))


@pytest.mark.long
def test_a_frozen_imu_is_flown_named_and_ends_the_trajectory() -> None:
    settings = Settings(suite="mocap", only="IMU frozen", seeds=range(30, 31), duration_s=6.0)
    (cell,) = chosen(settings)
    row = Job("full", cell.flown, config_of(cell, settings), 30, cell.fault).row()
    assert not row.error
    assert (row.contact, row.completed, row.modes) == (False, False, "hold")
    assert "left the trajectory for hold" in row.reason
    assert "IMU stuck" in row.reported
