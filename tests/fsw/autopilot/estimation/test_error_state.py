"""The filter's slopes against finite differences, and its prediction against a fine integration."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fsw.autopilot.estimation.error_state import (
    BA,
    BARO,
    BG,
    COLUMNS,
    DELAY,
    ERRORS,
    FILTER,
    FORCE_MADE,
    LOST,
    MADE_LASTS,
    MODELLED,
    NO_FORCE,
    TH,
    TIME,
    correct,
    distance,
    inject,
    integrated,
    propagate,
    step_to,
    transition,
)
from fsw.autopilot.estimation.fusion import position_rows
from fsw.autopilot.estimation.sensors.barometer import pressure_rows
from fsw.autopilot.estimation.sensors.gnss import velocity_rows
from fsw.autopilot.estimation.sensors.magnetometer import MagnetometerTuning, heading_rows
from fsw.autopilot.estimation.sensors.pose import PoseTuning, attitude_rows
from fsw.autopilot.estimation.sensors.rangefinder import RangefinderTuning, range_rows
from fsw.autopilot.estimation.tuning import EstimatorTuning
from fsw.autopilot.geometry.quaternion import conjugate, multiply, rotation_vector, turned
from fsw.autopilot.geometry.rotation import matrix_from_quaternion
from fsw.compiled import packed
from tests.fsw.autopilot.estimation.sensor_runs import TICK, flight

Array = NDArray[np.float64]
LAW = packed(EstimatorTuning(pose=PoseTuning(delay_sigma=0.01))).view(np.recarray)[0]
COMPASS = packed(MagnetometerTuning(declination=0.1)).view(np.recarray)[0]
RANGES = packed(RangefinderTuning()).view(np.recarray)[0]
FORCE, RATE = (0.7, -1.2, -9.0), (0.4, -1.1, 0.8)
STEP = 1e-6
TILT = (TH, TH + 1)


Records = np.recarray[Any, Any]  # kernels read entries by name; plain Python can do so of these


def some_state() -> Records:
    """A filter in a state with nothing special about it."""
    filter_ = np.zeros(1, dtype=FILTER).view(np.recarray)
    x = filter_[0]
    x["p"], x["v"] = (1.0, -2.0, -3.0), (0.5, -0.4, 0.2)
    x["q"] = turned((1.0, 0.0, 0.0, 0.0), 0.3, -0.2, 1.0)
    x["rate"], x["acceleration"] = RATE, (0.3, 0.2, -0.5)
    x["baro_bias"], x["pose_delay"] = 0.7, 0.004
    x["covariance"] = np.diag(np.linspace(0.1, 0.5, ERRORS))
    return filter_


def moved(filter_: Records, error: int, by: float) -> Records:
    """The same filter, one error of its nominal state moved."""
    other = filter_.copy()
    other[0]["error"] = 0.0
    other[0]["error"][error] = by
    inject(other[0])
    return other


ROWS: list[tuple[str, int, Callable[[Any], object]]] = [
    ("position", 3, lambda x: position_rows(x, (1.0, 2.0, 3.0), (1.0,) * 3, 1e-3, 0.0)),
    (
        "attitude",
        3,
        lambda x: attitude_rows(
            x, turned(tuple(some_state()[0]["q"]), 1e-4, 2e-4, -1e-4), (1.0,) * 3, 1e-3, 0.0
        ),
    ),
    ("velocity", 3, lambda x: velocity_rows(x, (1.0, 2.0, 3.0), (1.0,) * 3, 1e-3)),
    ("pressure", 1, lambda x: pressure_rows(x, 5.0, 1.0, 1e-3)),
    ("range", 1, lambda x: range_rows(x, RANGES, 3.1, 1.0, 0.0)),
]


@pytest.mark.parametrize(("name", "rows", "fill"), ROWS, ids=[row[0] for row in ROWS])
def test_slopes_of_a_measurement_are_those_of_its_residual(
    name: str, rows: int, fill: Callable[[Any], object]
) -> None:
    filter_ = some_state()
    fill(filter_[0])
    slopes = filter_[0]["H"][:rows].copy()
    for error in range(ERRORS):
        ahead, behind = moved(filter_, error, STEP), moved(filter_, error, -STEP)
        fill(ahead[0])
        fill(behind[0])
        difference = ahead[0]["residual"][:rows] - behind[0]["residual"][:rows]
        # The residual falls by what the state rises.
        if name == "range" and error in TILT:
            continue
        np.testing.assert_allclose(-difference / (2 * STEP), slopes[:, error], atol=2e-3)


def test_a_distance_corrects_no_tilt_and_what_that_makes_of_it_is_noise() -> None:
    """A rangefinder that drifted by 0.1 m/s tilted the estimate by 38 deg, ever faster."""
    filter_ = some_state()

    def residual_at(tilt: int, by: float) -> float:
        other = moved(filter_, tilt, by)
        range_rows(other[0], RANGES, 3.1, 1.0, 0.0)
        return float(other[0]["residual"][0])

    range_rows(filter_[0], RANGES, 3.1, 1.0, 0.0)
    assert not filter_[0]["H"][0, list(TILT)].any()
    M = filter_[0]["covariance"]
    slopes = [(residual_at(k, STEP) - residual_at(k, -STEP)) / (2 * STEP) for k in TILT]
    tilt = sum(slope**2 * M[k, k] for slope, k in zip(slopes, TILT, strict=True))
    assert tilt > 0.01
    assert filter_[0]["variance"][0] == pytest.approx(1.0 + tilt, rel=1e-4)


def test_the_heading_slopes_are_those_of_a_field_that_agrees_with_the_state() -> None:
    filter_ = some_state()
    R = np.array(matrix_from_quaternion(tuple(filter_[0]["q"]))).reshape(3, 3)
    field = R.T @ np.array([0.2 * math.cos(0.1), 0.2 * math.sin(0.1), 0.4])
    measured = tuple(field.tolist())
    assert heading_rows(filter_[0], COMPASS, measured, 0.0)
    slopes = filter_[0]["H"][0].copy()
    for error in range(ERRORS):
        ahead, behind = moved(filter_, error, STEP), moved(filter_, error, -STEP)
        heading_rows(ahead[0], COMPASS, measured, 0.0)
        heading_rows(behind[0], COMPASS, measured, 0.0)
        difference = ahead[0]["residual"][0] - behind[0]["residual"][0]
        assert -difference / (2 * STEP) == pytest.approx(slopes[error], abs=1e-6)


def test_heading_slopes_do_not_go_with_the_noise_of_the_field() -> None:
    """They did, and pulled the pitch: noise across the field is in the residual as well."""
    filter_ = some_state()
    R = np.array(matrix_from_quaternion(tuple(filter_[0]["q"]))).reshape(3, 3)
    slopes = []
    for noise in (-0.02, 0.02):
        field = R.T @ np.array([0.2 * math.cos(0.1), 0.2 * math.sin(0.1) + noise, 0.4])
        heading_rows(filter_[0], COMPASS, tuple(field.tolist()), 0.0)
        slopes.append(filter_[0]["H"][0, TH : TH + 3].copy())
    np.testing.assert_allclose(slopes[0], slopes[1], atol=0.05)


def test_a_longer_delay_moves_the_expected_pose_back() -> None:
    filter_ = some_state()
    for rows in (position_rows, attitude_rows):
        z = (1.0, 2.0, 3.0) if rows is position_rows else tuple(filter_[0]["q"])

        def residual(delay: float, rows: Callable[..., None] = rows, z: object = z) -> Array:
            rows(filter_[0], z, (1.0,) * 3, 0.001 - delay, 1.0)
            found: Array = filter_[0]["residual"].copy()
            return found

        slope = (residual(1e-5) - residual(-1e-5)) / 2e-5
        residual(0.0)
        np.testing.assert_allclose(-slope, filter_[0]["H"][:, DELAY], atol=2e-3)


def test_the_covariance_moves_with_the_slopes_of_the_prediction() -> None:
    filter_ = some_state()
    x, dt = filter_[0], TICK
    state = tuple(x["p"]), tuple(x["v"]), tuple(x["q"])
    R = matrix_from_quaternion(state[2])

    def after(error: Array) -> tuple[Array, Array, tuple[float, ...]]:
        p, v = np.array(state[0]) + error[0:3], np.array(state[1]) + error[3:6]
        q = turned(state[2], *error[6:9])
        f, w = np.array(FORCE) - error[9:12], np.array(RATE) - error[12:15]
        p2, v2, q2, _ = integrated(tuple(p), tuple(v), q, tuple(f), tuple(w), dt)
        return np.array(p2), np.array(v2), q2

    F = np.eye(ERRORS)
    for k in range(15):
        error = np.zeros(ERRORS)
        error[k] = STEP
        p1, v1, q1 = after(error)
        p0, v0, q0 = after(-error)
        turn = rotation_vector(multiply(conjugate(q0), q1))
        F[:9, k] = np.concatenate([p1 - p0, v1 - v0, turn]) / (2 * STEP)
    P = np.array(x["covariance"])
    expected = F @ P @ F.T
    propagate(x["covariance"], transition(R, FORCE, RATE, dt), dt)
    np.testing.assert_allclose(x["covariance"], expected, atol=2e-5)
    assert abs(x["covariance"] - x["covariance"].T).max() < 1e-15


def test_a_correction_is_that_of_the_textbook() -> None:
    filter_ = some_state()
    x = filter_[0]
    random = np.random.default_rng(1)
    A = random.standard_normal((ERRORS, ERRORS))
    P = A @ A.T / ERRORS
    x["covariance"] = P
    position_rows(x, (1.01, -2.02, -2.97), (0.01, 0.02, 0.03), 1e-3, 1.0)
    H, r, N = x["H"][:3].copy(), x["residual"].copy(), np.diag(x["variance"])
    S = H @ P @ H.T + N
    K = P @ H.T @ np.linalg.inv(S)
    assert distance(x, 3) == pytest.approx(r @ np.linalg.solve(S, r))
    before = x.copy()
    correct(x, 3)
    np.testing.assert_allclose(x["covariance"], P - K @ S @ K.T, atol=1e-12)
    np.testing.assert_allclose(x["error"], K @ r, atol=1e-12)
    np.testing.assert_allclose(x["p"] - before["p"], (K @ r)[:3], atol=1e-12)
    np.testing.assert_allclose(x["bias"][3:], (K @ r)[BG : BG + 3], atol=1e-12)
    assert x["baro_bias"] == pytest.approx(0.7 + (K @ r)[BARO])


def test_integrating_exact_readings_follows_the_flight() -> None:
    truth = flight(3, 2.0)
    every = round(TICK / (truth.t[1] - truth.t[0]))
    force, rate = truth.force[::every], truth.rate[::every]
    p, v, q = tuple(truth.p[0]), tuple(truth.v[0]), tuple(truth.q[0])
    for k in range(len(force) - 1):
        f, w = 0.5 * (force[k] + force[k + 1]), 0.5 * (rate[k] + rate[k + 1])
        p, v, q, _ = integrated(p, v, q, tuple(f), tuple(w), TICK)
    np.testing.assert_allclose(p, truth.p[-1], atol=2e-5)
    np.testing.assert_allclose(v, truth.v[-1], atol=2e-5)
    assert abs(np.dot(q, truth.q[-1])) > 1.0 - 1e-10


@pytest.mark.drawn(1)
@pytest.mark.parametrize(("made", "most"), [(FORCE_MADE, 1.2), (0, math.inf)])
def test_what_rotors_do_not_know_of_a_force_does_not_grow_without_bound(
    made: int, most: float
) -> None:
    """Else satellites tell no tilt from it: one vehicle in twenty without its unit fell over."""
    x = some_state()[0]
    x["model_walk"] = 3.0, 0.15
    rows = np.zeros((2, COLUMNS))
    rows[:, LOST] = NO_FORCE | MODELLED | made
    walked = 0.0
    for _ in range(1500):
        rows[1, TIME] = x["time"] + TICK
        step_to(x, LAW, rows[1], rows[0], x["covariance"])
        walked += 9.0 * TICK
    stays = 9.0 * 0.5 * MADE_LASTS
    variance = x["covariance"][BA, BA]
    assert variance <= most * stays
    assert math.isfinite(most) or variance > 0.9 * walked
    assert np.all(np.linalg.eigvalsh(x["covariance"]) > -1e-9)
