"""Rate, stamp, latency, jitter, dropouts and gaps of a sensor's messages."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sitl.sensors.channel import Channel, Measurement
from sitl.sensors.encoders import JointMeasurement
from sitl.sensors.exact import V4, SensorReadings
from sitl.sensors.keys import Timing
from tests.sitl.sensors.readings import HOVER, START_US, STEP_US, reading


class Watch:
    """A sensor that notes when it measured."""

    def __init__(self) -> None:
        self.measured_us: list[int] = []
        self.outliers = 0

    def measure(
        self, exact: SensorReadings, thrust: V4, stamp_us: int, outlier: bool
    ) -> Measurement:
        """The true time as an angle, beside the stamp."""
        self.measured_us.append(exact.t_us)
        self.outliers += outlier
        return JointMeasurement(stamp_us, (float(exact.t_us),))


def run(seconds: float, seed: int = 1, **keys: Any) -> tuple[Watch, list[tuple[int, Measurement]]]:
    """Every message with the stamp of the step in which it arrived."""
    watch, arrived = Watch(), []
    channel = Channel(watch, Timing(**keys), np.random.default_rng(seed), START_US)
    exact = reading()
    for k in range(round(1e6 * seconds / STEP_US)):
        t_us = START_US + STEP_US * k
        out: list[Measurement] = []
        channel.step(exact._replace(t_us=t_us), HOVER, out)
        arrived += [(t_us, one) for one in out]
    return watch, arrived


def test_a_sensor_keeps_its_rate_on_a_grid_that_is_not_the_steps() -> None:
    watch, _ = run(100.0, rate_hz=120.0)
    assert abs(len(watch.measured_us) - 12_000) <= 1
    gaps = np.diff(watch.measured_us)
    assert gaps[1:].min() >= 8000
    assert gaps.max() <= 10_000


def test_at_the_rate_of_the_steps_every_step_is_measured_and_arrives_at_once() -> None:
    watch, arrived = run(1.0, rate_hz=500.0)
    assert watch.measured_us == [START_US + STEP_US * k for k in range(500)]
    assert [(at, one.t_us) for at, one in arrived] == [(t, t) for t in watch.measured_us]


def test_a_message_carries_the_time_of_its_measurement_and_arrives_after_the_latency() -> None:
    watch, arrived = run(10.0, rate_hz=100.0, latency_ms=15.0)
    assert len(arrived) >= 998
    for at_us, one in arrived:
        assert one.t_us in watch.measured_us
        assert 15_000 <= at_us - one.t_us < 15_000 + STEP_US


def test_a_wrong_clock_shows_in_the_stamp_alone() -> None:
    _, arrived = run(2.0, rate_hz=100.0, latency_ms=10.0, stamp_error_ms=-7.0)
    for at_us, one in arrived:
        assert isinstance(one, JointMeasurement)
        assert one.t_us - one.angles[0] == -7000
        assert 10_000 <= at_us - one.angles[0] < 12_000


def test_jitter_has_the_stated_deviation_and_no_message_overtakes() -> None:
    _, arrived = run(400.0, rate_hz=30.0, latency_ms=45.0, jitter_ms=5.0)
    late_ms = np.array([1e-3 * (at - one.t_us) for at, one in arrived])
    # The step grid adds 1 ms on average, and 2/√12 ms of deviation.
    assert abs(late_ms.mean() - 46.0) < 0.3
    assert abs(late_ms.std() - np.hypot(5.0, 2.0 / np.sqrt(12.0))) < 0.3
    stamps = [one.t_us for _, one in arrived]
    assert stamps == sorted(stamps)


def test_much_jitter_delivers_nothing_before_it_is_measured_and_keeps_the_order() -> None:
    _, arrived = run(20.0, rate_hz=250.0, latency_ms=2.0, jitter_ms=20.0)
    assert min(at - one.t_us for at, one in arrived) >= 0
    stamps = [one.t_us for _, one in arrived]
    assert stamps == sorted(stamps)


@pytest.mark.long
def test_dropouts_and_outliers_have_the_stated_shares() -> None:
    watch, arrived = run(200.0, rate_hz=250.0, dropout_share=0.1, outlier_share=0.02)
    measured = len(watch.measured_us)
    assert abs(len(arrived) / measured - 0.9) < 0.005
    assert abs(watch.outliers / measured - 0.02) < 0.003


def test_each_interval_has_one_gap_of_the_stated_length() -> None:
    _, arrived = run(50.0, rate_hz=250.0, gap_ms=200.0, gap_every_s=10.0)
    stamps = np.array([one.t_us for _, one in arrived])
    pauses = np.diff(stamps)
    long = pauses > 4000
    assert long.sum() == 5
    assert (abs(pauses[long] - 200_000) <= 4000).all()
    at_s = 1e-6 * (stamps[:-1][long] - START_US)
    assert [int(at // 10.0) for at in at_s] == [0, 1, 2, 3, 4]
    assert len({round(at % 10.0, 2) for at in at_s}) == 5  # each somewhere else


def test_all_is_lost_at_a_share_of_one() -> None:
    watch, arrived = run(1.0, rate_hz=100.0, dropout_share=1.0)
    assert watch.measured_us
    assert not arrived
