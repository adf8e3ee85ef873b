"""A gyro that is off for good from one reading to the next, and a blow that looks like it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from fsw.autopilot.geometry.rotation import matrix_from_quaternion
from fsw.autopilot.measurements import ImuSample
from fsw.autopilot.signals import Mode
from sitl.scenario_file import load_scenario
from tests.closed_loop.harness import ARM, Flight, command, hover
from tests.closed_loop.test_real_sensors import changed
from tests.closed_loop.test_when_things_go_wrong import OnePush

AT = 2.0  # s, when it happens

in_long = pytest.mark.long


def off_by(axis: int, size: float) -> Any:
    """Readings of a gyro that is off about one axis [rad/s]."""

    def off(sample: ImuSample) -> ImuSample:
        rate = list(sample.rate)
        rate[axis] += size
        return replace(sample, rate=(rate[0], rate[1], rate[2]))

    return off


@pytest.mark.requirement("REQ-EST-7")
@pytest.mark.parametrize(
    ("suite", "axis", "size"),
    [
        ("mocap", 0, 10.0),
        pytest.param("mocap", 1, 25.0, marks=in_long),
        pytest.param("vio", 1, -10.0, marks=in_long),
        pytest.param("vio", 0, 2.0, marks=in_long),
    ],
)
def test_a_gyro_that_is_off_for_good_is_named_and_the_vehicle_holds(
    suite: str, axis: int, size: float
) -> None:
    spoil = changed(ImuSample, AT, 99.0, off_by(axis, size))
    flight = Flight(load_scenario("walls", suite), spoil_samples=spoil)
    flight.follow()
    flight.run(AT + 1.2)  # 10 rad/s believed hit a wall after that
    assert "IMU jump rejected" in flight.texts
    assert any("sensor lost: IMU" in text for text in flight.texts)
    assert flight.mode is Mode.HOLD
    estimate, truth = flight.snapshot.estimate, flight.sim.truth()
    assert max(abs(rate) for rate in estimate.w_WB_B) < 1.0
    assert estimate.R_WB[8] > 0.98, "level to 11 deg"
    assert abs(estimate.p_WB[0] - truth.p_WB[0]) < 0.05
    assert min(truth.margins_m) > 0.0


@pytest.mark.drawn(1)
@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize(
    ("suite", "axis", "size"),
    [
        ("rtk", 1, 0.9),
        ("gnss", 1, -0.9),  # encoders that repeated themselves were named in its place
        *(pytest.param("rtk", k, s, marks=in_long) for k in range(3) for s in (-0.9, 0.5, 0.3)),
        *(pytest.param("gnss", k, -0.9, marks=in_long) for k in (0, 2)),
        *(pytest.param("gnss", k, s, marks=in_long) for k in range(3) for s in (0.5, 0.3)),
        # 0.2 rad/s is where the safety manual says that it may stay undecided.
        *(pytest.param("vio", k, s, marks=in_long) for k in range(3) for s in (-0.9, 0.25)),
    ],
)
def test_a_gyro_that_is_off_by_less_is_named_and_done_without(
    suite: str, axis: int, size: float
) -> None:
    at = 3.0 if suite == "gnss" else AT
    spoil = changed(ImuSample, at, 99.0, off_by(axis, size))
    free = replace(hover(), sensors=load_scenario("walls", suite).sensors, duration_s=60.0)
    flight = Flight(free, spoil_samples=spoil)
    flight.step(command(ARM, 1.0))
    flight.run(at + 1.2)
    assert "IMU inconsistent with the other sensors" in flight.texts
    for _ in range(40):  # or until it has landed, which without a pose it does in a hurry
        flight.run(0.1)
        if flight.mode is Mode.DISARMED:
            break
        estimate, truth = flight.snapshot.estimate, flight.sim.truth()
        R = matrix_from_quaternion(truth.q_WB)
        assert max(abs(a - b) for a, b in zip(estimate.R_WB, R, strict=True)) < 0.15
    assert flight.sim.ended is None


@pytest.mark.long
@pytest.mark.requirement("REQ-EST-7")
@pytest.mark.parametrize(
    ("suite", "seconds"), [("mocap", 0.1), pytest.param("vio", 0.15, marks=in_long)]
)
def test_a_blow_is_believed_in_time_to_stay_in_the_air(
    suite: str, seconds: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """600 N m for 2 ms: 4 rad/s of roll, which rotors stop within 40 or 50 deg.

    Poses of `vio` come every 33 ms, 45 ms late.
    """
    monkeypatch.setattr("sitl.simulation.push", lambda item, seed, step_s: item)
    first = round(AT / 0.002)
    push: Any = OnePush((600.0, 0.0, 0.0), True, first, first)
    scenario = load_scenario("walls", suite)
    calm = hover()
    scenario = replace(
        calm, sensors=scenario.sensors, disturbances=(push,), duration_s=calm.duration_s
    )
    flight = Flight(scenario)
    flight.step(command(ARM, 1.0))
    flight.run(AT + 0.02)
    assert "IMU jump rejected" in flight.texts
    flight.run(seconds)
    fusion = flight.state.fusion
    assert fusion is not None
    assert fusion.numbers["doubted"][0][1] == 0, "believed"
    flight.run(1.5)
    assert flight.mode is Mode.HOLD
    assert flight.snapshot.estimate.R_WB[8] > 0.95
