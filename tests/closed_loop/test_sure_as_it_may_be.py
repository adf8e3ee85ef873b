"""Whether the estimate is as sure as it may be with the simulator's suites and the tuning flown.

The tests of the filter alone (tests/fsw/autopilot/estimation) draw their sensors' errors as the
filter believes them. Here sensors have the errors that no filter believes: offsets, scales,
vibration, wander, outliers, delays that vary.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2

from fsw.autopilot.estimation.correlated_error import correlated_error
from fsw.autopilot.estimation.error_state import TH, P, V
from fsw.autopilot.estimation.sensor_fusion import SensorFusion
from fsw.autopilot.geometry.quaternion import conjugate, multiply, rotation_vector
from fsw.autopilot.geometry.rotation import quaternion_from_matrix
from sitl.scenario import Hold, Scenario
from sitl.scenario_file import load_scenario
from tests.closed_loop.harness import ARM, Flight, command

Array = NDArray[np.float64]
FIRST_SEED = 4000  # of none that anything was tuned with
PARTS = {"position": P, "velocity": V, "attitude": TH}


def scenario(suite: str) -> Scenario:
    if suite == "gnss":
        # Its errors are as large as the room between the walls, and nearer to the ground the first
        # height may say that the vehicle stands on it: it then falls, and no flight is judged.
        return replace(load_scenario("field", suite), walls=(), trajectory=Hold((0.0, 0.0, -12.0)))
    return load_scenario("field" if suite == "rtk" else "walls", suite)


def nees(suite: str, seed: int, seconds: float) -> list[float]:
    """Normalised squared error of each of the parts at the end of a flight.

    The covariance is the one that is told and that clearances grow by.
    """
    flight = Flight(scenario(suite), seed=seed)
    if suite == "gnss":
        flight.step(command(ARM, 1.0))
    else:
        flight.follow()
    truth = flight.sim.truth()
    for _ in range(round(500 * seconds)):
        truth = flight.sim.truth()
        flight.step()
    assert flight.sim.ended is None, flight.sim.ended
    estimate, memory = flight.state.estimate, flight.state.fusion
    assert estimate is not None
    assert memory is not None
    tuning = flight.config.estimator
    M = SensorFusion(tuning, 2).covariance(memory, memory.now)
    at = [P, P + 1, P + 2, TH, TH + 1, TH + 2]
    M[at, at] += correlated_error(memory, tuning)
    turn = multiply(conjugate(quaternion_from_matrix(estimate.R_WB)), truth.q_WB)
    error = np.zeros(len(M))
    error[P : P + 3] = np.subtract(truth.p_WB, estimate.p_WB)
    error[V : V + 3] = np.subtract(truth.v_WB, estimate.v_WB)
    error[TH : TH + 3] = rotation_vector(turn)
    return [_squared(error[k : k + 3], M[k : k + 3, k : k + 3]) for k in PARTS.values()]


def _squared(error: Array, covariance: Array) -> float:
    return float(error @ np.linalg.solve(covariance, error))


def too_sure(suite: str, flights: int, seconds: float) -> dict[str, tuple[float, float]]:
    """Parts whose mean is above the 95 % bound, with both: 3 is expected, and less allowed."""
    seeds = range(FIRST_SEED, FIRST_SEED + flights)
    means = np.mean([nees(suite, seed, seconds) for seed in seeds], axis=0).tolist()
    most = float(chi2.ppf(0.95, 3 * flights)) / flights
    return {part: (mean, most) for part, mean in zip(PARTS, means, strict=True) if not mean <= most}


@pytest.mark.requirement("REQ-EST-2")
@pytest.mark.long
@pytest.mark.parametrize("suite", ["mocap", "vio", "rtk", "gnss"])
def test_with_a_suites_errors_the_estimate_is_not_too_sure(suite: str) -> None:
    assert not too_sure(suite, flights=24, seconds=6.0)


@pytest.mark.long
@pytest.mark.requirement("REQ-EST-2")
def test_a_few_flights_on_satellites_are_not_too_sure() -> None:
    assert not too_sure("rtk", flights=4, seconds=4.0)
