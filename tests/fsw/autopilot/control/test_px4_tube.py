"""The tube of PX4's loops, beside SciPy's simulation of that loop and its worst disturbance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import StateSpace, lsim

from fsw.autopilot.control.px4_loops import Px4Tuning
from fsw.autopilot.control.px4_tube import horizontal_loop, is_stable, px4_tube, softer
from fsw.autopilot.parameters.consistency import analyse, loop_tube, refusals
from fsw.autopilot.parameters.flight_config import above_px4, flight_config
from fsw.autopilot.tuning import tuned
from sitl.scenario_file import load_scenario
from studies.flight.mission import safe_set

PX4 = Px4Tuning()
DT = 0.002


@pytest.mark.parametrize("px4", [PX4, replace(PX4, cancelled=0.0)])
def test_the_worst_disturbance_reaches_the_tube_and_none_passes_it(px4: Px4Tuning) -> None:
    a, b = horizontal_loop(softer(px4))
    loop = StateSpace(a, b[:, None], np.eye(8)[:1], np.zeros((1, 1)))
    times = np.arange(0.0, 15.0, DT)
    response = lsim(loop, np.where(times < DT, 1.0 / DT, 0.0), times, interp=False)[1]
    worst = np.sign(response[::-1])
    reached = float(np.abs(lsim(loop, worst, times, interp=False)[1]).max())
    bound = px4_tube(px4, 0.2, 0.1, DT).base
    assert reached == pytest.approx(bound, rel=0.02)
    rng = np.random.default_rng(3)
    for hold in (5, 50, 500):
        pushes = np.repeat(rng.choice([-1.0, 1.0], len(times) // hold + 1), hold)[: len(times)]
        assert np.abs(lsim(loop, pushes, times, interp=False)[1]).max() < bound


def test_a_constant_push_is_forgotten_by_the_integral() -> None:
    a, b = horizontal_loop(PX4)
    at_rest = np.linalg.solve(a, -b)
    assert at_rest[0] == pytest.approx(0.0, abs=1e-9)
    assert at_rest[2] == pytest.approx(-1.0)  # it leans against it


def test_a_loop_that_does_not_settle_is_found() -> None:
    assert is_stable(PX4)
    assert not is_stable(replace(PX4, delay=0.2, velocity_gain=12.0))


def findings(**px4: float) -> tuple[str, ...]:
    paths = tuple((f"px4.{name}", value) for name, value in px4.items())
    config = above_px4(flight_config(), paths)
    walls = safe_set(load_scenario("walls"), 0)
    return refusals(analyse(config, walls, loop_tube(config)))


def test_walls_can_be_kept_with_the_loops_that_px4_is_told_to_have() -> None:
    assert findings() == ()


@pytest.mark.parametrize(
    ("px4", "why"),
    [
        (
            {"position_gain": 0.95, "velocity_gain": 1.8, "velocity_integral": 0.4},
            "pushes the base",
        ),
        ({"cancelled": 0.0}, "pushes the base further than 175 mm off its plan"),
        ({"delay": 0.1}, "do not settle"),
    ],
)
def test_what_cannot_hold_is_refused_with_numbers(px4: dict[str, float], why: str) -> None:
    """PX4's own gains, no disturbance cancelled, a wrong lag."""
    found = findings(**px4)
    assert any(why in one for one in found), found


def test_a_radius_is_asked_for_that_the_analysis_then_accepts() -> None:
    config = above_px4(flight_config())
    sphere = safe_set(load_scenario("workspace"), 0)
    against = refusals(analyse(config, sphere, loop_tube(config)))
    assert any("r >= 0.100 m" in one for one in against)


def test_plans_are_predicted_with_the_lag_of_px4() -> None:
    config = above_px4(flight_config(), (("px4.tilt_kp", 70.0), ("px4.delay", 0.03)))
    assert config.airframe.attitude_lag.kp == 70.0
    assert config.airframe.rotor_lag == 0.03
    assert tuned(config, (("px4.cancelled", 0.5),)).px4.cancelled == 0.5
