"""Between two sensor frames the state moves by its own rates."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fsw.autopilot.estimation.dead_reckoning import moved_on
from fsw.autopilot.model.airframe import GRAVITY
from tests.fsw.random_states import random_estimate


def test_a_body_that_turns_and_accelerates_is_where_it_will_be() -> None:
    random, t = np.random.default_rng(3), 0.01
    for _ in range(20):
        x = random_estimate(random, tilt=0.5)
        later = moved_on(x, t)
        R = Rotation.from_matrix(np.reshape(x.R_WB, (3, 3)))
        a = R.apply([0.0, 0.0, -x.specific_force]) + [0.0, 0.0, GRAVITY]
        turned = R * Rotation.from_rotvec(t * np.array(x.w_WB_B))
        assert np.reshape(later.R_WB, (3, 3)) == pytest.approx(turned.as_matrix(), abs=1e-12)
        assert later.v_WB == pytest.approx(x.v_WB + t * a, abs=1e-12)
        assert later.p_WB == pytest.approx(x.p_WB + t * np.array(x.v_WB) + 0.5 * t * t * a)
        assert later.q_arm == pytest.approx(np.array(x.q_arm) + t * np.array(x.qd_arm))
        assert later.yaw == pytest.approx(math.atan2(later.R_WB[3], later.R_WB[0]))
        assert (later.w_WB_B, later.qd_arm, later.t_us) == (x.w_WB_B, x.qd_arm, x.t_us)


def test_no_time_changes_nothing() -> None:
    x = random_estimate(np.random.default_rng(1), tilt=0.2)._replace(w_WB_B=(0.0, 0.0, 0.0))
    assert moved_on(x, 0.0)._replace(yaw=x.yaw) == x
