"""Whatever is wanted of the joints, they are asked for what is within their limits."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fsw.autopilot.control.gains import LoopGains
from fsw.autopilot.control.joint_reference import (
    APPROACH,
    JointReferenceLimits,
    braking_rate,
)
from fsw.autopilot.model.airframe import AIRFRAME, GRAVITY
from fsw.autopilot.model.arm_coordinates import arm_coordinates, within_limits
from fsw.autopilot.mpc.qp_data import InputLimits
from fsw.autopilot.signals import JointVector, StateEstimate
from tests.fsw.records import joint_reference, placed, torques_for
from tests.paper_vehicle import ROTOR_ARM

LIMITS = JointReferenceLimits()
ARM = arm_coordinates(AIRFRAME)
DT = 0.002
REST: JointVector = (0.0, 0.0)
ANGLES = st.tuples(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0))
RATES = st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
# Where a wish is, how it moves, and for how many ticks it does.
WISHES = st.lists(st.tuples(ANGLES, st.just(REST) | RATES, st.integers(1, 120)), max_size=6)
ROUNDING = 1e-9

Reference = tuple[JointVector, JointVector]


def bounds(limits: JointReferenceLimits) -> tuple[float, float]:
    """The largest angle of either link [rad] that a reference may have."""
    return ARM.high[0] - limits.margin, ARM.high[1] - limits.margin


def links(joints: JointVector) -> JointVector:
    return joints[0], joints[0] + joints[1]


def assert_within(last: Reference, now: Reference, limits: JointReferenceLimits, dt: float) -> None:
    """``now`` keeps every limit, and its rates are how it came there from ``last``."""
    (q, qd), first_and_both = now, bounds(limits)
    for angle, rate, before, bound in zip(
        links(q), links(qd), links(last[1]), first_and_both, strict=True
    ):
        assert abs(angle) <= bound + ROUNDING
        assert abs(rate - before) <= limits.acceleration * dt + ROUNDING
        # In the time of the approach it does not get to its bound: the joint loop follows later.
        assert (
            abs(angle + APPROACH * rate) <= bound + ROUNDING
            or abs(rate) > 0.99 * limits.acceleration * APPROACH
        )
    assert max(map(abs, qd)) <= limits.rate + ROUNDING
    assert np.subtract(q, last[0]) / dt == pytest.approx(np.array(qd), abs=1e-6)


@pytest.mark.requirement("REQ-ACT-8")
@given(ANGLES, WISHES, st.floats(20.0, 200.0), st.floats(0.5, 5.0), st.sampled_from((1, 1, 1, 5)))
@settings(max_examples=60)
def test_no_wish_leads_out_of_the_limits_in_angle_rate_or_acceleration(
    start: JointVector,
    wishes: list[tuple[JointVector, JointVector, int]],
    acceleration: float,
    rate: float,
    ticks: int,
) -> None:
    limits = replace(LIMITS, acceleration=acceleration, rate=rate)
    now = (within_limits(ARM, start, limits.margin), REST)
    for q, qd, times in wishes:
        for k in range(times):
            moved = (q[0] + k * DT * qd[0], q[1] + k * DT * qd[1])
            last = now
            now = joint_reference(AIRFRAME, limits, last, (moved, qd), ticks * DT)
            assert_within(last, now, limits, ticks * DT)


def test_a_wish_that_reverses_at_once_is_braked_and_followed_with_the_acceleration() -> None:
    """A new plan after an estimate has jumped: before, 1 rad/s became -3.5 in one tick."""
    now = ((0.2, -0.4), (0.0, 1.0))
    times = 0
    while now[1][1] > -3.4:
        last, now = now, joint_reference(AIRFRAME, LIMITS, now, ((0.2, -1.2), REST), DT)
        assert_within(last, now, LIMITS, DT)
        times += 1
    assert times * DT == pytest.approx(4.4 / LIMITS.acceleration, abs=2 * DT)


def test_what_moves_as_it_says_is_followed_without_lag() -> None:
    now, wished = (REST, REST), REST
    for k in range(500):
        t = k * DT
        wished = (0.4 * math.sin(3.0 * t), -0.5 * math.sin(2.0 * t))
        rates = (1.2 * math.cos(3.0 * t), -math.cos(2.0 * t))
        now = joint_reference(AIRFRAME, LIMITS, now, (wished, rates), DT)
        if t > 0.1:  # it began at rest
            assert now[0] == pytest.approx(wished, abs=1e-4)
            assert now[1] == pytest.approx(rates, abs=1e-2)


def test_a_far_wish_is_reached_on_a_nearly_straight_way_and_at_the_most_allowed_rate() -> None:
    start, goal = (-0.5, 0.9), (0.5, -0.3)
    now, k = (start, REST), 0
    while max(map(abs, np.subtract(now[0], goal))) > 1e-3:
        last, now = now, joint_reference(AIRFRAME, LIMITS, now, (goal, REST), DT)
        assert_within(last, now, LIMITS, DT)
        way = [(now[0][i] - start[i]) / (goal[i] - start[i]) for i in (0, 1)]
        assert max(way) < 1.0 + 1e-9  # it does not overshoot
        assert abs(way[0] - way[1]) < 0.03
        k += 1
    # The second joint has the longer way: it speeds up, has the most rate, and brakes.
    least = 1.2 / LIMITS.rate + LIMITS.rate / LIMITS.acceleration
    assert least - 0.01 < k * DT < least + 0.04


def test_at_rest_at_its_wish_it_stays_there() -> None:
    here: JointVector = (0.3, -0.4)
    assert joint_reference(AIRFRAME, LIMITS, (here, REST), (here, REST), DT) == (here, REST)


def test_outside_of_the_bounds_it_comes_back_without_a_jump() -> None:
    """A margin was changed in flight, or the arm stood beyond it when the loop began."""
    now = ((1.04, 0.5), REST)
    for _ in range(200):
        last, now = now, joint_reference(AIRFRAME, LIMITS, now, ((2.0, 0.0), REST), DT)
        assert max(map(abs, np.subtract(now[0], last[0]))) <= LIMITS.rate * DT
        assert abs(now[1][0] - last[1][0]) <= LIMITS.acceleration * DT + ROUNDING
    assert now[0] == pytest.approx(within_limits(ARM, (2.0, 0.0), LIMITS.margin), abs=1e-3)


def test_a_wider_margin_keeps_farther_off() -> None:
    wide = replace(LIMITS, margin=0.2)
    q = within_limits(ARM, (2.0, 2.0), wide.margin)
    assert q[0] == pytest.approx(ARM.high[0] - 0.2)
    assert sum(q) == pytest.approx(ARM.high[1] - 0.2)


@pytest.mark.parametrize("distance", [-0.3, -0.004, 0.0, 0.001, 0.0649, 0.0651, 0.5, 3.0])
def test_from_the_braking_rate_a_link_stops_in_the_distance(distance: float) -> None:
    left, before = distance, None
    for _ in range(5000):
        rate = braking_rate(left, LIMITS.acceleration, APPROACH, DT)
        if before is not None:
            assert abs(before - rate) <= LIMITS.acceleration * DT * (1.0 + 1e-6)
        left, before = left - rate * DT, rate
        assert left * distance >= 0.0
    assert left == pytest.approx(0.0, abs=1e-9)


# What the linear joint loop makes of a reference at most (docs/equations.md T3a): the sum of the
# absolute value of its impulse response, of angles and of accelerations that are added.
FOLLOWING, ADDED = 1.2707, 2.2707


def test_the_joint_loop_answers_with_no_more_than_the_derivation_says() -> None:
    gains = LoopGains().joint
    assert gains.kd**2 == pytest.approx(4.0 * gains.kp)  # both poles in one place
    pole, dt = 0.5 * gains.kd, 1e-5
    t = np.arange(0.0, 2.0, dt)
    answered = 1.0 - np.exp(-pole * t) * (1.0 - pole * t)
    assert np.abs(np.diff(answered)).sum() == pytest.approx(FOLLOWING, abs=1e-3)
    assert 1.0 + np.abs(np.diff(answered - 1.0)).sum() == pytest.approx(ADDED, abs=1e-3)


def test_near_a_bound_the_joint_loop_is_pulled_to_no_place_beyond_it() -> None:
    """Angle and rate together are one set point of a loop that does not overshoot."""
    gains = LoopGains().joint
    assert gains.kd / gains.kp == pytest.approx(APPROACH)
    bound, dt = bounds(LIMITS)[0], DT
    now, q, qd, most = ((-0.9, 0.0), REST), -0.9, 0.0, 0.0
    for _ in range(1000):
        now = joint_reference(AIRFRAME, LIMITS, now, ((2.0, -2.0), (9.0, -9.0)), dt)
        for _ in range(20):
            qdd = gains.kp * (now[0][0] - q) + gains.kd * (now[1][0] - qd)
            qd += 0.05 * dt * qdd
            q += 0.05 * dt * qd
            most = max(most, q)
    assert bound - 1e-3 < most < bound + 1e-3


def test_the_joints_own_limits_leave_room_for_every_reference() -> None:
    """Of rate and of torque, in every pose, with the loop and everything else at its worst."""
    planned = InputLimits()
    # A step of the added acceleration leaves a rate of 1 / (e pole); twice that is its sum.
    pole = 0.5 * LoopGains().joint.kd
    rate = FOLLOWING * LIMITS.rate + 2.0 / (math.e * pole) * planned.joint_acc
    assert rate < AIRFRAME.joint_rate_max[0]
    field = GRAVITY + planned.vertical
    first, both = bounds(LIMITS)
    inertia = AIRFRAME.bodies.base_inertia[1]
    turning = 2.0 * ROTOR_ARM * 0.5 * AIRFRAME.weakest_thrust / inertia
    link1 = FOLLOWING * LIMITS.acceleration + ADDED * planned.joint_acc
    link2 = FOLLOWING * LIMITS.acceleration + ADDED * 2.0 * planned.joint_acc
    most = [0.0, 0.0]
    for th1 in np.linspace(-first, first, 15):
        for th12 in np.linspace(-both, both, 15):
            fast = StateEstimate(
                0, (0.0,) * 3, (0.0,) * 3, (1.0, 0.0, 0.0) * 3, (0.0,) * 3, 0.0,
                (float(th1), float(th12 - th1)), (LIMITS.rate, LIMITS.rate),
            )  # fmt: skip
            m = placed(AIRFRAME, fast).bodies
            for falls in (-1.0, 1.0):
                for a1, a12, pitch in ((1, 1, 1), (1, -1, 1), (1, -1, -1), (1, 1, -1)):
                    a = (a1 * link1, a12 * link2 - a1 * link1)
                    turn = (0.0, pitch * turning, 0.0)
                    torques = torques_for(m, (0.0, 0.0, falls * field), turn, a)
                    for i, torque in enumerate(torques):
                        most[i] = max(most[i], abs(torque))
    friction = 0.01 + 0.005 * AIRFRAME.joint_rate_max[0]
    assert most[0] + friction < AIRFRAME.joint_torque_max[0]
    assert most[0] + friction > 0.9 * AIRFRAME.joint_torque_max[0]  # it is not far from it either
    assert most[1] < most[0]
