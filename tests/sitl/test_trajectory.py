"""References: exact derivatives, at rest at both ends, where the scenario says."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numba import njit

from sitl.scenario import Hold, Points, Push
from sitl.scenario_file import load_scenario, scenario_names
from sitl.trajectory import curve_row, place_on_curve, reference, warped

STEP = 1e-4
COMPILED = njit(place_on_curve)  # once for all scenarios: it takes longer than their points


@pytest.mark.parametrize("name", scenario_names())
def test_derivatives_equal_finite_differences(name: str) -> None:
    trajectory = load_scenario(name).trajectory
    curve = reference(trajectory)
    # A cubic through points begins and ends with an acceleration, which is not differentiated.
    ends = (trajectory.time_s[0], trajectory.time_s[-1]) if isinstance(trajectory, Points) else ()
    for t in np.linspace(0.0, 120.0, 400):
        if any(abs(t - end) <= STEP for end in ends):
            continue
        before, here, after = (curve.at(t - STEP), curve.at(t), curve.at(t + STEP))
        v = (np.array(after.p) - np.array(before.p)) / (2 * STEP)
        a = (np.array(after.v) - np.array(before.v)) / (2 * STEP)
        assert np.abs(v - here.v).max() <= 1e-7
        # Between pieces the jerk, of at most 0.8 m/s^3 here, jumps.
        assert np.abs(a - here.a).max() <= 1e-6 + 0.25 * STEP * 0.8


@pytest.mark.parametrize("name", scenario_names())
def test_a_trajectory_starts_and_stops_at_rest(name: str) -> None:
    trajectory = load_scenario(name).trajectory
    if isinstance(trajectory, Hold):
        return
    curve = reference(trajectory)
    # The places of a push, and points, are gone through in their own time.
    end = 300.0 if isinstance(trajectory, Push | Points) else trajectory.duration_s
    for t in (-1.0, 0.0, end, end + 5.0):
        point = curve.at(t)
        assert max(map(abs, point.v)) <= 1e-12
        assert isinstance(trajectory, Points) or max(map(abs, point.a)) <= 1e-12
    assert curve.at(-1.0).p == pytest.approx(curve.at(0.0).p, abs=1e-12)


@pytest.mark.parametrize("name", scenario_names())
def test_compiled_code_sees_the_same_curve(name: str) -> None:
    trajectory = load_scenario(name).trajectory
    row, curve = np.array(curve_row(trajectory)), reference(trajectory)
    for t in np.linspace(-1.0, 121.0, 300):
        at = float(t)
        assert place_on_curve(row, at) == curve.at(at).p
        assert COMPILED(row, at) == pytest.approx(curve.at(at).p, abs=1e-12)


def test_the_warp_runs_at_full_speed_between_its_ramps() -> None:
    assert warped(4.0, 4.0, 20.0)[0] == pytest.approx(2.0)
    assert warped(10.0, 4.0, 20.0) == pytest.approx((8.0, 1.0, 0.0))
    assert warped(20.0, 4.0, 20.0)[0] == pytest.approx(16.0)
    rates = [warped(float(t), 4.0, 20.0)[1] for t in np.linspace(-1.0, 21.0, 300)]
    assert min(rates) >= 0.0
    assert max(rates) <= 1.0


def test_the_walls_path_enters_each_safety_zone_by_30_mm_and_stays_slow() -> None:
    curve = reference(load_scenario("walls").trajectory)
    points = [curve.at(t) for t in np.arange(0.0, 120.0, 0.05)]
    assert max(p.p[0] for p in points) == pytest.approx(0.93, abs=1e-3)
    assert max(p.p[1] for p in points) == pytest.approx(0.93, abs=1e-3)
    assert min(p.p[1] for p in points) == pytest.approx(-0.93, abs=1e-3)
    assert max(math.hypot(*p.v) for p in points) <= 0.125


def test_a_held_point_never_moves() -> None:
    point = reference(Hold((1.0, 2.0, -3.0))).at(17.0)
    assert point.p == (1.0, 2.0, -3.0)
    assert point.v == point.a == (0.0, 0.0, 0.0)
