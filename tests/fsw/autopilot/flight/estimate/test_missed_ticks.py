"""What waited while no tick ran is taken in its order, each reading once."""

from __future__ import annotations

from fsw.autopilot.flight.estimate.sensed_state import READ_LATE_US, missed_inputs
from fsw.autopilot.measurements import ImuSample
from fsw.autopilot.signals import SensorFrame, TickInputs

LAST_US = 5_000_000
NOTHING = (float("nan"),) * 3


def given(pause_us: int) -> TickInputs:
    """A tick so long after the last one, with a reading for each 2 ms of it."""
    now_us = LAST_US + pause_us
    samples = tuple(
        ImuSample(1e-6 * t_us, (0.0, 0.0, -9.81), (0.0, 0.0, 0.0))
        for t_us in range(LAST_US + 2000, now_us + 1, 2000)
    )
    rest = (NOTHING, NOTHING, (float("nan"),) * 4, NOTHING, NOTHING, NOTHING[:2], NOTHING[:2])
    return TickInputs(SensorFrame(now_us, *rest), samples=samples)


def test_every_reading_of_a_pause_is_taken_once_and_in_time() -> None:
    inputs = given(500_000)
    ticks = list(missed_inputs(LAST_US, inputs))
    assert len(ticks) > 100
    assert tuple(one for tick in ticks for one in tick.samples) == inputs.samples
    for tick in ticks:
        ages = [1e-6 * tick.sensors.t_us - one.time for one in tick.samples]
        assert all(-1e-9 <= age < 0.01 for age in ages)
    assert ticks[-1].sensors == inputs.sensors


def test_a_tick_that_comes_soon_is_given_what_it_was_given() -> None:
    inputs = given(READ_LATE_US)
    assert list(missed_inputs(LAST_US, inputs)) == [inputs]
    bare = TickInputs(given(500_000).sensors)
    assert list(missed_inputs(LAST_US, bare)) == [bare]
