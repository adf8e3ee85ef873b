"""What flies is machine code; what is read and tested is Python: the two agree."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fsw.autopilot.control.actuator_watch import watch, watch_law
from fsw.autopilot.control.cascade import (
    Cascade,
    Inner,
    close_loops,
    compare_with_plan,
    in_hover,
    note_weight,
)
from fsw.autopilot.control.gains import LoopGains
from fsw.autopilot.control.tube import TubeAround
from fsw.autopilot.estimation.estimator import estimate_state, read_into, reading_of
from fsw.autopilot.flight.safety.damage_watch import DamageWatch
from fsw.autopilot.model.actuator_health import HEALTHY
from fsw.autopilot.model.airframe import AIRFRAME, AttitudeLag
from fsw.autopilot.model.nominal import NominalModel, move_plan
from fsw.autopilot.model.rotors import rotor_decay
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.shapes.ball import point
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.zones import moving_zones
from fsw.autopilot.signals import (
    ActuatorCommand,
    PlanInput,
    SafeSet,
    SensorFrame,
    Vec4,
)
from fsw.autopilot.tick_record import FILTER_ACTED, GATE_NEEDED, Tick
from tests.fsw.random_states import as_state, prediction_vector, random_estimate, vec3
from tests.fsw.records import fast_loop, with_given

STATES = 300
TUBE = TubeAround(1.5, 0.2, 0.01)
TUNINGS = [LoopGains(), replace(LoopGains(), compensate=False)]


def numbers(value: Any) -> Iterator[float]:
    """Every number of nested tuples, in order."""
    if isinstance(value, tuple):
        for part in value:
            yield from numbers(part)
    else:
        yield value


def four(random: np.random.Generator, high: float) -> Vec4:
    a, b, c, d = (float(value) for value in random.uniform(0.0, high, 4))
    return (a, b, c, d)


def memory(random: np.random.Generator) -> Tick:
    r = in_hover(AIRFRAME, random_estimate(random))
    torque = (float(random.uniform(-2.0, 2.0)), float(random.uniform(-2.0, 2.0)))
    r.actuator_command = ActuatorCommand(four(random, AIRFRAME.weakest_thrust), torque)
    r.rotors[:4] = random.uniform(0.0, AIRFRAME.weakest_thrust, 4)
    r.mass, r.height = float(random.uniform(2.5, 4.5)), float(random.uniform(-0.2, 0.2))
    r.observed.v[:], r.observed.d[:] = random.uniform(-1.0, 1.0, (2, 3))
    r.attitude[:] = random.uniform(-0.2, 0.2, 3)
    k = r.joints
    for values, most in (
        (k.reference, 1.0),
        (k.momentum, 0.01),
        (k.disturbance, 0.1),
        (k.integral, 0.1),
        (k.reference_rate, 2.0),
    ):
        values[:2] = random.uniform(-most, most, 2)
    return r


def plan_input(random: np.random.Generator) -> PlanInput:
    qdd1, qdd2 = (float(value) for value in random.uniform(-5.0, 5.0, 2))
    return PlanInput(
        vec3(random.uniform(-2.0, 2.0, 3)), float(random.uniform(-1.0, 1.0)), (qdd1, qdd2)
    )


@pytest.mark.drawn(1)
@pytest.mark.parametrize("ticks", [1, 3])
@pytest.mark.parametrize("tuning", TUNINGS)
@pytest.mark.parametrize("inner", ["tracking", "pid"])
def test_the_loops_do_as_machine_code_what_they_say_in_python(
    inner: Inner, tuning: LoopGains, ticks: int
) -> None:
    random = np.random.default_rng(7)
    cascade, pushed = Cascade(AIRFRAME, tuning, inner, 0.002), 0
    flown = fast_loop(cascade)
    zones = moving_zones(
        SafeSet((wall((0.6, 0.0, 0.8), 0.0, 0.1), point((0.5, 0.0, 0.0), 0.3))), None
    )
    for _ in range(STATES):
        before, estimate = memory(random), random_estimate(random)
        plan, u = as_state(prediction_vector(random)), plan_input(random)
        ours = with_given(before, estimate, plan, u)
        plain = ours.copy()
        flown.step(ours, ticks, zones, HEALTHY, TUBE)
        close_loops(plain, cascade.law, ticks, zones, cascade.probes)
        compare_with_plan(plain, TUBE)
        note_weight(plain, cascade.law.airframe)
        np.testing.assert_allclose(ours.numbers, plain.numbers, rtol=0, atol=1e-9)
        assert ours.flags == plain.flags
        pushed += ours.flags & FILTER_ACTED
    assert 0 < pushed < STATES, "with and without the safety filter"


def test_a_number_that_is_none_comes_out_as_none_and_is_left_to_the_gate() -> None:
    random = np.random.default_rng(8)
    cascade = Cascade(AIRFRAME, LoopGains(), "tracking", 0.002)
    plan = as_state(prediction_vector(random))._replace(q_arm=(math.nan, 0.0))
    after = with_given(memory(random), random_estimate(random), plan, plan_input(random))
    fast_loop(cascade).step(after)
    assert not math.isfinite(sum(after.actuator_command.joint_torque))
    assert after.flags & GATE_NEEDED


@pytest.mark.parametrize("lag", [AttitudeLag(), AttitudeLag(at_once=True)])
def test_the_plans_state_moves_on_as_in_python(lag: AttitudeLag) -> None:
    random = np.random.default_rng(9)
    nominal = NominalModel(replace(AIRFRAME, attitude_lag=lag), 0.002)
    for ticks in range(20):
        x, u = as_state(prediction_vector(random)), plan_input(random)
        plain = Tick()
        plain.joint_count = 2
        plain.plan_state, plain.plan_input = x, u
        for _ in range(ticks):
            move_plan(nominal.model, plain.plan, plain.u, 2)
        np.testing.assert_allclose(
            list(numbers(nominal.advance(x, u, ticks))),
            list(numbers(plain.plan_state)),
            rtol=0,
            atol=1e-9,
        )


def test_the_estimate_is_the_one_of_python() -> None:
    random = np.random.default_rng(10)
    for _ in range(STATES):
        q = random.normal(size=4)
        w, x, y, z = (float(value) for value in q / np.linalg.norm(q))
        p, v, gyro, accel = (vec3(random.uniform(-2.0, 2.0, 3)) for _ in range(4))
        sensors = SensorFrame(1, p, v, (w, x, y, z), gyro, accel, (0.1, 0.2), (0.3, 0.4))
        plain, estimate = Tick().estimate, estimate_state(sensors)
        assert read_into(plain, reading_of(sensors), 1) == 0
        assert estimate is not None
        np.testing.assert_allclose(estimate.R_WB, plain.R_WB, rtol=0, atol=1e-9)
        assert estimate.yaw == pytest.approx(plain.yaw, abs=1e-9)


def test_the_watch_over_actuators_is_the_one_of_python() -> None:
    random = np.random.default_rng(11)
    watcher = DamageWatch(FlightConfig())
    in_python, law = getattr(watch, "py_func", watch), watch_law(AIRFRAME)
    ours = memory(random)
    plain, found = ours.copy(), 0
    for k in range(STATES):
        sent = ours.copy()
        ours.state_estimate = plain.state_estimate = random_estimate(random)._replace(
            specific_force=9.81
        )
        ours.joints.reference[:2] = plain.joints.reference[:2] = random.uniform(-1.0, 1.0, 2)
        # Settled, and now and then one rotor is under suspicion for long.
        for r in (ours, plain):
            r.watch.running, r.watch.arm_seen = 2.0, float(k % 5)
            if k == STATES // 2:
                r.watch.failed, r.watch.effect = 2, 0.5
        failed = watcher.finds(sent, ours)
        decay = rotor_decay(AIRFRAME, 0.002)
        assert in_python(sent, plain, (law,), decay, 0.002, True) == failed
        np.testing.assert_allclose(ours.numbers, plain.numbers, rtol=1e-9, atol=1e-9)
        found += failed
    assert 0 < found < STATES
