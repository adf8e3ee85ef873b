"""Whether samples that the filter refuses agree with each other: one alone may be wrong.

Two poses agree but for their noise and what a vehicle moves meanwhile. What is refused in flight is
compared by its innovation, which knows how the vehicle has moved: a run of refused samples goes on
where value and direction nearly stay, of which noise makes no long one. How long a run must be
until it is believed grows with how far it would move the estimate.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from fsw.autopilot.estimation.faults.sensor_checks import Aiding
from fsw.autopilot.estimation.measurement_noise import MeasurementNoise
from fsw.autopilot.estimation.tuning import EstimatorTuning
from fsw.autopilot.geometry.quaternion import conjugate, multiply, normalised, rotation_vector
from fsw.autopilot.geometry.vectors import norm
from fsw.autopilot.measurements import GnssSample, PoseSample, PressureSample

# How fast a vehicle moves between two poses.
_SPEED: Final = 2.0  # m/s
_RATE: Final = 2.0  # rad/s
# How fast an innovation changes, because velocity and rate are not known any better, and by which
# share of itself, because an inertial unit that is wrong leads the filter astray ever faster.
_CREEPS: Final = 0.5  # m/s and rad/s
_GROWS: Final = 0.5
_GAINS: Final = 2.0  # m/s^2, of a velocity's
_NO_CHANCE: Final = 3
_APART: Final = 0.25  # s; readings farther apart do not confirm each other
_SELDOM_APART: Final = 1.25  # s; the same of a sensor whose readings come farther apart than that
# How far a run may move and turn the estimate for each second that it lasts, and how far at once if
# the sensor has announced it: it may be wrong in that as well.
_BELIEVED: Final = (1.0, 0.3)  # m/s, rad/s
_ANNOUNCED: Final = (0.5, 0.2)  # m, rad


class Run(NamedTuple):
    """Samples of one kind in a row that were refused and agree; times are those of the samples."""

    kind: type
    since: float  # s
    last: float  # s
    innovation: tuple[float, ...]  # of the last one [SI]
    samples: int = 1

    @property
    def is_confirmed(self) -> bool:
        """Whether a second sample says so."""
        return self.samples > 1

    @property
    def is_no_noise(self) -> bool:
        """Whether so many samples say so that it is no chance."""
        return self.samples >= _NO_CHANCE

    def is_believable(self, least: float, *, announced: bool = False) -> bool:
        """Whether it has lasted for ``least`` [s], and for as long as its size asks for.

        Where the sensor has ``announced`` that it jumps, by little, two samples are enough.
        """
        place = self.innovation[:3] if self.kind in (PoseSample, GnssSample) else ()
        turn = self.innovation[3:] if self.kind is PoseSample else ()
        sizes = [math.hypot(*place), math.hypot(*turn)]
        if announced:
            least = 0.0
            if all(size <= most for size, most in zip(sizes, _ANNOUNCED, strict=True)):
                sizes = [0.0, 0.0]
        takes = [size / speed for size, speed in zip(sizes, _BELIEVED, strict=True)]
        return self.is_confirmed and self.last - self.since >= max(least, *takes)


class Confirmation:
    """Compares samples, but for their noise."""

    def __init__(self, tuning: EstimatorTuning, stated: MeasurementNoise) -> None:
        self._tuning = tuning
        self._stated = stated

    def of_poses(self, one: PoseSample, other: PoseSample) -> bool:
        """Whether two poses say the same."""
        place, about = self._stated.of_pose(one)
        apart = abs(one.time - other.time)
        gate = self._tuning.pose_gate * math.sqrt(2.0)
        turn = rotation_vector(
            multiply(conjugate(normalised(one.attitude)), normalised(other.attitude))
        )
        step = gate * math.sqrt(sum(place)) + _SPEED * apart
        angle = gate * math.sqrt(sum(about)) + _RATE * apart
        return math.dist(one.position, other.position) <= step and norm(turn) <= angle

    def run(
        self,
        runs: tuple[Run, ...],
        sample: Aiding,
        innovation: tuple[float, ...],
        scales: tuple[float, ...],
        seldom: bool,
    ) -> Run:
        """The run that a refused ``sample`` goes on with, or begins.

        Its ``innovation`` [SI], and by how much its variances are larger than stated, ``scales``
        [1, 1]. A sensor is heard ``seldom`` if its readings come more than 0.25 s apart.
        """
        kind, new = type(sample), Run(type(sample), sample.time, sample.time, innovation)
        for one in runs:
            apart = sample.time - one.last
            if one.kind is not kind or apart > (_SELDOM_APART if seldom else _APART):
                continue
            rooms = self._rooms(sample, scales, apart)
            parts = zip(
                (one.innovation[:3], one.innovation[3:]), (innovation[:3], innovation[3:]), rooms,
                strict=False,
            )  # fmt: skip
            if all(math.dist(a, b) <= room + _GROWS * math.hypot(*a) for a, b, room in parts):
                return Run(kind, one.since, sample.time, innovation, one.samples + 1)
        return new

    def _rooms(self, sample: Aiding, scales: tuple[float, ...], apart: float) -> tuple[float, ...]:
        """By how much two innovations may differ that are ``apart`` [s]."""
        gates = self._tuning
        match sample:
            case PoseSample():
                (place, about), gate = self._stated.of_pose(sample), gates.pose_gate
                return (
                    gate * math.sqrt(2.0 * scales[0] * max(place)) + _CREEPS * apart,
                    gate * math.sqrt(2.0 * scales[1] * max(about)) + _CREEPS * apart,
                )
            case GnssSample():
                place, speed = self._stated.of_gnss(sample)
                return (
                    gates.gnss_position_gate * math.sqrt(2.0 * scales[0] * max(place))
                    + _CREEPS * apart,
                    gates.gnss_velocity_gate * math.sqrt(2.0 * scales[1] * max(speed))
                    + _GAINS * apart,
                )
            case PressureSample():
                noise = math.sqrt(2.0 * self._stated.of_pressure(sample))
                return (gates.pressure_gate * noise + _SPEED * apart,)
            case _:
                return (0.0,)
