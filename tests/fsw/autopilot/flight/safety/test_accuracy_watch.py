"""When the analysis of the estimate is told, and with what."""

from __future__ import annotations

import numpy as np
import pytest

from fsw.autopilot.control import tube
from fsw.autopilot.estimation.error_state import ERRORS, TH, Array, V
from fsw.autopilot.flight.safety.accuracy_watch import AccuracyMemory, AccuracyWatch
from fsw.autopilot.parameters.consistency import Accuracy, estimate_reach, loop_tube
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.signals import SafeSet, Severity, StatusText

CONFIG = FlightConfig()
LOOP = loop_tube(CONFIG)
WATCH = AccuracyWatch(CONFIG, LOOP)
WALLS = SafeSet((wall((-1.0, 0.0, 0.0), -5.0, 0.1),))


def covariance(velocity: float, tilt: float) -> Array:
    M = np.zeros((ERRORS, ERRORS))
    M[V, V], M[TH, TH] = velocity**2, tilt**2
    return M


def seen(seconds: int, velocity: list[float], safe_set: SafeSet = WALLS) -> list[StatusText]:
    """Texts of so many seconds, with the velocity's deviation of each."""
    memory, texts = AccuracyMemory(), list[StatusText]()
    for k in range(10 * seconds + 1):
        speed = velocity[min(k // 10, len(velocity) - 1)]
        now_us = 1_000_000 + 100_000 * k
        memory = WATCH.see(memory, now_us, safe_set, "pose", 0.001, covariance(speed, 1e-3), texts)
    return texts


def test_it_is_told_once_when_velocity_and_tilt_have_settled() -> None:
    assert seen(5, [0.01]) == []
    (text,) = seen(60, [0.01])
    assert text.severity is Severity.WARNING
    assert text.text == (
        "estimate from pose, 3 sigma: a place off by 3 mm, for which clearances grow; "
        "a velocity off by 30 mm/s and a tilt off by 3.0 mrad, which move the base by 19 mm at "
        "most; with the tube 89 mm of the 88 mm that the plan keeps; a clearance 2 mm larger is "
        "enough"
    )


def test_what_takes_longer_than_a_tick_is_worked_out_before_the_flight(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tube.estimate_tube.cache_clear()
    AccuracyWatch(CONFIG, LOOP)
    monkeypatch.setattr(tube, "after_a_push", lambda *_: pytest.fail("worked out in flight"))
    assert len(seen(60, [0.01])) == 1


def test_what_still_converges_is_waited_for_but_not_for_ever() -> None:
    converging = [0.5, 0.3, 0.2, 0.15, 0.1, 0.08, 0.05, 0.02, 0.01]
    assert seen(8, converging) == []
    (text,) = seen(30, converging)
    assert "a velocity off by 30 mm/s" in text.text
    never = [0.5 * 0.8**k for k in range(100)]
    assert len(seen(40, never)) == 1


def test_without_a_safe_set_there_is_nothing_to_tell() -> None:
    assert seen(60, [0.01], SafeSet()) == []


def test_more_than_the_plan_keeps_is_a_warning_that_says_what_is_enough() -> None:
    (good,), (bad,) = seen(10, [0.002]), seen(10, [0.03])
    assert (good.severity, bad.severity) == (Severity.INFO, Severity.WARNING)
    assert "a clearance" in bad.text
    assert "mm larger is enough" in bad.text


def test_what_the_estimate_adds_is_kept_for_the_watch_of_the_tube() -> None:
    memory = AccuracyMemory()
    for k in range(100):
        memory = WATCH.see(memory, 100_000 * k, WALLS, "pose", 0.001, covariance(0.01, 1e-3), [])
    expected = estimate_reach(CONFIG, Accuracy("pose", 0.001, 0.01, 1e-3))
    assert memory.told
    assert memory.reach == pytest.approx(expected)
