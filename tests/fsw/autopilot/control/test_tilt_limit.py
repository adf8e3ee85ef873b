"""Whatever a loop wants, the body neither tilts nor turns beyond its limits."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fsw.autopilot.control.tilt_limit import limited_turn
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.signals import Vec3
from tests.fsw.random_states import estimate_of, vec3

DT = 0.002
STILL = (0.0, 0.0)


def flown(
    wanted: list[Vec3], lag: float, seconds: float = 1.5, left: float = 1.0
) -> tuple[float, float, float]:
    """Largest tilt, roll and pitch rate, and yaw rate, the rotors following with a lag."""
    R_WB, w, wd = Rotation.identity(), np.zeros(3), np.zeros(3)
    largest = np.zeros(3)
    for k in range(round(seconds / DT)):
        estimate = estimate_of(R_WB, vec3(w))
        turning = float(wd[0]), float(wd[1])
        sent = limited_turn(AIRFRAME, estimate, turning, wanted[k % len(wanted)], left)
        wd = wd + (1.0 - math.exp(-DT / lag)) * (np.array(sent) - wd)
        R_WB = R_WB * Rotation.from_rotvec(DT * w)
        w = w + DT * wd
        tilt = math.acos(min(R_WB.as_matrix()[2, 2], 1.0))
        largest = np.maximum(largest, (tilt, math.hypot(w[0], w[1]), abs(w[2])))
    return float(largest[0]), float(largest[1]), float(largest[2])


@pytest.mark.drawn(4)
@pytest.mark.requirement("REQ-ACT-8")
@pytest.mark.parametrize("direction", np.linspace(0.0, 2.0 * math.pi, 8, endpoint=False))
@pytest.mark.parametrize("hard", [6.0, 17.0])
def test_a_loop_that_always_wants_more_tilt_gets_no_more_than_the_limit(
    direction: float, hard: float
) -> None:
    wish = (hard * math.cos(direction), hard * math.sin(direction), 0.3)
    tilt, rate, _ = flown([wish], AIRFRAME.rotor_lag)
    assert 0.9 * AIRFRAME.tilt_max < tilt < AIRFRAME.tilt_max + math.radians(0.5)
    assert rate < AIRFRAME.body_rate_max[0] + 0.1


@pytest.mark.parametrize("left", [0.25, 0.5, 0.8])
def test_a_vehicle_that_has_lost_torque_tilts_by_that_share(left: float) -> None:
    """With one rotor that did not obey it swung farther and farther, into a wall."""
    tilt, _, _ = flown([(6.0, 0.0, 0.0)], AIRFRAME.rotor_lag, left=left)
    assert 0.9 * left * AIRFRAME.tilt_max < tilt < left * AIRFRAME.tilt_max + math.radians(0.5)


@pytest.mark.requirement("REQ-ACT-8")
def test_body_rates_keep_their_limits_where_there_is_room_to_tilt() -> None:
    roomy = replace(AIRFRAME, tilt_max=3.0)
    w, estimate = np.zeros(3), estimate_of(Rotation.identity())
    for _ in range(1000):
        estimate = estimate_of(Rotation.identity(), vec3(w))
        w = w + DT * np.array(limited_turn(roomy, estimate, STILL, (17.0, -17.0, 4.0), 1.0))
    most, most_yaw = AIRFRAME.body_rate_max
    assert math.hypot(w[0], w[1]) == pytest.approx(most, rel=1e-3)
    assert w[2] == pytest.approx(most_yaw, rel=1e-3)


def test_random_wishes_stay_within_all_limits() -> None:
    random = np.random.default_rng(4)
    wishes = [vec3(wish) for wish in np.repeat(random.uniform(-17.0, 17.0, (60, 3)), 25, axis=0)]
    tilt, rate, yaw_rate = flown(wishes, AIRFRAME.rotor_lag, 3.0)
    assert tilt < AIRFRAME.tilt_max + math.radians(0.5)
    assert rate < AIRFRAME.body_rate_max[0] + 0.1
    assert yaw_rate < AIRFRAME.body_rate_max[1] + 0.3


def test_what_needs_no_limit_passes_as_it_is() -> None:
    leaning = estimate_of(Rotation.from_euler("ZYX", (1.0, 0.15, -0.1)), (0.5, -0.4, 0.1))
    for wish in ((5.0, -4.0, 0.2), (-8.0, 3.0, -0.1), (0.0, 0.0, 0.0)):
        assert limited_turn(AIRFRAME, leaning, STILL, wish, 1.0) == wish
    back = estimate_of(Rotation.from_euler("Y", 0.5))
    assert limited_turn(AIRFRAME, back, STILL, (0.0, -15.0, 0.0), 1.0) == (0.0, -15.0, 0.0)
