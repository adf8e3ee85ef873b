"""Where base and links of an estimated vehicle are, by rotations of their own."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from fsw.autopilot.model.prediction import Array
from fsw.autopilot.signals import StateEstimate
from tests.fsw.paper_arm import LENGTHS


def placed(estimate: StateEstimate) -> dict[int, tuple[Array, Rotation]]:
    """Origin and attitude of what parts are on: base, link 1, link 2."""
    R_WB = Rotation.from_matrix(np.reshape(estimate.R_WB, (3, 3)))
    first = R_WB * Rotation.from_euler("Y", estimate.q_arm[0])
    second = first * Rotation.from_euler("Y", estimate.q_arm[1])
    p = np.array(estimate.p_WB)
    return {
        0: (p, R_WB),
        1: (p, first),
        2: (p + first.apply([0.0, 0.0, LENGTHS[0]]), second),
    }
