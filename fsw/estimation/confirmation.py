"""Whether two samples of a kind say the same: one alone may be wrong."""

from __future__ import annotations

import math
from typing import Final

from fsw.estimation.fusion_memory import FusionMemory, Waiting
from fsw.estimation.sensor_checks import SENSOR_OF, Aiding
from fsw.estimation.stated_variance import StatedVariance
from fsw.estimation.tuning import EstimatorTuning
from fsw.geometry.quaternion import conjugate, multiply, normalised, rotation_vector
from fsw.geometry.vectors import norm
from fsw.measurements import GnssSample, PoseSample, PressureSample

_SPEED: Final = 2.0  # m/s and rad/s, with which a vehicle moves between two poses
_RATE: Final = 2.0
_STRONGEST: Final = 20.0  # m/s^2, with which it does so between two velocities
_APART: Final = 0.25  # s; readings farther apart do not confirm each other
_SELDOM_APART: Final = 1.25  # s; the same of a sensor whose readings come farther apart than that


class Confirmation:
    """Compares samples, but for their noise and what a vehicle moves meanwhile."""

    def __init__(self, tuning: EstimatorTuning, stated: StatedVariance) -> None:
        self._tuning = tuning
        self._stated = stated

    def has_second(self, pose: PoseSample, waiting: tuple[Waiting, ...]) -> bool:
        """Whether another pose among those that wait says the same."""
        others = [one.sample for one in waiting if isinstance(one.sample, PoseSample)]
        return any(other is not pose and self._of_poses(other, pose) for other in others)

    def is_confirmed(self, memory: FusionMemory, sample: Aiding) -> bool:
        """Whether the last one of its kind that was refused too says what a ``sample`` does."""
        seldom = memory.of(SENSOR_OF[type(sample)]).apart >= _APART
        for one in memory.refused:
            if sample.time - one.time > (_SELDOM_APART if seldom else _APART):
                continue
            if isinstance(sample, PoseSample) and isinstance(one, PoseSample):
                return self._of_poses(one, sample)
            if isinstance(sample, GnssSample) and isinstance(one, GnssSample):
                return self._of_fixes(one, sample)
            if isinstance(sample, PressureSample) and isinstance(one, PressureSample):
                return self._of_altitudes(one, sample)
        return False

    def _of_poses(self, one: PoseSample, other: PoseSample) -> bool:
        place, about = self._stated.of_pose(one)
        apart = abs(one.time - other.time)
        gate = self._tuning.pose_gate * math.sqrt(2.0)
        turn = rotation_vector(
            multiply(conjugate(normalised(one.attitude)), normalised(other.attitude))
        )
        step = gate * math.sqrt(sum(place)) + _SPEED * apart
        angle = gate * math.sqrt(sum(about)) + _RATE * apart
        return math.dist(one.position, other.position) <= step and norm(turn) <= angle

    def _of_fixes(self, one: GnssSample, other: GnssSample) -> bool:
        place, speed = self._stated.of_gnss(one)
        apart, gates = abs(one.time - other.time), self._tuning
        step = gates.gnss_position_gate * math.sqrt(2.0 * sum(place)) + _SPEED * apart
        change = gates.gnss_velocity_gate * math.sqrt(2.0 * sum(speed)) + _STRONGEST * apart
        near = math.dist(one.position, other.position) <= step
        return near and math.dist(one.velocity, other.velocity) <= change

    def _of_altitudes(self, one: PressureSample, other: PressureSample) -> bool:
        step = _SPEED * (other.time - one.time)
        step += self._tuning.pressure_gate * math.sqrt(2.0 * self._stated.of_pressure(other))
        return abs(other.altitude - one.altitude) <= step
