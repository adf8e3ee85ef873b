"""What lasts of a sensor's error, which the filter cannot see.

The filter takes the errors of its readings for white noise, and is soon surer of its place than one
of them is. But markers are not where they were measured, and satellites' errors wander within
minutes. A clearance must count with all of it. The drift of an odometry is in the filter's
covariance already (``fsw/estimation/drift.py``); of its poses only the noise counts here.

Source: docs/equations.md T7.
"""

from __future__ import annotations

import numpy as np

from fsw.estimation.error_state import Array
from fsw.estimation.sensor_checks import believable
from fsw.estimation.sensor_fusion import FusionMemory
from fsw.estimation.tuning import EstimatorTuning
from fsw.signals import StateEstimate


def lasting_error(memory: FusionMemory, tuning: EstimatorTuning, estimate: StateEstimate) -> Array:
    """Covariance (6, 6) of position [m, NED] and attitude [rad, NED] besides the filter's.

    A whole reading's of the position's source.
    """
    found = np.zeros((6, 6))
    axes = found.ravel()[:15:7]  # the position's variances
    pose, fix = memory.pose, memory.gnss
    if pose is not None:
        place, attitude = pose.position_variance, pose.attitude_variance
        if pose.drifts:
            place, attitude = memory.frame.place_noise, memory.frame.attitude_noise
        turn = np.reshape(estimate.R_WB, (3, 3))
        sides = believable(attitude, tuning.attitude_floor**2)
        found[3:, 3:] = (turn * sides) @ turn.T
        axes[:] = believable(place, tuning.position_floor**2)
    elif fix is not None:
        axes[:] = believable(fix.position_variance, tuning.gnss_position_floor**2)
    return found
