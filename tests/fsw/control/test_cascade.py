"""One fast cycle as a whole: what the rotors and joints are told to do to the body."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fsw.control.attitude import attitude_pid, attitude_reference
from fsw.control.cascade import Cascade, Inner, in_hover
from fsw.control.gains import InnerTuning
from fsw.model.airframe import AIRFRAME
from fsw.model.prediction import Array
from fsw.signals import ActuatorCommand, PlanInput, PredictionState, StateEstimate, Vec2, Vec3
from tests.fsw.random_states import estimate_of

DT = 0.002
TUNING = InnerTuning()
STILL: Vec3 = (0.0, 0.0, 0.0)
NO_INPUT = PlanInput(STILL, 0.0, (0.0, 0.0))


def plan_at(yaw: float = 0.0, yaw_rate: float = 0.0, q_arm: Vec2 = (0.0, 0.0)) -> PredictionState:
    return PredictionState(
        (0.0, 0.0, -1.0), STILL, STILL, (0.0, 0.0), (0.0, 0.0), yaw, yaw_rate, q_arm, (0.0, 0.0)
    )


def torque_of(command: ActuatorCommand) -> Array:
    f1, f2, f3, f4 = command.rotor_thrust
    return np.array([0.3 * (f2 - f4), 0.3 * (f3 - f1), 0.016 * (f1 - f2 + f3 - f4)])


def one_step(
    estimate: StateEstimate,
    plan: PredictionState,
    u: PlanInput = NO_INPUT,
    inner: Inner = "tracking",
) -> ActuatorCommand:
    cascade = Cascade(AIRFRAME, TUNING, inner, DT)
    return cascade.step(in_hover(AIRFRAME, estimate), estimate, plan, u)[0]


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
    assert faster[2] == pytest.approx(AIRFRAME.inertia[2] * 0.05)


def test_the_rotors_carry_what_the_raised_arm_does_to_the_body() -> None:
    """The joint pushes the arm forward and the body back: nose-up torque must hold against it."""
    raised = estimate_of(Rotation.identity(), q_arm=(0.8, 0.0))
    command = one_step(raised, plan_at(q_arm=(0.8, 0.0)), inner="pid")
    assert command.joint_torque[0] > 0.1
    assert torque_of(command)[1] == pytest.approx(command.joint_torque[0])


def test_body_torque_is_eulers_equation() -> None:
    w: Vec3 = (0.4, -0.3, 0.5)
    estimate = estimate_of(Rotation.from_euler("ZYX", [0.3, 0.05, -0.04]), w)
    command = one_step(estimate, plan_at(0.3), inner="pid")
    reference = attitude_reference(STILL, 0.3)
    wanted, _ = attitude_pid(TUNING.attitude, STILL, estimate, reference, DT)
    inertia, spin = np.array(AIRFRAME.inertia), np.array(w)
    expected = inertia * np.array(wanted) + np.cross(spin, inertia * spin)
    expected[1] += command.joint_torque[0]
    np.testing.assert_allclose(torque_of(command)[:2], expected[:2], atol=1e-9)


@pytest.mark.parametrize("inner", ["tracking", "pid"])
def test_at_rest_on_its_plan_the_weight_is_carried_level(inner: Inner) -> None:
    """The arm bent so that its weight hangs below joint 1."""
    m1, m2 = AIRFRAME.link_mass
    c1, c2 = AIRFRAME.link_com
    upper, lower = m1 * c1 + m2 * AIRFRAME.link_length[0], m2 * c2
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
    _, after = cascade.step(memory._replace(commanded=sent), estimate, plan_at(), NO_INPUT)
    share = 1.0 - math.exp(-DT / AIRFRAME.rotor_lag)
    hover = 3.5 * 9.81 / 4.0
    assert after.rotors == pytest.approx((hover + share * (10.0 - hover),) * 4)
