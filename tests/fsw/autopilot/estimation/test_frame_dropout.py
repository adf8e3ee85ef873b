"""What stands in for a part of an exact frame that is missing."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from fsw.autopilot.estimation.estimator import estimate_state, read_frame
from fsw.autopilot.estimation.frame_dropout import Dropout, filled
from fsw.autopilot.measurements import Sensor
from fsw.autopilot.signals import SensorFrame, StateEstimate, Vec3
from fsw.autopilot.tick_record import new_tick

TICK = 0.002
NAN = math.nan
NOTHING: Vec3 = (NAN, NAN, NAN)
FIRST = 20


def frame(k: int, **changes: Any) -> SensorFrame:
    """Tick k of a vehicle that turns about its vertical, climbs and is pushed north in its turn."""
    t = TICK * k
    yaw = 0.4 * t
    found = SensorFrame(
        t_us=1_000_000 + 2_000 * k,
        p_WB=(0.3 * t + 0.4 * t * t, 0.0, -1.0 - 0.25 * t * t),
        v_WB=(0.3 + 0.8 * t, 0.0, -0.5 * t),
        q_WB=(math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)),
        gyro_B=(0.0, 0.0, 0.4),
        accel_B=(0.8 * math.cos(yaw), -0.8 * math.sin(yaw), -9.80665 - 0.5),
        q_arm=(0.1 * t, 0.2 + 0.15 * t * t),
        qd_arm=(0.1, 0.3 * t),
    )
    return replace(found, **changes)


def flown(
    ticks: int, spoil: Callable[[int, SensorFrame], SensorFrame]
) -> tuple[Dropout, StateEstimate, list[tuple[int, str]]]:
    """The last dropout and estimate, and what was said in which tick."""
    estimate = estimate_state(frame(0))
    assert estimate is not None
    dropout, said = Dropout(), []
    for k in range(1, ticks):
        s = spoil(k, frame(k))
        r = new_tick(3.5, 4, 2)
        missing, read = read_frame(s, r), r.state_estimate
        assert read is not None
        dropout, sentences = dropout.after(missing, s.t_us)
        said += [(k, one) for one in sentences]
        estimate = filled(missing, s, read, estimate, lambda: (0.0, 0.3)) if missing else read
    return dropout, estimate, said


def from_first(**changes: Any) -> Callable[[int, SensorFrame], SensorFrame]:
    return lambda k, s: replace(s, **changes) if k >= FIRST else s


ONCE: list[tuple[dict[str, Any], Sensor, str]] = [
    ({"p_WB": NOTHING}, Sensor.POSE, "pose"),
    ({"v_WB": (0.3, 1e6, 0.0)}, Sensor.POSE, "pose"),
    ({"q_WB": (0.0, 0.0, 0.0, 0.0)}, Sensor.POSE, "pose"),
    ({"gyro_B": (math.inf, 0.0, 0.0)}, Sensor.IMU, "IMU"),
    ({"accel_B": (0.0, 0.0, 1e4)}, Sensor.IMU, "IMU"),
    ({"qd_arm": (NAN, 0.0)}, Sensor.ENCODERS, "joint encoders"),
]


@pytest.mark.requirement("REQ-EST-1")
@pytest.mark.parametrize(("lie", "sensor", "text"), ONCE)
def test_one_frame_that_cannot_be_is_not_used_and_named(
    lie: dict[str, Any], sensor: Sensor, text: str
) -> None:
    dropout, estimate, said = flown(FIRST + 1, from_first(**lie))
    ((named, gap),) = dropout.lost
    assert (named, gap.since_us) == (sensor, frame(FIRST).t_us)
    assert said == [(FIRST, f"{text} implausible")]
    assert math.dist(estimate.p_WB, frame(FIRST).p_WB) < 1e-5
    dropout, estimate, _ = flown(30, lambda k, s: replace(s, **lie) if k == FIRST else s)
    assert dropout.lost == ()
    assert estimate == estimate_state(frame(29))


def test_missing_parts_are_reported_once_and_again_after_ten_seconds() -> None:
    bad = (20, 40, 41, 5_100)
    _, _, said = flown(5_200, lambda k, s: replace(s, gyro_B=NOTHING) if k in bad else s)
    assert said == [(20, "IMU implausible"), (5_100, "IMU implausible")]


@pytest.mark.requirement("REQ-EST-3")
def test_without_a_pose_the_inertial_unit_carries_on() -> None:
    dropout, estimate, _ = flown(520, from_first(p_WB=NOTHING))
    assert math.dist(estimate.p_WB, frame(519).p_WB) < 0.002, "a push is felt"
    assert estimate.yaw == pytest.approx(0.4 * TICK * 519, abs=1e-3)
    position, velocity, attitude = dropout.sigmas(frame(519).t_us)
    assert 0.01 < position < 0.03
    assert 0.02 < velocity < 0.05
    assert attitude < 0.02


def test_without_anything_the_attitude_is_soon_unknown() -> None:
    dropout, estimate, _ = flown(220, from_first(p_WB=NOTHING, gyro_B=NOTHING))
    _, _, attitude = dropout.sigmas(frame(219).t_us)
    assert attitude == pytest.approx(0.4, rel=0.05)
    assert math.isfinite(sum(estimate.p_WB))
    assert estimate.t_us == frame(219).t_us, "telemetry goes by it"


def test_without_an_inertial_unit_rates_follow_from_the_pose() -> None:
    dropout, estimate, _ = flown(300, from_first(gyro_B=NOTHING))
    assert [sensor for sensor, _ in dropout.lost] == [Sensor.IMU]
    assert estimate.w_WB_B[2] == pytest.approx(0.4, abs=0.01)
    assert estimate.specific_force == pytest.approx(9.80665 + 0.5, abs=0.05)
    assert estimate.p_WB == frame(299).p_WB
    assert dropout.sigmas(frame(299).t_us) == (0.0, 0.0, 0.0)


def test_without_encoders_the_joints_follow_from_their_torques() -> None:
    _, estimate, _ = flown(520, from_first(q_arm=(NAN, 0.2)))
    assert estimate.q_arm == pytest.approx(frame(519).q_arm, abs=0.002)
    assert estimate.qd_arm == pytest.approx(frame(519).qd_arm, abs=0.002)


@pytest.mark.parametrize("sideways", [NAN, math.inf, 1e30])
def test_a_sideways_force_that_cannot_be_carries_no_pose_away(sideways: float) -> None:
    lost = from_first(p_WB=NOTHING, accel_B=(sideways, 0.0, -9.80665 - 0.5))
    _, estimate, _ = flown(60, lost)
    assert math.dist(estimate.p_WB, frame(59).p_WB) < 0.01


def test_what_is_a_number_and_in_range_is_believed() -> None:
    """A jump, a frozen sensor, noise: faults of sensors are flown with suites."""
    turned = (math.cos(0.7), math.sin(0.7), 0.0, 0.0)
    for lie in ({"p_WB": (3.0, 0.0, -1.0)}, {"q_WB": turned}, {"gyro_B": (9.0, 0.0, 0.0)}):
        dropout, estimate, said = flown(60, from_first(**lie))
        assert dropout == Dropout()
        assert estimate == estimate_state(frame(59, **lie))
        assert said == []
