"""What the filter makes of a sample of each kind: fused, or taken as it is after a jump."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

from fsw.autopilot.estimation import fusion, kernels
from fsw.autopilot.estimation.faults.sensor_checks import Aiding
from fsw.autopilot.estimation.fusion_memory import NO_TURN, FusionMemory, Waiting
from fsw.autopilot.estimation.measurement_noise import MeasurementNoise
from fsw.autopilot.estimation.tuning import EstimatorTuning
from fsw.autopilot.geometry.quaternion import conjugate, multiply, normalised
from fsw.autopilot.measurements import (
    GnssSample,
    MagneticSample,
    PoseSample,
    PressureSample,
    RangeSample,
)
from fsw.autopilot.signals import Vec3, Vec4

_STEADY: Final = 0.5  # s without a refused reading, until a magnetometer is believed again
_REST: Vec3 = (0.0, 0.0, 0.0)
_UNKNOWN: Vec3 = (math.inf, math.inf, math.inf)


class MeasurementUpdate:
    """Changes a memory's filter by samples whose time it has."""

    def __init__(self, tuning: EstimatorTuning, law: Any, stated: MeasurementNoise) -> None:
        self._law = law
        self._stated = stated
        self._pose_delay, self._gnss_delay = tuning.pose_delay, tuning.gnss_delay
        self._fuse: dict[type, Callable[[FusionMemory, Any], tuple[float, ...]]] = {
            GnssSample: self._fuse_gnss,
            PressureSample: self._fuse_pressure,
            MagneticSample: self._fuse_heading,
            RangeSample: self._fuse_range,
        }

    def fuse(self, memory: FusionMemory, one: Waiting) -> tuple[float, ...]:
        """Fuse a sample; returns chi-square over gate of each of its parts, above 1 if refused.

        Infinite where it says nothing at present.
        """
        if isinstance(one.sample, PoseSample):
            return self.fuse_pose(memory, one.sample, half=one.half)
        return self._fuse[type(one.sample)](memory, one.sample)

    def fuse_pose(
        self, memory: FusionMemory, sample: PoseSample, *, half: bool
    ) -> tuple[float, ...]:
        """The same of a pose: position, attitude. Of ``half`` a pose the place is fused alone."""
        place, about = self.noise(memory, sample)
        return fusion.fuse_pose(
            memory.numbers,
            self._law,
            sample.time,
            sample.position,
            normalised(sample.attitude),
            place,
            _UNKNOWN if half else about,
        )

    def measured_at(self, memory: FusionMemory, sample: Aiding) -> float:
        """When a ``sample`` was measured [s]: its time stamp, less what that leaves out."""
        if isinstance(sample, PoseSample):
            delay = float(memory.numbers["pose_delay"][0])
            return sample.time - (delay if memory.started else self._pose_delay)
        return sample.time - (self._gnss_delay if isinstance(sample, GnssSample) else 0.0)

    def noise(self, memory: FusionMemory, sample: PoseSample) -> tuple[Vec3, Vec3]:
        """Variances [m^2, NED] and [rad^2, FRD] of a pose in its own frame."""
        if sample.drifts:
            return memory.frame.place_noise, memory.frame.attitude_noise
        return self._stated.of_pose(sample)

    def take(self, memory: FusionMemory, one: Waiting, ratio: tuple[float, ...]) -> FusionMemory:
        """The memory after parts that the gate refused for long, by ``ratio``, are as measured."""
        x, sample = memory.numbers, one.sample
        place, velocity, turn = _REST, _REST, NO_TURN
        if isinstance(sample, PoseSample):
            about_place, about = self.noise(memory, sample)
            if ratio[0] > 1.0:
                place = kernels.set_place(x, one.time, sample.position, about_place)
            if 1.0 < ratio[1] < math.inf:
                before = attitude(x[0])
                after = normalised(sample.attitude)
                kernels.set_attitude(x, after, about)
                turn = multiply(after, conjugate(before))
        elif isinstance(sample, GnssSample):
            about_place, about_speed = self._stated.of_gnss(sample)
            if ratio[0] > 1.0:
                place = kernels.set_place(x, one.time, sample.position, about_place)
            if ratio[1] > 1.0:
                velocity = kernels.set_velocity(x, sample.velocity, about_speed)
        else:
            if isinstance(sample, PressureSample):
                self.take_pressure(memory, one.time, sample)
            return memory
        return memory.jumped(place, velocity, turn)

    def take_pressure(self, memory: FusionMemory, time: float, sample: PressureSample) -> None:
        """Explain an altitude of ``time`` [s] by the weather: the vehicle has not moved."""
        variance = self._stated.of_pressure(sample)
        kernels.set_pressure(memory.numbers, time, sample.altitude, variance)

    def _fuse_gnss(self, memory: FusionMemory, sample: GnssSample) -> tuple[float, ...]:
        return fusion.fuse_gnss(
            memory.numbers,
            self._law,
            sample.time - self._gnss_delay,
            sample.position,
            sample.velocity,
            *self._stated.of_gnss(sample),
        )

    def _fuse_pressure(self, memory: FusionMemory, sample: PressureSample) -> tuple[float, ...]:
        x, variance = memory.numbers, self._stated.of_pressure(sample)
        return (fusion.fuse_pressure(x, self._law, sample.time, sample.altitude, variance),)

    def _fuse_heading(self, memory: FusionMemory, sample: MagneticSample) -> tuple[float, ...]:
        # Garbage is within the gate now and then.
        believed = not any(
            one.kind is MagneticSample and sample.time - one.last < _STEADY for one in memory.runs
        )
        x, law = memory.numbers, self._law
        return (fusion.fuse_heading(x, law, sample.time, sample.field, believed),)

    def _fuse_range(self, memory: FusionMemory, sample: RangeSample) -> tuple[float, ...]:
        x, variance = memory.numbers, self._stated.of_range(sample)
        return (fusion.fuse_range(x, self._law, sample.time, sample.distance, variance),)


def attitude(x: Any) -> Vec4:
    """The attitude [w, x, y, z] of a filter's record."""
    w, i, j, k = x["q"].tolist()
    return w, i, j, k
