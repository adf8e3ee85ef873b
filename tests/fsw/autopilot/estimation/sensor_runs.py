"""Flights with a known truth, and what sensors measure of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.estimation.sensors.barometer import BarometerTuning
from fsw.autopilot.estimation.sensors.gnss import GnssTuning
from fsw.autopilot.estimation.sensors.magnetometer import MagnetometerTuning
from fsw.autopilot.estimation.sensors.pose import PoseTuning
from fsw.autopilot.estimation.tuning import EstimatorTuning
from fsw.autopilot.measurements import (
    GnssSample,
    ImuSample,
    JointSample,
    MagneticSample,
    PoseSample,
    PressureSample,
    Sample,
)

Array = NDArray[np.float64]
TICK = 0.002  # s
ARM = (0.3, -0.2)  # rad, joints that do not move
START = 5.0  # s, time of the first reading
EARTH = np.array([0.22, 0.0, 0.42])  # Gauss, NED, without declination


def multiply(a: Array, b: Array) -> Array:
    """Quaternion products (n, 4), after the textbook."""
    aw, ax, ay, az = a.T
    bw, bx, by, bz = b.T
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=1,
    )


def exponential(turn: Array) -> Array:
    """Quaternions (n, 4) of rotation vectors (n, 3)."""
    angle = np.linalg.norm(turn, axis=1, keepdims=True)
    return np.concatenate([np.cos(angle / 2), turn * np.sinc(angle / 2 / np.pi) / 2], axis=1)


def rotations(q: Array) -> Array:
    """Matrices (n, 3, 3), body to world, of quaternions (n, 4)."""
    w, x, y, z = q.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


@dataclass(frozen=True)
class Truth:
    """A smooth flight, at every instant of a fine grid."""

    t: Array  # (n,) s
    p: Array  # (n, 3) m, NED
    v: Array  # (n, 3) m/s
    q: Array  # (n, 4)
    force: Array  # (n, 3) m/s^2, specific, body
    rate: Array  # (n, 3) rad/s, body

    def at(self, time: float) -> int:
        """Index of an instant."""
        return round((time - self.t[0]) / (self.t[1] - self.t[0]))


def flight(seed: int, duration: float, grid: float = 5e-4) -> Truth:
    """Sums of sinusoids for position and for roll, pitch and yaw.

    Time begins to run slowly, so that the flight begins at rest: a filter without a pose levels
    itself there.
    """
    random = np.random.default_rng([seed, 1])
    t = np.arange(round(duration / grid) + 1) * grid
    # Time of the sinusoids, its speed and the speed's slope.
    begun = np.clip((t - 0.2) / 1.0, 0.0, 1.0)
    pace = begun**2 * (3.0 - 2.0 * begun)
    gathering = 6.0 * begun * (1.0 - begun) / 1.0
    waved = np.where(begun < 1.0, begun**3 - 0.5 * begun**4, t - 0.7)

    def waves(amplitude: Array, least: float, most: float) -> tuple[Array, Array, Array]:
        w = random.uniform(least, most, (3, 3))
        phase = random.uniform(0, 2 * np.pi, (3, 3))
        size = amplitude[:, None] * random.uniform(0.3, 1.0, (3, 3)) / 3
        angle = w[..., None] * waved + phase[..., None]
        value = (size[..., None] * np.sin(angle)).sum(1)
        slope = ((size * w)[..., None] * np.cos(angle)).sum(1)
        second = -((size * w * w)[..., None] * np.sin(angle)).sum(1)
        return value.T, (slope * pace).T, (second * pace**2 + slope * gathering).T

    p, v, a = waves(np.array([1.0, 1.0, 0.4]), 0.5, 3.0)
    rpy, slopes, _ = waves(np.array([0.3, 0.3, 1.0]), 0.5, 4.0)
    roll, pitch, yaw = rpy.T
    zero = np.zeros_like(roll)
    q = multiply(
        multiply(
            exponential(np.stack([zero, zero, yaw], 1)),
            exponential(np.stack([zero, pitch, zero], 1)),
        ),
        exponential(np.stack([roll, zero, zero], 1)),
    )
    dr, dp, dy = slopes.T
    rate = np.stack(
        [
            dr - dy * np.sin(pitch),
            dp * np.cos(roll) + dy * np.sin(roll) * np.cos(pitch),
            -dp * np.sin(roll) + dy * np.cos(roll) * np.cos(pitch),
        ],
        axis=1,
    )
    R = rotations(q)
    force = np.einsum("nji,nj->ni", R, a - np.array([0.0, 0.0, 9.81]))
    return Truth(START + t, p, v, q, force, rate)


@dataclass(frozen=True)
class PoseSensor:
    """Motion capture or visual odometry."""

    rate: float  # Hz
    latency: float  # s
    position: float  # m
    attitude: float  # rad
    hidden_delay: float = 0.0  # s, of which its time stamp does not know
    drift: float = 0.0  # m/sqrt(s), random walk of its frame on each axis
    turn: float = 0.0  # rad/sqrt(s), of its frame's heading
    recognises: float = 2.0  # s after the start; the frame is then right but for
    recognised: tuple[float, float] = (5e-3, 1.7e-3)  # m, rad: standard deviations


@dataclass(frozen=True)
class GnssSensor:
    """Position and velocity."""

    rate: float  # Hz
    latency: float  # s
    position: float  # m
    velocity: float  # m/s


@dataclass(frozen=True)
class Suite:
    """Sensors with the noise that the filter believes them to have."""

    tuning: EstimatorTuning
    pose: PoseSensor | None = None
    gnss: GnssSensor | None = None
    baro: float = 0.0  # m; 0: none
    mag: bool = False


_QUIET = EstimatorTuning(
    accel_noise=5e-3,
    gyro_noise=3e-4,
    accel_bias_walk=1e-3,
    gyro_bias_walk=5e-5,
    pose=PoseTuning(position_floor=2e-4, noise_at_start=1.0),
)
MOCAP = Suite(_QUIET, pose=PoseSensor(120.0, 0.015, 5e-4, np.radians(0.2)))
VIO = Suite(
    EstimatorTuning(
        accel_noise=5e-3,
        gyro_noise=3e-4,
        accel_bias_walk=1e-3,
        gyro_bias_walk=5e-5,
        pose=PoseTuning(noise_at_start=1.0),
    ),
    pose=PoseSensor(30.0, 0.045, 3e-3, np.radians(0.5), drift=5e-3, turn=np.radians(0.05)),
)
RTK = Suite(
    EstimatorTuning(
        accel_noise=5e-3,
        gyro_noise=3e-4,
        accel_bias_walk=1e-3,
        gyro_bias_walk=5e-5,
        accel_bias=0.05,
        gyro_bias=0.005,
        barometer=BarometerTuning(floor=0.01, bias=1.0),
        magnetometer=MagnetometerTuning(declination=0.0),
        gnss=GnssTuning(position_floor=1e-3, velocity_floor=0.01),
    ),
    gnss=GnssSensor(10.0, 0.12, 0.014, 0.05),
    baro=0.1,
    mag=True,
)


@dataclass
class Run:
    """One flight with the readings of one suite, in the order in which they come."""

    suite: Suite
    truth: Truth
    ticks: list[tuple[float, list[Sample]]]
    accel_bias: Array = field(default_factory=lambda: np.zeros(3))
    gyro_bias: Array = field(default_factory=lambda: np.zeros(3))
    baro_bias: float = 0.0

    def __iter__(self) -> Iterator[tuple[float, list[Sample]]]:
        return iter(self.ticks)


def run(suite: Suite, seed: int, duration: float) -> Run:
    """A flight as its sensors see it; noises and biases are drawn as the filter believes."""
    truth = flight(seed, duration)
    random = np.random.default_rng([seed, 2])
    tuning = suite.tuning
    every = round(TICK / (truth.t[1] - truth.t[0]))
    t = truth.t[::every]
    n = len(t)

    def walk(start: float, density: float) -> Array:
        steps = random.standard_normal((n, 3)) * density * np.sqrt(TICK)
        steps[0] = random.standard_normal(3) * start
        return np.cumsum(steps, axis=0)

    accel_bias = walk(tuning.accel_bias, tuning.accel_bias_walk)
    gyro_bias = walk(tuning.gyro_bias, tuning.gyro_bias_walk)
    white = 1.0 / np.sqrt(TICK)
    accel_noise = random.standard_normal((n, 3)) * tuning.accel_noise * white
    gyro_noise = random.standard_normal((n, 3)) * tuning.gyro_noise * white
    force = truth.force[::every] + accel_bias + accel_noise
    rate = truth.rate[::every] + gyro_bias + gyro_noise
    due: list[tuple[float, Sample]] = []
    baro_bias = random.standard_normal() * tuning.barometer.bias
    if suite.pose is not None:
        due += list(_poses(suite.pose, truth, random))
    if suite.gnss is not None:
        due += list(_fixes(suite.gnss, truth, random))
    if suite.baro:
        for time in np.arange(t[0], t[-1], 0.02):
            height = -truth.p[truth.at(time), 2] + baro_bias
            measured = height + suite.baro * random.standard_normal()
            due.append((time + 0.01, PressureSample(time, measured, suite.baro**2)))
    if suite.mag:
        offset = tuning.magnetometer.offset * random.standard_normal(3)
        for time in np.arange(t[0], t[-1], 0.02):
            R = rotations(truth.q[truth.at(time)][None])[0]
            measured = R.T @ EARTH + offset + tuning.magnetometer.noise * random.standard_normal(3)
            due.append((time + 0.005, MagneticSample(time, tuple(measured.tolist()))))
    due.sort(key=lambda one: one[0])
    ticks, k = [], 0
    columns = zip(t.tolist(), force.tolist(), rate.tolist(), strict=True)
    for time, f, w in columns:
        samples: list[Sample] = [ImuSample(time, tuple(f), tuple(w)), JointSample(time, ARM)]
        while k < len(due) and due[k][0] <= time:
            samples.append(due[k][1])
            k += 1
        ticks.append((time, samples))
    return Run(suite, truth, ticks, accel_bias[-1], gyro_bias[-1], baro_bias)


def _poses(
    sensor: PoseSensor, truth: Truth, random: np.random.Generator
) -> Iterator[tuple[float, Sample]]:
    grid = truth.t[1] - truth.t[0]
    first = truth.t[0] + random.uniform(0.0, 1.0 / sensor.rate)
    frame = Frame(sensor, random)
    for ideal in np.arange(first, truth.t[-1], 1.0 / sensor.rate):
        time = truth.t[0] + round((ideal - truth.t[0]) / grid) * grid
        k = truth.at(time - sensor.hidden_delay)
        if k < 0:
            continue
        position = truth.p[k] + sensor.position * random.standard_normal(3)
        turn = sensor.attitude * random.standard_normal((1, 3))
        attitude = multiply(truth.q[k][None], exponential(turn))[0]
        sample = PoseSample(
            float(time),
            tuple(position.tolist()),
            tuple(attitude.tolist()),
            (sensor.position**2,) * 3,
            (sensor.attitude**2,) * 3,
        )
        yield time + sensor.latency, frame.seen(sample) if sensor.drift else sample


class Frame:
    """The frame of an odometry: it walks away, and is put right once."""

    def __init__(self, sensor: PoseSensor, random: np.random.Generator) -> None:
        self.sensor, self.random = sensor, random
        self.place, self.heading = np.zeros(3), 0.0
        self.variance, self.turned = 0.0, 0.0  # m^2, rad^2, as it knows itself
        self.jumps = 0
        self.step = 0.0  # sqrt(s); the first pose is in the true frame

    def seen(self, sample: PoseSample) -> PoseSample:
        """The sample in the frame as it is one period later."""
        sensor, step = self.sensor, self.step
        self.step = np.sqrt(1.0 / sensor.rate)
        self.place = self.place + sensor.drift * step * self.random.standard_normal(3)
        self.heading += sensor.turn * step * self.random.standard_normal()
        self.variance += (sensor.drift * step) ** 2
        self.turned += (sensor.turn * step) ** 2
        if not self.jumps and sample.time > START + sensor.recognises:
            far, about = sensor.recognised
            self.place = far * self.random.standard_normal(3)
            self.heading = about * self.random.standard_normal()
            self.variance, self.turned, self.jumps = far**2, about**2, 1
        yaw = np.array([[0.0, 0.0, self.heading]])
        x, y, _ = sample.position
        place = rotations(exponential(yaw))[0] @ np.array(sample.position) + self.place
        noise, about = sensor.position**2 + self.variance, sensor.attitude**2
        return replace(
            sample,
            position=tuple(place.tolist()),
            attitude=tuple(multiply(exponential(yaw), np.array([sample.attitude]))[0].tolist()),
            position_variance=(noise + self.turned * y * y, noise + self.turned * x * x, noise),
            attitude_variance=(about, about, about + self.turned),
            reset_counter=self.jumps,
            drifts=True,
        )


def _fixes(
    sensor: GnssSensor, truth: Truth, random: np.random.Generator
) -> Iterator[tuple[float, Sample]]:
    for time in np.arange(truth.t[0], truth.t[-1], 1.0 / sensor.rate):
        k = truth.at(time)
        position = truth.p[k] + sensor.position * random.standard_normal(3)
        velocity = truth.v[k] + sensor.velocity * random.standard_normal(3)
        yield (
            time + sensor.latency,
            GnssSample(
                float(time),
                tuple(position.tolist()),
                tuple(velocity.tolist()),
                (sensor.position**2,) * 3,
                (sensor.velocity**2,) * 3,
            ),
        )
