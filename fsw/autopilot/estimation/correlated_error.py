"""What lasts of a sensor's error, which the filter cannot see.

The filter takes the errors of its readings for white noise, and is soon surer of its place than one
of them is. But markers are not where they were measured, and satellites' errors wander within
minutes. A clearance must count with all of it. The drift of an odometry is in the filter's
covariance already (``fsw/autopilot/estimation/drift.py``); of its poses only the noise counts here.
So is the offset of a magnetometer (``sensors/magnetometer.py``): beside satellites,
nothing of the attitude is added.

Source: docs/equations.md T7.
"""

from __future__ import annotations

import math

from fsw.autopilot.estimation.fusion import believable
from fsw.autopilot.estimation.fusion_memory import FusionMemory
from fsw.autopilot.estimation.tuning import EstimatorTuning
from fsw.autopilot.estimation.turned_covariance import Vec6
from fsw.autopilot.measurements import Sensor

_NONE: Vec6 = (0.0,) * 6
_LASTING = 0.25  # of the least deviation of a pose: most of that is noise


def correlated_error(memory: FusionMemory, tuning: EstimatorTuning) -> Vec6:
    """Variances of position [m^2, NED] and attitude [rad^2, FRD] besides the filter's.

    Those of a whole reading of the position's source.
    """
    pose, fix = memory.pose, memory.gnss
    if fix is not None and (
        pose is None or _used(memory, Sensor.GNSS) > _used(memory, Sensor.POSE)
    ):
        return *believable(fix.position_variance, tuning.gnss.position_floor**2), 0.0, 0.0, 0.0
    if pose is not None:
        place, attitude = pose.position_variance, pose.attitude_variance
        if pose.drifts:
            place, attitude = memory.frame.place_noise, memory.frame.attitude_noise
        return (
            *believable(place, (_LASTING * tuning.pose.position_floor) ** 2),
            *believable(attitude, tuning.pose.attitude_floor**2),
        )
    return _NONE


def _used(memory: FusionMemory, sensor: Sensor) -> float:
    """When a position of a sensor was used last [s]."""
    fused = memory.of(sensor).fused
    return fused[0] if fused else -math.inf
