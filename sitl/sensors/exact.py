"""The suite ``perfect``: the true state in every step, with delay lines and noise where wanted."""

from __future__ import annotations

import math
from collections import deque
from typing import Generic, NamedTuple, TypeVar

from sitl.scenario import V3, Sensors
from sitl.seeds import stream

V4 = tuple[float, float, float, float]
Thrusts = tuple[float, ...]  # (r,) N, of every rotor
T = TypeVar("T")


class SensorReadings(NamedTuple):
    """One sample of every sensor."""

    t_us: int  # µs, time of the sample's delivery
    p_WB: V3  # m, NED
    v_WB: V3  # m/s, NED
    q_WB: V4  # [w, x, y, z], maps B to W
    w_WB_B: V3  # rad/s, B, as motion capture reports it
    gyro_B: V3  # rad/s, B
    accel_B: V3  # m/s², specific force at the base origin, B (at rest: 0, 0, -g)
    q_arm: tuple[float, ...]  # (j,) rad
    qd_arm: tuple[float, ...]  # (j,) rad/s
    tau_arm: tuple[float, ...]  # (j,) N·m, at the drives, before friction
    # (6,) N and N·m, on the tool from outside, about the end-effector, in the axes of the last
    # link; of a vehicle with a sensor for it.
    wrench: tuple[float, ...] = ()


class DelayLine(Generic[T]):
    """Delays samples by a fixed number; before that, returns the first sample."""

    def __init__(self, samples: int) -> None:
        self._line: deque[T] = deque(maxlen=samples + 1)

    def through(self, sample: T) -> T:
        """Store the newest sample, return the delayed one."""
        self._line.append(sample)
        return self._line[0]


class GaussianNoise:
    """Gaussian noise from a stream of its own."""

    def __init__(self, seed: int, *path: str) -> None:
        self._random = stream(seed, "sensor", *path)

    def on(self, values: tuple[float, ...], sigma: float) -> tuple[float, ...]:
        """``values`` with independent noise of standard deviation sigma [unit of the values]."""
        if sigma == 0.0:
            return values
        draws = self._random.standard_normal(len(values))
        return tuple(v + sigma * float(d) for v, d in zip(values, draws, strict=True))


def turned(q: V4, small: tuple[float, ...]) -> V4:
    """Attitude ``q`` followed by the rotation vector ``small`` [rad, B]."""
    x, y, z = small
    angle = math.sqrt(x * x + y * y + z * z)
    if angle == 0.0:
        return q
    s = math.sin(0.5 * angle) / angle
    a, b, c, d = math.cos(0.5 * angle), s * x, s * y, s * z
    w, x, y, z = q
    return (
        w * a - x * b - y * c - z * d,
        w * b + x * a + y * d - z * c,
        w * c - x * d + y * a + z * b,
        w * d + x * c - y * b + z * a,
    )


class ExactSensors:
    """Turns exact readings into measured ones, one call per step.

    Every quantity draws from a stream of its own, so switching one noise on does not change
    another.
    """

    def __init__(self, sensors: Sensors, seed: int, step_us: int) -> None:
        self._sensors = sensors
        self._imu, self._pose, self._encoders = (
            DelayLine[SensorReadings](round(1000.0 * errors.latency_ms / step_us))
            for errors in (sensors.imu, sensors.pose, sensors.encoders)
        )
        self.exact = sensors == Sensors()
        self._noise = {
            name: GaussianNoise(seed, name)
            for name in ("gyro", "accel", "p", "v", "q", "w", "angle", "rate", "torque")
        }

    def measure(self, exact: SensorReadings) -> SensorReadings:
        """The readings delivered at ``exact.t_us``."""
        if self.exact:
            return exact
        imu = self._imu.through(exact)
        pose = self._pose.through(exact)
        arm = self._encoders.through(exact)
        errors, noise = self._sensors, self._noise
        no_turn = (0.0, 0.0, 0.0)
        return SensorReadings(
            t_us=exact.t_us,
            p_WB=_three(noise["p"].on(pose.p_WB, errors.pose.position_m)),
            v_WB=_three(noise["v"].on(pose.v_WB, errors.pose.velocity_m_s)),
            q_WB=turned(pose.q_WB, noise["q"].on(no_turn, errors.pose.attitude_rad)),
            w_WB_B=_three(noise["w"].on(pose.w_WB_B, errors.pose.rate_rad_s)),
            gyro_B=_three(noise["gyro"].on(imu.gyro_B, errors.imu.gyro_rad_s)),
            accel_B=_three(noise["accel"].on(imu.accel_B, errors.imu.accel_m_s2)),
            q_arm=noise["angle"].on(arm.q_arm, errors.encoders.angle_rad),
            qd_arm=noise["rate"].on(arm.qd_arm, errors.encoders.rate_rad_s),
            tau_arm=noise["torque"].on(arm.tau_arm, errors.encoders.torque_n_m),
        )


def _three(values: tuple[float, ...]) -> V3:
    x, y, z = values
    return (x, y, z)
