"""What lasts of a sensor's error, which the filter cannot see.

The filter takes the errors of its readings for white noise, and is soon surer of its place than one
of them is. But markers are not where they were measured, satellites' errors wander within minutes,
and odometry on board walks off with its frame. A clearance must count with all of it.

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

    A whole reading's of the position's source, and the drift of its frame since that last jumped.
    """
    found = np.zeros((6, 6))
    pose, fix = memory.pose, memory.gnss
    if pose is not None:
        turn = np.reshape(estimate.R_WB, (3, 3))
        sides = believable(pose.attitude_variance, tuning.attitude_floor**2)
        found[3:, 3:] = (turn * sides) @ turn.T
        found[range(3), range(3)] = believable(pose.position_variance, tuning.position_floor**2)
        if pose.drifts:
            seconds = max(memory.now - memory.frame_since, 0.0)
            found[range(3), range(3)] += tuning.frame_drift**2 * seconds
            # The frame turns about its origin.
            x, y, _ = estimate.p_WB
            swings = np.array((-y, x, 0.0, 0.0, 0.0, 1.0))
            found += tuning.frame_turn**2 * seconds * np.outer(swings, swings)
    elif fix is not None:
        found[range(3), range(3)] = believable(fix.position_variance, tuning.position_floor**2)
    return found
