"""How the filter begins: from a pose, or from a position, gravity and the compass."""

from __future__ import annotations

import math
from functools import reduce
from typing import Final

import numpy as np

from fsw.autopilot.estimation import kernels
from fsw.autopilot.estimation.drift import FrameDrift, least
from fsw.autopilot.estimation.error_state import IMU_CAPACITY, Filter, Law
from fsw.autopilot.estimation.fusion_memory import FusionMemory
from fsw.autopilot.estimation.sensors.gnss import Gnss
from fsw.autopilot.estimation.sensors.magnetometer import Magnetometer
from fsw.autopilot.estimation.sensors.pose import Pose
from fsw.autopilot.estimation.tuning import EstimatorTuning
from fsw.autopilot.geometry.quaternion import normalised
from fsw.autopilot.geometry.rotation import quaternion_from_matrix
from fsw.autopilot.geometry.vectors import ZERO
from fsw.autopilot.measurements import GnssSample, MagneticSample, PoseSample
from fsw.autopilot.signals import Vec3, Vec4
from fsw.frozen import replace

_LOOKED_AT: Final = 16  # samples


class FilterStart:
    """Begins a filter as soon as its samples allow."""

    def __init__(self, tuning: EstimatorTuning, law: Law) -> None:
        self._tuning = tuning
        self._law = law
        self._pose, self._gnss = Pose(tuning.pose), Gnss(tuning.gnss)
        self._magnetometer = Magnetometer(tuning.magnetometer)

    def __call__(self, memory: FusionMemory) -> FusionMemory:
        """Start from the newest pose that another one agrees with, for a first one may be wrong.

        Without poses start from a GNSS position, gravity and the compass.
        """
        if not memory.numbers["end"][0]:
            return replace(memory, waiting=())
        for one in reversed(memory.waiting):
            sample = one.sample
            if isinstance(sample, MagneticSample) and memory.field is None:
                memory = replace(memory, field=sample.field)
        for one in reversed(memory.waiting):
            sample = one.sample
            if isinstance(sample, PoseSample):
                others = [one.sample for one in memory.waiting if one.sample is not sample]
                poses = [other for other in others if isinstance(other, PoseSample)]
                if not any(self._pose.agree(other, sample) for other in poses):
                    continue
                memory = self._from_pose(memory, sample)
                break
            if isinstance(sample, GnssSample) and memory.field is not None:
                self._from_gnss(memory, sample, memory.field)
                break
        else:
            return replace(memory, waiting=memory.waiting[-_LOOKED_AT:])
        return replace(
            memory,
            started=True,
            waiting=(),
            delay_sigma=self._tuning.pose.delay_sigma,
            began=float(memory.numbers["time"][0]),
        )

    def _from_pose(self, memory: FusionMemory, sample: PoseSample) -> FusionMemory:
        stated = self._pose.stated(sample)
        noise = stated
        if sample.drifts:  # of what poses have stated so far the least: the noise alone
            poses = [one.sample for one in memory.waiting if isinstance(one.sample, PoseSample)]
            noise = reduce(least, map(self._pose.stated, poses))
        state = sample.position, ZERO, normalised(sample.attitude)
        self._begin(memory, sample.time, state, *noise)
        if not sample.drifts:
            return memory
        return replace(memory, frame=FrameDrift.at_start(memory.numbers[0], noise, stated))

    def _from_gnss(self, memory: FusionMemory, sample: GnssSample, field: Vec3) -> None:
        x, tuning = memory.numbers, self._tuning
        tilt = tuning.tilt**2
        self._begin(
            memory,
            self._gnss.measured_at(memory, sample),
            (
                sample.position,
                sample.velocity,
                _levelled(x, field, tuning.magnetometer.declination),
            ),
            self._gnss.stated(sample)[0],
            (tilt, tilt, tuning.start_heading**2),
        )
        kernels.couple_level(x, self._law)
        # The heading was made of this field: what it does not know of it, with all of the tilt that
        # it comes through, is what it does not know of the field.
        self._magnetometer.fuse_heading(x, float(x["time"][0]), field, believed=True)

    def _begin(
        self,
        memory: FusionMemory,
        time: float,
        state: tuple[Vec3, Vec3, Vec4],
        p_variance: Vec3,
        q_variance: Vec3,
    ) -> None:
        slow = self._tuning.velocity**2
        variances = p_variance, (slow, slow, slow), q_variance
        kernels.begin(memory.numbers, self._law, time, *state, *variances)


def _levelled(x: Filter, field: Vec3, declination: float) -> Vec4:
    """The attitude in which the accelerometer points up and the compass north.

    True at rest and in unaccelerated flight; the mean of the readings kept so far.
    """
    first, end = int(x["first"][0]), int(x["end"][0])
    rows = x["imu"][0][[k % IMU_CAPACITY for k in range(first, end)]]
    down = -rows[:, 1:4].mean(axis=0)
    down /= np.linalg.norm(down)
    north = np.asarray(field) - down * (down @ np.asarray(field))
    north /= np.linalg.norm(north)
    east = np.cross(down, north)
    c, s = math.cos(declination), math.sin(declination)
    # Rows of the rotation from body to NED: north, east and down in body components.
    R = (*(c * north - s * east), *(s * north + c * east), *down)
    w, i, j, k = quaternion_from_matrix(tuple(float(r) for r in R))  # type: ignore[arg-type]
    return w, i, j, k
