"""Rangefinder: the distance to level ground, along the body's z."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

from fsw.autopilot.estimation.error_state import TH, Filter, Law, P, V
from fsw.autopilot.estimation.fusion import clear, judged
from fsw.autopilot.estimation.fusion_memory import FusionMemory
from fsw.autopilot.estimation.sensors.base import (
    AidingSensor,
    LogField,
    LogTopic,
    Ratios,
    chi_square,
)
from fsw.autopilot.geometry.rotation import matrix_from_quaternion
from fsw.autopilot.geometry.vectors import four
from fsw.autopilot.measurements import RangeSample, Sensor
from fsw.compiled import compilable, kernel, machine_code

_FARTHEST: Final = 200.0  # m


@dataclass(frozen=True, slots=True)
class RangefinderTuning:
    """What a rangefinder is taken for."""

    floor: float = 0.01  # m, the least standard deviation that it is believed, or its own
    share: float = 0.05  # of the distance, besides: EKF2_RNG_SFE of PX4
    gate: float = 5.0  # standard deviations; farther from what is expected is not fused
    ground: float = 0.0  # m, NED z of what it measures against


class Rangefinder(AidingSensor[RangeSample, RangefinderTuning]):
    """It measures the height alone."""

    sensor = Sensor.RANGEFINDER
    sample = RangeSample
    measures = ("distance",)
    at_rest = RangeSample(0.0, 1.0, 1.0)
    repeats = 40
    status_bit = 0x100
    ratios = (("above_ground",),)
    innovations = (("rng_vpos", 0, "m"),)
    topic = LogTopic(
        "distance_sensor",
        "Distance to what is below",
        (LogField("current_distance", "m"), LogField("variance", "m^2")),
    )
    parameters = (
        ("EKF2_RNG_NOISE", "floor", "m", 0.01, 10.0, "Rangefinder: least standard deviation"),
        ("EKF2_RNG_SFE", "share", "m/m", 0.0, 0.2,
         "Rangefinder: standard deviation in proportion to the distance"),
        ("EKF2_RNG_GATE", "gate", "SD", 1.0, 20.0, "Rangefinder: gate"),
    )  # fmt: skip

    def is_plausible(self, sample: RangeSample) -> bool:
        """One that light comes back from."""
        return 0.0 < sample.distance < _FARTHEST

    def fuse(self, memory: FusionMemory, sample: RangeSample, half: bool) -> Ratios:
        """As a height."""
        x, law, gate = memory.numbers, self.law, chi_square(self.tuning.gate, 1)
        # What is wrong in proportion stays from one reading to the next, and against a height that
        # satellites know better the filter would explain it by a tilt.
        variance = max(sample.variance, self.tuning.floor**2)
        variance += (self.tuning.share * sample.distance) ** 2
        # By as much as jumps have moved the height that nobody else confirms it may be off: against
        # a place that has just been taken it would make a velocity of that.
        variance += memory.unproven[2] ** 2
        return (fuse_range(x, law, gate, sample.time, sample.distance, variance),)


@compilable
def range_rows(x: Any, law: Any, measured: float, variance: float, dt: float) -> bool:
    """The row of a ``measured`` [m] distance to level ground, ``dt`` [s] after the state.

    ``variance`` [m^2]. False where the vehicle is tilted by more than 45 degrees. It measures the
    height alone: what is not known of the tilt is noise. Over a tilt, a distance that is off would
    tilt the estimate, and the more, the more that is tilted already.
    """
    clear(x, 1)
    R = matrix_from_quaternion(four(x.q))
    if not R[8] > math.sqrt(0.5):
        return False
    expected = (law.ground - (x.p[2] + dt * x.v[2])) / R[8]
    x.residual[0] = measured - expected
    x.H[0, P + 2] = -1.0 / R[8]
    x.H[0, V + 2] = -dt / R[8]
    # R33 changes by R31 dtheta_y - R32 dtheta_x.
    by_roll, by_pitch = expected * R[7] / R[8], expected * R[6] / R[8]
    M = x.covariance
    tilt = by_roll * by_roll * M[TH, TH] + by_pitch * by_pitch * M[TH + 1, TH + 1]
    x.variance[0] = variance + tilt
    return True


@machine_code
@kernel
def fuse_range(
    filters: Filter, laws: Law, gate: float, time: float, measured: float, variance: float
) -> float:
    """Fuse a ``measured`` [m] distance to level ground of ``time`` [s] and ``variance`` [m^2].

    ``gate`` [1] is a chi-square.
    """
    x = filters[0]
    if not range_rows(x, laws[0], measured, variance, time - x.time):
        x.innovation[0, 0] = 0.0
        return math.inf
    return judged(x, 1, gate)
