"""The filter against a batch smoother that shares nothing with it: GTSAM, on the same readings.

At the newest pose, filter and smoother know the same. What the smoother does better is to linearise
all of the flight about its end.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from fsw.autopilot.estimation.fusion_memory import at_start
from fsw.autopilot.estimation.sensor_fusion import SensorFusion
from fsw.autopilot.measurements import ImuSample, PoseSample
from tests.fsw.autopilot.estimation.sensor_runs import VIO, PoseSensor, Run, rotations, run

gtsam = pytest.importorskip("gtsam", exc_type=ImportError)
Array = NDArray[np.float64]
DURATION = 3.0
CLOSE = 0.5  # standard deviations; biases of up to 1 m/s^2 were linearised about zero
SENSOR = PoseSensor(25.0, 0.02, 3e-3, np.radians(0.3))


def smoothed(flown: Run) -> tuple[float, Array, Array, Array, Array]:
    """Time, position, velocity, rotation and standard deviations (15,) at the newest pose."""
    tuning = flown.suite.tuning
    eye = np.eye(3)
    imu = gtsam.PreintegrationCombinedParams.MakeSharedD(9.81)
    imu.setAccelerometerCovariance(eye * tuning.accel_noise**2)
    imu.setGyroscopeCovariance(eye * tuning.gyro_noise**2)
    imu.setIntegrationCovariance(eye * 1e-12)
    imu.setBiasAccCovariance(eye * tuning.accel_bias_walk**2)
    imu.setBiasOmegaCovariance(eye * tuning.gyro_bias_walk**2)
    key = {name: (lambda k, c=name: gtsam.symbol(c, k)) for name in "xvb"}
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    none = gtsam.imuBias.ConstantBias()
    readings = [s for _, samples in flown for s in samples if isinstance(s, ImuSample)]
    poses = [s for _, samples in flown for s in samples if isinstance(s, PoseSample)]
    times = np.array([s.time for s in readings])
    force = np.array([s.acceleration for s in readings])
    rate = np.array([s.rate for s in readings])
    deviations = [tuning.accel_bias] * 3 + [tuning.gyro_bias] * 3
    isotropic, diagonal = gtsam.noiseModel.Isotropic, gtsam.noiseModel.Diagonal
    graph.add(
        gtsam.PriorFactorVector(key["v"](0), np.zeros(3), isotropic.Sigma(3, tuning.velocity))
    )
    prior = diagonal.Sigmas(np.array(deviations))
    graph.add(gtsam.PriorFactorConstantBias(key["b"](0), none, prior))
    noise = diagonal.Sigmas(np.array([SENSOR.attitude] * 3 + [SENSOR.position] * 3))
    velocity = np.zeros(3)
    for k, pose in enumerate(poses):
        R = rotations(np.array([pose.attitude]))[0]
        measured = gtsam.Pose3(gtsam.Rot3(R), np.array(pose.position))
        graph.add(gtsam.PriorFactorPose3(key["x"](k), measured, noise))
        values.insert(key["x"](k), measured)
        if k > 0:
            before = poses[k - 1]
            between = gtsam.PreintegratedCombinedMeasurements(imu, none)
            inside = times[(times > before.time + 1e-9) & (times < pose.time - 1e-9)]
            nodes = np.concatenate([[before.time], inside, [pose.time]])
            for first, last in pairwise(nodes):
                # As the filter does: the mean of the two readings around the step.
                i = min(int(np.searchsorted(times, 0.5 * (first + last))), len(times) - 1)
                f, w = 0.5 * (force[i - 1] + force[i]), 0.5 * (rate[i - 1] + rate[i])
                between.integrateMeasurement(f, w, last - first)
            names = [("x", k - 1), ("v", k - 1), ("x", k), ("v", k), ("b", k - 1), ("b", k)]
            graph.add(gtsam.CombinedImuFactor(*(key[n](i) for n, i in names), between))
            step = pose.time - before.time
            velocity = (np.array(pose.position) - np.array(before.position)) / step
        values.insert(key["v"](k), velocity)
        values.insert(key["b"](k), none)
    found = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    last = len(poses) - 1
    marginals = gtsam.Marginals(graph, found)
    x = np.diag(marginals.marginalCovariance(key["x"](last)))
    v = np.diag(marginals.marginalCovariance(key["v"](last)))
    b = np.diag(marginals.marginalCovariance(key["b"](last)))
    pose = found.atPose3(key["x"](last))
    variances = np.concatenate([x[3:], v, x[:3], b])  # positions in body axes: isotropic noise
    return (
        poses[last].time,
        pose.translation(),
        found.atVector(key["v"](last)),
        pose.rotation().matrix(),
        np.sqrt(variances),
    )


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_filter_ends_where_a_batch_smoother_ends(seed: int) -> None:
    flown = run(replace(VIO, pose=SENSOR), seed, DURATION)
    time, p, v, R, sigma = smoothed(flown)
    fusion, memory = SensorFusion(flown.suite.tuning, 2), at_start(2)
    estimate = None
    # The filter's own time is that of the newest pose, once that has come.
    for now, samples in flown:
        memory, estimate = fusion.step(memory, samples, now)
        if now >= time + memory.delay + 0.0031:
            break
    assert estimate is not None
    x = memory.numbers[0]
    ours = np.sqrt(np.diag(x["covariance"]))[:15]
    assert abs(x["time"] - time) < 0.003
    dt = time - x["time"]
    moved = x["p"] + dt * x["v"]
    np.testing.assert_array_less(abs(moved - p), CLOSE * sigma[:3])
    np.testing.assert_array_less(abs(x["v"] + dt * x["acceleration"] - v), CLOSE * sigma[3:6])
    Q = rotations(np.array([x["q"]]))[0].T @ R
    turn = 0.5 * np.array([Q[2, 1] - Q[1, 2], Q[0, 2] - Q[2, 0], Q[1, 0] - Q[0, 1]])
    np.testing.assert_array_less(abs(turn - dt * x["rate"]), CLOSE * sigma[6:9])
    np.testing.assert_allclose(ours, sigma, rtol=0.05)
