"""One fast cycle as a whole: the effect of the rotor and joint commands on the body."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fsw.autopilot.control.cascade import Cascade, Inner, at_rest, in_hover
from fsw.autopilot.control.gains import LoopGains
from fsw.autopilot.control.pid import PidGains, attitude_pid, attitude_reference
from fsw.autopilot.control.safety_gate import stopped
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.model.rotors import motion_state
from fsw.autopilot.signals import (
    ActuatorCommand,
    PlanInput,
    PredictionState,
    StateEstimate,
    Vec2,
    Vec3,
)
from fsw.autopilot.tick_record import Tick
from tests.fsw.paper_arm import LENGTHS
from tests.fsw.random_states import estimate_of
from tests.fsw.records import changed, fast_loop, observe, observed, placed, with_given
from tests.paper_vehicle import YAW_PER_THRUST

DT = 0.002
TUNING = LoopGains()
STILL: Vec3 = (0.0, 0.0, 0.0)
NO_INPUT = PlanInput(STILL, 0.0, (0.0, 0.0))
YAW_INERTIA = 0.6 + 2e-5  # with the links' own

# Its arm takes part in no turn; what it weighs is on the base.
LIGHT = replace(
    AIRFRAME,
    bodies=replace(
        AIRFRAME.bodies,
        base_mass=AIRFRAME.mass,
        mass=(1e-7, 1e-7, *AIRFRAME.bodies.mass[2:]),
        inertia=tuple(1e-5 * entry for entry in AIRFRAME.bodies.inertia),
    ),
)


def plan_at(yaw: float = 0.0, yaw_rate: float = 0.0, q_arm: Vec2 = (0.0, 0.0)) -> PredictionState:
    return PredictionState(
        (0.0, 0.0, -1.0), STILL, STILL, (0.0, 0.0), (0.0, 0.0), yaw, yaw_rate, q_arm, (0.0, 0.0)
    )


def torque_of(command: ActuatorCommand) -> Array:
    f1, f2, f3, f4 = command.rotor_thrust
    return np.array([0.3 * (f2 - f4), 0.3 * (f3 - f1), 0.016 * (f1 - f2 + f3 - f4)])


def after_step(
    cascade: Cascade,
    before: Tick,
    estimate: StateEstimate,
    plan: PredictionState,
    u: PlanInput,
    ticks: int = 1,
) -> Tick:
    r = with_given(before, estimate, plan, u)
    fast_loop(cascade).step(r, ticks)
    return r


def one_step(
    estimate: StateEstimate,
    plan: PredictionState,
    u: PlanInput = NO_INPUT,
    inner: Inner = "tracking",
) -> ActuatorCommand:
    cascade = Cascade(AIRFRAME, TUNING, inner, DT)
    return after_step(cascade, in_hover(AIRFRAME, estimate), estimate, plan, u).actuator_command


def turned(yaw: float, w: Vec3 = STILL) -> StateEstimate:
    return estimate_of(Rotation.from_euler("Z", yaw), w)


@pytest.mark.parametrize(
    ("yaw", "plan_yaw", "sign"),
    [(0.0, 0.1, 1.0), (0.0, -0.1, -1.0), (3.1, -3.1, 1.0), (-3.1, 3.1, -1.0), (1.0, 1.1, 1.0)],
)
def test_heading_is_turned_to_the_plans_the_short_way(
    yaw: float, plan_yaw: float, sign: float
) -> None:
    assert sign * torque_of(one_step(turned(yaw), plan_at(plan_yaw)))[2] > 0.001


def test_yaw_rate_follows_the_plans_and_its_acceleration_is_fed_forward() -> None:
    spinning = turned(0.0, (0.0, 0.0, 0.2))
    assert torque_of(one_step(spinning, plan_at()))[2] < -0.001
    assert torque_of(one_step(turned(0.0), plan_at(yaw_rate=0.1)))[2] > 0.001
    faster = torque_of(one_step(turned(0.0), plan_at(), PlanInput(STILL, 0.05, (0.0, 0.0))))
    assert faster[2] == pytest.approx(YAW_INERTIA * 0.05)


def test_the_rotors_carry_what_the_raised_arm_does_to_the_body() -> None:
    """The joint pushes the arm forward and the body back: nose-up torque must hold against it."""
    raised = estimate_of(Rotation.identity(), q_arm=(0.8, 0.0))
    command = one_step(raised, plan_at(q_arm=(0.8, 0.0)), inner="pid")
    assert command.joint_torque[0] > 0.1
    assert torque_of(command)[1] == pytest.approx(command.joint_torque[0])


def test_body_torque_is_eulers_equation() -> None:
    w: Vec3 = (0.4, -0.3, 0.5)
    estimate = estimate_of(Rotation.from_euler("ZYX", [0.3, 0.05, -0.04]), w)
    cascade = Cascade(LIGHT, TUNING, "pid", DT)
    before = in_hover(LIGHT, estimate)
    command = after_step(cascade, before, estimate, plan_at(0.3), NO_INPUT).actuator_command
    reference = attitude_reference(STILL, 0.3)
    wanted, _ = attitude_pid(TUNING.attitude, STILL, estimate, reference, DT)
    inertia, spin = np.array(AIRFRAME.bodies.base_inertia[:3]), np.array(w)
    expected = inertia * np.array(wanted) + np.cross(spin, inertia * spin)
    expected[1] += command.joint_torque[0]
    np.testing.assert_allclose(torque_of(command)[:2], expected[:2], atol=1e-7)


@pytest.mark.parametrize("inner", ["tracking", "pid"])
def test_at_rest_on_its_plan_the_weight_is_carried_level(inner: Inner) -> None:
    """The arm bent so that its weight hangs below joint 1."""
    m1, m2 = AIRFRAME.bodies.mass[:2]
    c1, c2 = AIRFRAME.bodies.com[2], AIRFRAME.bodies.com[5]
    upper, lower = m1 * c1 + m2 * LENGTHS[0], m2 * c2
    th1 = -0.25
    th12 = math.asin(upper / lower * math.sin(-th1))
    bent = (th1, th12 - th1)
    estimate = estimate_of(Rotation.from_euler("Z", 1.0), q_arm=bent)
    command = one_step(estimate, plan_at(1.0, q_arm=bent), inner=inner)
    assert command.rotor_thrust == pytest.approx((3.5 * 9.81 / 4.0,) * 4)
    assert command.joint_torque[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("inner", ["tracking", "pid"])
def test_a_commanded_acceleration_tilts_the_thrust_its_way(inner: Inner) -> None:
    for axis, torque_axis, sign in ((0, 1, -1.0), (1, 0, 1.0)):
        a = [0.0, 0.0, 0.0]
        a[axis] = 1.0
        u = PlanInput((a[0], a[1], a[2]), 0.0, (0.0, 0.0))
        # Along +x the nose goes down, along +y the right side does.
        assert sign * torque_of(one_step(turned(0.0), plan_at(), u, inner))[torque_axis] > 0.1


def test_the_rotor_model_lags_behind_what_was_sent() -> None:
    estimate = turned(0.0)
    cascade = Cascade(AIRFRAME, TUNING, "tracking", DT)
    memory = in_hover(AIRFRAME, estimate)
    sent = ActuatorCommand((10.0, 10.0, 10.0, 10.0), (0.0, 0.0))
    after = after_step(
        cascade, changed(memory, actuator_command=sent), estimate, plan_at(), NO_INPUT
    )
    share = 1.0 - math.exp(-DT / AIRFRAME.rotor_lag)
    hover = 3.5 * 9.81 / 4.0
    assert after.rotors[:4] == pytest.approx([hover + share * (10.0 - hover)] * 4)


def test_a_vehicle_taken_over_carries_its_weight_and_one_at_rest_nothing() -> None:
    moving = turned(0.3)._replace(v_WB=(0.1, -0.2, 0.3))
    hovering, standing = in_hover(AIRFRAME, moving), at_rest(AIRFRAME, moving)
    assert sum(hovering.rotors) == pytest.approx(AIRFRAME.mass * 9.81)
    each = hovering.rotors.item(0)
    assert hovering.actuator_command == ActuatorCommand((each,) * 4, (0.0, 0.0))
    assert hovering.rotors.tolist() == [*(each,) * 4, *(0.0,) * 4]
    assert standing.actuator_command == stopped(AIRFRAME)
    assert not standing.rotors.any()
    for memory in (hovering, standing):
        assert memory.mass == AIRFRAME.mass
        assert memory.observed == observed(moving.v_WB, STILL)
        assert not memory.attitude.any()
        assert (memory.height, memory.flags) == (0.0, 0)
        assert memory.joint_reference == moving.q_arm
        expected = placed(AIRFRAME, moving).bodies.momentum
        np.testing.assert_allclose(memory.joints.momentum, expected, atol=1e-15)
        assert not memory.joints.disturbance.any()
        assert not memory.joints.integral.any()


@pytest.mark.parametrize("ticks", [1, 2, 5])
def test_missed_ticks_are_made_up_for_by_rotor_model_and_observer(ticks: int) -> None:
    """As if the vehicle had been seen in each of them, with the rotors where they are now."""
    estimate = turned(0.0)._replace(v_WB=(0.05, -0.04, 0.03))
    cascade = Cascade(AIRFRAME, TUNING, "tracking", DT)
    sent = ActuatorCommand((10.0, 10.0, 10.0, 10.0), (0.0, 0.0))
    memory = changed(in_hover(AIRFRAME, turned(0.0)), actuator_command=sent)
    after = after_step(cascade, memory, estimate, plan_at(), NO_INPUT, ticks)
    hover = 3.5 * 9.81 / 4.0
    left = math.exp(-ticks * DT / AIRFRAME.rotor_lag)
    assert after.rotors[:4] == pytest.approx([10.0 + left * (hover - 10.0)] * 4)
    expected, lift = memory.observed, 9.81 - sum(after.rotors) / after.mass
    for _ in range(ticks):
        expected = observe(expected, estimate.v_WB, (0.0, 0.0, lift), TUNING.tracking, DT)
    np.testing.assert_allclose(after.observed.v, expected.v, atol=1e-12)
    np.testing.assert_allclose(after.observed.d, expected.d, atol=1e-12)
    np.testing.assert_allclose(
        after.observed.disturbance_bias, expected.disturbance_bias, atol=1e-12
    )


def test_what_is_expected_of_the_rotors_knows_payloads_but_no_mass_from_an_accelerometer() -> None:
    cascade, r = Cascade(AIRFRAME, TUNING, "tracking", DT), in_hover(AIRFRAME, turned(0.0))
    r.mass = 1.25 * AIRFRAME.mass
    model = fast_loop(cascade).expected(r).model
    assert model[3] == pytest.approx(9.81)
    r.payload.mass = 0.25 * AIRFRAME.mass
    model = fast_loop(cascade).expected(r).model
    assert model[3] == pytest.approx(9.81 / 1.25)


def test_the_servos_hold_the_arm_in_the_field_that_the_thrust_makes() -> None:
    q_arm = (0.5, -0.9)
    (m1, m2), l1 = AIRFRAME.bodies.mass[:2], LENGTHS[0]
    c1, c2 = AIRFRAME.bodies.com[2], AIRFRAME.bodies.com[5]
    estimate = estimate_of(Rotation.identity(), q_arm=q_arm)
    cascade = Cascade(AIRFRAME, TUNING, "pid", DT)
    # One that weighs more than it does needs a stronger field of thrust to stand in.
    for thrust, field in ((3.5 * 9.81, 9.81), (1.2 * 3.5 * 9.81, 1.2 * 9.81)):
        each = (0.25 * thrust,) * 4
        lower = field * m2 * c2 * math.sin(sum(q_arm))
        upper = field * (m1 * c1 + m2 * l1) * math.sin(q_arm[0])
        sent = ActuatorCommand(each, (upper + lower, lower))
        memory = changed(in_hover(AIRFRAME, estimate), rotors=each, actuator_command=sent)
        # The accelerometer agrees that the mass is what it was.
        seen = estimate._replace(specific_force=thrust / 3.5)
        command = after_step(cascade, memory, seen, plan_at(q_arm=q_arm), NO_INPUT).actuator_command
        # The observers see a vehicle at rest that should be rising, and believe a little of it.
        np.testing.assert_allclose(command.joint_torque, (upper + lower, lower), rtol=0.05)


def test_the_motion_is_that_of_the_rotors_one_tick_on_and_of_the_first_joints_torque() -> None:
    estimate = estimate_of(Rotation.from_euler("ZYX", [0.4, 0.1, -0.2]), (0.1, -0.2, 0.3))
    cascade = Cascade(AIRFRAME, TUNING, "tracking", DT)
    memory = changed(in_hover(AIRFRAME, estimate), mass=3.6)
    sent = ActuatorCommand((8.0, 9.0, 10.0, 11.0), (0.3, -0.7))
    got = cascade.motion(changed(memory, actuator_command=sent), estimate)
    left = math.exp(-DT / AIRFRAME.rotor_lag)
    f = [
        target + left * (now - target)
        for now, target in zip(memory.rotors.tolist()[:4], sent.rotor_thrust, strict=True)
    ]
    r = placed(AIRFRAME, estimate, 3.6)
    expected = motion_state(AIRFRAME, r, (f[0], f[1], f[2], f[3]), (0.3, -0.7))
    for ours, theirs in zip(got, expected, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-12)


def test_a_large_heading_error_is_turned_away_at_a_limited_rate_either_way() -> None:
    for sign in (-1.0, 1.0):
        inside = torque_of(one_step(turned(0.0), plan_at(sign * 0.05)))[2]
        assert inside == pytest.approx(sign * YAW_INERTIA * TUNING.yaw.kp * 0.05)
        most = torque_of(one_step(turned(0.0), plan_at(sign * 3.0)))[2]
        yaw_limit = 4.0 * YAW_PER_THRUST * TUNING.yaw_thrust_limit
        assert most == pytest.approx(sign * min(YAW_INERTIA * TUNING.yaw.limit, yaw_limit))


def test_spinning_about_two_axes_the_third_torque_is_eulers() -> None:
    """With an unlike inertia about every axis; small enough for the rotors' drag."""
    bodies = replace(LIGHT.bodies, base_inertia=(0.25, 0.32, 0.6, 0.0, 0.0, 0.0))
    unlike = replace(AIRFRAME, bodies=bodies)
    w: Vec3 = (0.5, -0.4, 0.3)
    estimate = estimate_of(Rotation.identity(), w)
    free = replace(TUNING, attitude=PidGains(0.0, 0.0, 0.0, 1.0))
    cascade = Cascade(unlike, free, "pid", DT)
    command = after_step(
        cascade, in_hover(unlike, estimate), estimate, plan_at(), NO_INPUT
    ).actuator_command
    inertia, spin = np.array(bodies.base_inertia[:3]), np.array(w)
    expected = np.cross(spin, inertia * spin) + [0.0, command.joint_torque[0], 0.0]
    np.testing.assert_allclose(torque_of(command), expected, atol=1e-7)
