"""How uncertain a sample is: what it states itself, and at least what its sensor can do."""

from __future__ import annotations

import math
from typing import Final

from fsw.autopilot.estimation.tuning import EstimatorTuning
from fsw.autopilot.measurements import GnssSample, PoseSample, PressureSample, RangeSample
from fsw.autopilot.signals import Vec3
from fsw.compiled import compilable

# Of how a variance follows the noise that there is with each measurement, and by at most so much.
_RATE: Final = 0.06
_MOST: Final = 6.0


@compilable
def believable(variance: Vec3, least: float) -> Vec3:
    """A ``variance`` [any unit, any frame], at least ``least`` [same unit] where it is one."""
    x, y, z = variance
    # NaN and zero mean that the sensor does not know; both fail the comparison.
    return (x if x > least else least, y if y > least else least, z if z > least else least)


@compilable
def followed(scale: float, squared: float, start: float) -> float:
    """By how much variances are larger than stated, after a measurement; ``scale`` [1] before it.

    ``squared`` [1] is the square of by how much its innovation differs from the last one, over the
    variance of an innovation. Beyond twice ``start`` [1] they grow.
    """
    grown: float = max(scale, 1.0) * math.exp(_RATE * (min(0.5 * squared, _MOST) - start))
    return max(grown, 1.0)


class MeasurementNoise:
    """The variances of samples, with the floors of one tuning."""

    def __init__(self, tuning: EstimatorTuning) -> None:
        self.min_pose = tuning.position_floor**2, tuning.attitude_floor**2  # m^2, rad^2
        self._min_gnss = tuning.gnss_position_floor**2, tuning.gnss_velocity_floor**2
        self._min_pressure = tuning.pressure_floor**2
        self._min_range = tuning.range_floor**2
        self._range_share = tuning.range_share

    def of_pose(self, sample: PoseSample) -> tuple[Vec3, Vec3]:
        """Of position [m^2, NED] and attitude [rad^2, FRD]."""
        min_p, min_q = self.min_pose
        return (
            believable(sample.position_variance, min_p),
            believable(sample.attitude_variance, min_q),
        )

    def of_gnss(self, sample: GnssSample) -> tuple[Vec3, Vec3]:
        """Of position [m^2, NED] and velocity [m^2/s^2, NED]."""
        min_p, min_v = self._min_gnss
        return (
            believable(sample.position_variance, min_p),
            believable(sample.velocity_variance, min_v),
        )

    def of_pressure(self, sample: PressureSample) -> float:
        """Of the altitude [m^2]."""
        return max(sample.variance, self._min_pressure)

    def of_range(self, sample: RangeSample) -> float:
        """Of the distance [m^2]."""
        # What is wrong in proportion stays from one reading to the next, and against a height that
        # satellites know better the filter would explain it by a tilt.
        variance = max(sample.variance, self._min_range)
        return variance + (self._range_share * sample.distance) ** 2
