"""How uncertain a sample is: what it states itself, and at least what its sensor can do."""

from __future__ import annotations

from fsw.compiled import compilable
from fsw.estimation.tuning import EstimatorTuning
from fsw.measurements import GnssSample, PoseSample, PressureSample, RangeSample
from fsw.signals import Vec3


@compilable
def believable(variance: Vec3, least: float) -> Vec3:
    """A ``variance`` [any unit, any frame], at least ``least`` [same unit] where it is one."""
    x, y, z = variance
    # NaN and zero mean that the sensor does not know; both fail the comparison.
    return (x if x > least else least, y if y > least else least, z if z > least else least)


class StatedVariance:
    """The variances of samples, with the floors of one tuning."""

    def __init__(self, tuning: EstimatorTuning) -> None:
        self.least_pose = tuning.position_floor**2, tuning.attitude_floor**2  # m^2, rad^2
        self._least_gnss = tuning.gnss_position_floor**2, tuning.gnss_velocity_floor**2
        self._least_pressure = tuning.pressure_floor**2
        self._least_range = tuning.range_floor**2
        self._range_share = tuning.range_share

    def of_pose(self, sample: PoseSample) -> tuple[Vec3, Vec3]:
        """Of position [m^2, NED] and attitude [rad^2, FRD]."""
        least_p, least_q = self.least_pose
        return (
            believable(sample.position_variance, least_p),
            believable(sample.attitude_variance, least_q),
        )

    def of_gnss(self, sample: GnssSample) -> tuple[Vec3, Vec3]:
        """Of position [m^2, NED] and velocity [m^2/s^2, NED]."""
        least_p, least_v = self._least_gnss
        return (
            believable(sample.position_variance, least_p),
            believable(sample.velocity_variance, least_v),
        )

    def of_pressure(self, sample: PressureSample) -> float:
        """Of the altitude [m^2]."""
        return max(sample.variance, self._least_pressure)

    def of_range(self, sample: RangeSample) -> float:
        """Of the distance [m^2]."""
        # What is wrong in proportion stays from one reading to the next, and against a height that
        # satellites know better the filter would explain it by a tilt.
        variance = max(sample.variance, self._least_range)
        return variance + (self._range_share * sample.distance) ** 2
