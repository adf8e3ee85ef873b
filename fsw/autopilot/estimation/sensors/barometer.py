"""Barometer: a height, but for the weather."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fsw.autopilot.estimation.error_state import BARO, ERRORS, FIELD, Filter, P, V
from fsw.autopilot.estimation.fusion import clear, judged
from fsw.autopilot.estimation.fusion_memory import FusionMemory
from fsw.autopilot.estimation.sensors.base import (
    PLACE_LIMIT,
    AidingSensor,
    LogField,
    LogTopic,
    Ratios,
    chi_square,
)
from fsw.autopilot.measurements import PressureSample, Sensor
from fsw.compiled import compilable, kernel, machine_code


@dataclass(frozen=True, slots=True)
class BarometerTuning:
    """What a barometer is taken for."""

    floor: float = 0.2  # m, the least standard deviation: noise of a small one, 0.1 m, and gusts
    gate: float = 5.0  # standard deviations; farther from what is expected is not fused
    bias: float = 3.0  # m, a standard deviation of what is not known when the filter starts
    bias_walk: float = 0.03  # m/s/sqrt(Hz)


class Barometer(AidingSensor[PressureSample, BarometerTuning]):
    """Its bias, the weather, is a state of the filter."""

    sensor = Sensor.BAROMETER
    sample = PressureSample
    measures = ("altitude",)
    at_rest = PressureSample(0.0, 0.0, 1.0)
    repeats = 40
    changes = (2.0,)  # m/s
    starts_anywhere = True
    status_bit = 0x8
    ratios = (("height",),)
    innovations = (("baro_vpos", 0, "m"),)
    topic = LogTopic(
        "vehicle_air_data",
        "Barometer",
        (LogField("baro_alt_meter", "m above the origin of the local frame"),
         LogField("variance", "m^2")),
    )  # fmt: skip
    parameters = (
        ("EKF2_BARO_NOISE", "floor", "m", 0.01, 15.0,
         "Barometer: least standard deviation of the height"),
        ("EKF2_BARO_GATE", "gate", "SD", 1.0, 20.0, "Barometer: gate"),
    )  # fmt: skip

    def is_plausible(self, sample: PressureSample) -> bool:
        """Below the stratosphere."""
        return abs(sample.altitude) < 10.0 * PLACE_LIMIT

    def fuse(self, memory: FusionMemory, sample: PressureSample, half: bool) -> Ratios:
        """As a height."""
        gate, ((variance,),) = chi_square(self.tuning.gate, 1), self.stated(sample)
        return (fuse_pressure(memory.numbers, gate, sample.time, sample.altitude, variance),)

    def take(
        self, memory: FusionMemory, sample: PressureSample, time: float, ratio: Ratios
    ) -> FusionMemory:
        """Explain an altitude of ``time`` [s] by the weather: the vehicle has not moved."""
        ((variance,),) = self.stated(sample)
        set_pressure(memory.numbers, time, sample.altitude, variance)
        return memory

    def stated(self, sample: PressureSample) -> tuple[tuple[float]]:
        """Of the altitude [m^2]."""
        return ((max(sample.variance, self.tuning.floor**2),),)


@compilable
def pressure_rows(x: Any, altitude: float, variance: float, dt: float) -> None:
    """The row of an ``altitude`` [m, up] of ``variance`` [m^2], ``dt`` [s] after the state."""
    clear(x, 1)
    x.residual[0] = altitude - (-(x.p[2] + dt * x.v[2]) + x.baro_bias)
    x.H[0, P + 2] = -1.0
    x.H[0, V + 2] = -dt
    x.H[0, BARO] = 1.0
    x.variance[0] = variance


@machine_code
@kernel
def fuse_pressure(
    filters: Filter, gate: float, time: float, altitude: float, variance: float
) -> float:
    """Fuse an ``altitude`` [m, up] of ``time`` [s], ``variance`` [m^2]; ``gate`` [1] squared."""
    x = filters[0]
    pressure_rows(x, altitude, variance, time - x.time)
    return judged(x, 1, gate)


@machine_code
@kernel
def set_pressure(x: Filter, time: float, altitude: float, variance: float) -> None:
    """Explain an ``altitude`` [m, up] of ``time`` [s], ``variance`` [m^2], by the bias."""
    s = x[0]
    s.baro_bias = altitude + s.p[2] + (time - s.time) * s.v[2]
    s.shared[BARO, :] = 0.0
    for j in range(FIELD):
        s.with_offset[BARO, j] = s.with_offset[P + 2, j]
    for j in range(ERRORS):  # what is wrong with the height is in it
        s.covariance[BARO, j] = s.covariance[P + 2, j]
        s.covariance[j, BARO] = s.covariance[j, P + 2]
    s.covariance[BARO, BARO] = s.covariance[P + 2, P + 2] + variance
