"""One tick after the other: before the first estimate, after missed frames, on stale ones."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from fsw.autopilot.control.safety_gate import stopped
from fsw.autopilot.estimation.dead_reckoning import moved_on
from fsw.autopilot.estimation.estimator import estimate_state
from fsw.autopilot.flight.autopilot import Autopilot
from fsw.autopilot.flight.commands.arming import CHECKS
from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.flight.plan_exchange import nominal_at_rest
from fsw.autopilot.flight.safety.safe_set import joined
from fsw.autopilot.flight.safety.uncertain_clearance import InflatedSafeSet
from fsw.autopilot.flight.state import FlightState, MissionMemory, first_state
from fsw.autopilot.measurements import ImuSample, JointSample, Sample
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.signals import (
    BatteryState,
    CommandResult,
    EndEffectorTarget,
    HostHealth,
    MessageSource,
    MissionAction,
    MissionStep,
    MissionUpdate,
    Mode,
    SafeSet,
    SafeSetAnnouncement,
    SensorFrame,
    Severity,
    StatusText,
    TickInputs,
    TickOutputs,
    Vec3,
)
from tests.fsw.autopilot.flight.asked import command
from tests.fsw.autopilot.flight.in_flight import CONFIG, GROUND_Z, flying
from tests.fsw.records import with_record

AUTOPILOT = Autopilot(CONFIG)
ARM = 400
TICK_US = CONFIG.tick_period_us
STILL: Vec3 = (0.0, 0.0, 0.0)


def frame(t_us: int, **changes: Any) -> SensorFrame:
    """Standing on the ground, or as changed."""
    still = SensorFrame(
        t_us=t_us,
        p_WB=(0.0, 0.0, GROUND_Z),
        v_WB=STILL,
        q_WB=(1.0, 0.0, 0.0, 0.0),
        gyro_B=STILL,
        accel_B=(0.0, 0.0, -9.81),
        q_arm=(0.0, 0.0),
        qd_arm=(0.0, 0.0),
    )
    return replace(still, **changes)


def tick(state: FlightState, t_us: int, **inputs: Any) -> tuple[FlightState, TickOutputs]:
    sensors = inputs.pop("sensors", frame(t_us))
    return AUTOPILOT.tick(state, TickInputs(sensors, **inputs))


@pytest.mark.requirement("REQ-ARM-1")
def test_before_the_first_estimate_nothing_moves_and_commands_are_put_off() -> None:
    blind = frame(5000, p_WB=(math.nan, 0.0, 0.0))
    asked = (command(ARM, 1.0),)
    state, outputs = tick(first_state(CONFIG.airframe), 5000, sensors=blind, commands=asked)
    assert outputs.actuators == outputs.snapshot.actuators == stopped(AIRFRAME)
    assert [ack.result for ack in outputs.acks] == [CommandResult.TEMPORARILY_REJECTED]
    assert outputs.texts[-1].text == "not armed: the state estimate is invalid"
    snapshot, level = outputs.snapshot, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    assert (snapshot.mode, snapshot.armed, snapshot.t_us) == (Mode.DISARMED, False, 5000)
    reported = snapshot.estimate
    assert (reported.t_us, reported.p_WB, reported.v_WB, reported.w_WB_B) == (
        5000,
        STILL,
        STILL,
        STILL,
    )
    assert (reported.R_WB, reported.yaw) == (level, 0.0)
    assert (reported.q_arm, reported.qd_arm) == ((0.0, 0.0), (0.0, 0.0))
    assert (state.invalid_ticks, state.estimate) == (1, None)
    _, outputs = tick(state, 7000, sensors=blind)
    assert (outputs.acks, outputs.texts) == ((), ())


RESULTS = CommandResult
INJECT, RUN_CHECKS, SET_HOME, UNKNOWN = 420, 401, 179, 2000


@pytest.mark.requirement("REQ-ARM-1")
@pytest.mark.parametrize(
    ("number", "params", "result", "text"),
    [
        (INJECT, (6.0, 0.0), RESULTS.IN_PROGRESS, None),
        (INJECT, (0.5, 0.0), RESULTS.DENIED, "no failure injected"),
        (RUN_CHECKS, (), RESULTS.ACCEPTED, "not armed: the state estimate is invalid"),
        (UNKNOWN, (), RESULTS.UNSUPPORTED, None),
        (ARM, (7.0,), RESULTS.DENIED, "arm/disarm needs param1 = 1 or 0"),
        (ARM, (1.0, 21196.0), RESULTS.TEMPORARILY_REJECTED, "the state estimate is invalid"),
        (ARM, (0.0,), RESULTS.ACCEPTED, None),
        (SET_HOME, (1.0,), RESULTS.TEMPORARILY_REJECTED, "there is no valid state estimate yet"),
    ],
)
def test_before_the_first_estimate_what_needs_none_is_answered_as_always(
    number: int, params: tuple[float, ...], result: int, text: str | None
) -> None:
    blind, state = frame(5000, p_WB=(math.nan, 0.0, 0.0)), first_state(CONFIG.airframe)
    allowed = replace(CONFIG, limits=replace(CONFIG.limits, failure_injection=1))
    asked = (command(number, *params),)
    state, outputs = Autopilot(allowed).tick(state, TickInputs(blind, commands=asked))
    assert [ack.result for ack in outputs.acks] == [result]
    texts = [one.text for one in outputs.texts]
    assert (text in texts[0]) if text else texts == []
    assert not outputs.snapshot.armed


def started_blind(
    samples: Callable[[float], tuple[Sample, ...]], seconds: float = 3.0
) -> tuple[list[StatusText], list[TickOutputs]]:
    """What a vehicle says whose sensors give ``samples`` of a time [s] from its start on."""
    state, texts, outputs = first_state(CONFIG.airframe), [], []
    for t_us in range(TICK_US, round(1e6 * seconds), TICK_US):
        state, last = tick(state, t_us, samples=samples(1e-6 * t_us))
        texts += last.texts
        outputs.append(last)
    assert state.estimate is None
    return texts, outputs


def imu(t: float) -> Sample:
    return ImuSample(t, (0.0, 0.0, -9.81), STILL)


def encoders(t: float) -> Sample:
    return JointSample(t, (0.0, 0.0))


@pytest.mark.requirement("REQ-ARM-1")
@pytest.mark.parametrize(
    ("samples", "never"),
    [
        (lambda t: (imu(t), encoders(t)), "pose or GNSS"),
        (lambda t: (imu(t),), "joint encoders, pose or GNSS"),
        (lambda t: (encoders(t),), "IMU, pose or GNSS"),
    ],
)
def test_without_a_first_estimate_the_sensors_that_never_came_are_named_once(
    samples: Callable[[float], tuple[Sample, ...]], never: str
) -> None:
    texts, outputs = started_blind(samples)
    (text,) = [one for one in texts if "estimate" in one.text]
    assert text.text == f"state estimate invalid for 1 s: nothing has ever come from {never}"
    assert text in outputs[1_000_000 // TICK_US - 1].texts
    assert text.event is not None
    assert text.event.condition == Condition.ESTIMATE_INVALID.value
    for one in (outputs[0], outputs[-1]):
        snapshot = one.snapshot
        assert snapshot.failures == (Condition.ESTIMATE_INVALID.value,)
        (number,) = snapshot.arming.failed
        assert CHECKS[number].summary == "The state estimate is invalid"
    assert outputs[-1].snapshot.t_us > outputs[0].snapshot.t_us, "telemetry goes on"


@pytest.mark.requirement("REQ-ARM-1")
def test_without_one_valid_frame_of_exact_states_that_is_told_once() -> None:
    state, texts = first_state(CONFIG.airframe), []
    for t_us in range(TICK_US, 3_000_000, TICK_US):
        state, outputs = tick(state, t_us, sensors=frame(t_us, p_WB=(math.nan, 0.0, 0.0)))
        texts += [text.text for text in outputs.texts]
    assert texts == ["state estimate invalid for 1 s: no valid sensor frame has come"]


def test_sensors_that_fall_silent_before_the_first_estimate_are_told_once() -> None:
    texts, _ = started_blind(lambda t: (imu(t), encoders(t)) if t < 0.5 else (), 2.0)
    assert [one.text for one in texts].count("IMU silent") == 1


def test_an_invalid_frame_leaves_the_last_estimate_and_is_counted() -> None:
    state, _ = tick(first_state(CONFIG.airframe), 100_000)
    seen = state.estimate
    assert seen is not None
    blind = frame(102_000, q_WB=(0.0, 0.0, 0.0, math.nan))
    for count in (1, 2, 3):
        state, _ = tick(state, 102_000, sensors=blind)
        assert (state.invalid_ticks, state.estimate) == (count, seen._replace(t_us=102_000))
    state, _ = tick(state, 104_000)
    assert state.invalid_ticks == 0


@pytest.mark.parametrize("ticks", [1, 2, 7, 24, 25, 26, 1000])
def test_missed_ticks_are_counted_as_far_as_they_are_made_up_for(ticks: int) -> None:
    state, _ = tick(first_state(CONFIG.airframe), 100_000)
    assert state.index == 0
    after, _ = tick(state, 100_000 + ticks * TICK_US)
    assert after.index == min(ticks, CONFIG.catch_up_ticks)


def test_a_first_tick_is_the_first_however_late_and_time_that_stands_still_is_a_tick() -> None:
    state, _ = tick(first_state(CONFIG.airframe), 10**9)
    assert state.index == 0
    again, _ = tick(state, 10**9)
    assert again.index == 1


@pytest.mark.requirement("REQ-TIME-1")
def test_a_frame_that_was_late_is_moved_on_to_now() -> None:
    moving = frame(100_000, p_WB=(0.0, 0.0, -3.0), v_WB=(1.0, 2.0, 0.5), gyro_B=(0.1, 0.0, 0.2))
    measured = estimate_state(moving)
    assert measured is not None
    state, _ = tick(first_state(CONFIG.airframe), 100_000, sensors=moving, stale_us=4000)
    assert state.estimate == moved_on(measured, 0.004)
    fresh, _ = tick(first_state(CONFIG.airframe), 100_000, sensors=moving)
    assert fresh.estimate == measured


@pytest.mark.requirement("REQ-ARM-3")
@pytest.mark.parametrize("degrees", [16.0, 30.0, 60.0, 180.0])
def test_a_vehicle_that_lies_on_its_side_or_its_back_is_not_armed(degrees: float) -> None:
    half = 0.5 * math.radians(degrees)
    tilted = frame(100_000, q_WB=(math.cos(half), math.sin(half), 0.0, 0.0))
    state, _ = tick(first_state(CONFIG.airframe), 100_000, sensors=tilted)
    tilted = replace(tilted, t_us=200_000)
    state, outputs = tick(state, 200_000, sensors=tilted, commands=(command(ARM, 1.0),))
    assert outputs.acks[0].result == CommandResult.TEMPORARILY_REJECTED
    assert f"tilted by {degrees:.0f} deg" in outputs.texts[0].text
    assert not state.vehicle.armed
    (number,) = outputs.snapshot.arming.failed
    assert CHECKS[number].summary == "The vehicle is tilted"


@pytest.mark.requirement("REQ-BAT-5")
def test_an_empty_battery_is_not_armed() -> None:
    empty = replace(
        first_state(CONFIG.airframe), battery=BatteryState(consumed=10.0, remaining=0.0)
    )
    state, _ = tick(empty, 100_000)
    _, outputs = tick(state, 102_000, commands=(command(ARM, 1.0),))
    assert outputs.acks[0].result == CommandResult.TEMPORARILY_REJECTED
    assert "0 % left" in outputs.texts[-1].text


@pytest.mark.requirement("REQ-SAFE-4")
@pytest.mark.requirement("REQ-SAFE-4")
@pytest.mark.parametrize("again_us", [2_000, 50_000])
def test_outside_a_wall_and_the_fence_both_are_told_with_their_own_sizes(again_us: int) -> None:
    """A tick later, and in a tick of a planning period: the filter and the report find the same."""
    announced, fence = (SafeSet((wall((-1.0, 0.0, 0.0), at, 0.1),)) for at in (-50.0, -59.0))
    mission = MissionMemory(safe_set=joined(announced, fence), announced=announced, fence=fence)
    outside = frame(1_000_000, p_WB=(60.0, 0.0, -5.0))
    seen = estimate_state(outside)
    assert seen is not None
    kept = InflatedSafeSet().of(mission.safe_set)
    state = replace(
        with_record(flying(), plan_state=nominal_at_rest(seen)), mission=mission, kept=kept
    )
    texts: list[str] = []
    for t_us in (1_000_000, 1_000_000 + again_us):
        state, outputs = tick(state, t_us, sensors=replace(outside, t_us=t_us))
        texts += [text.text for text in outputs.texts]
    safety = state.safety
    assert (safety.breach_us, safety.fence_us) == (t_us, t_us)
    assert safety.breach_by == pytest.approx(safety.fence_by + 9.0)
    # Both retreat: the first of the table acts for both.
    by = f"{1e3 * safety.breach_by:.0f}", f"{1e3 * safety.fence_by:.0f}"
    assert f"failsafe: outside the safe set by {by[0]} mm, retreating" in texts
    assert f"outside the fence by {by[1]} mm: warn" in texts


@pytest.mark.requirement("REQ-LOG-1")
def test_a_log_that_fails_is_told_once_shown_and_arms_nothing() -> None:
    full = HostHealth(log_failure="flight.ulg ends early: No space left on device")
    state, _ = tick(first_state(CONFIG.airframe), 100_000)
    state, outputs = tick(state, 102_000, host=full)
    told = [text.text for text in outputs.texts]
    for t_us in range(104_000, 400_000, 2_000):
        state, outputs = tick(state, t_us)
        told += [text.text for text in outputs.texts]
    assert told == [f"flight log damaged: {full.log_failure}"]
    assert outputs.snapshot.log_failure == full.log_failure
    _, outputs = tick(state, 400_000, commands=(command(ARM, 1.0),))
    assert outputs.acks[0].result == CommandResult.DENIED
    assert "No space left on device; free the disk" in outputs.texts[-1].text


def test_armed_on_the_ground_the_rotors_idle_and_the_arm_is_let_down() -> None:
    state, _ = tick(first_state(CONFIG.airframe), 100_000)
    armed, outputs = tick(state, 102_000, commands=(command(ARM, 1.0),))
    assert outputs.acks[0].result == CommandResult.ACCEPTED
    swinging = frame(104_000, qd_arm=(0.5, -1.0))
    _, outputs = tick(armed, 104_000, sensors=swinging)
    assert outputs.actuators.rotor_thrust == (CONFIG.limits.idle_thrust,) * 4
    first, second = outputs.actuators.joint_torque
    assert first < 0.0 < second, "against the swing"
    _, outputs = tick(armed, 104_000)
    assert outputs.actuators.joint_torque == pytest.approx((0.0, 0.0))


@pytest.mark.parametrize("silent_s", [9.9, 10.1])
def test_a_station_that_is_silent_is_counted_from_when_it_was_last_heard(silent_s: float) -> None:
    state, _ = tick(first_state(CONFIG.airframe), 1_000_000, ground_station_heard=True)
    assert state.vehicle.gcs_heard_us == 1_000_000
    _, outputs = tick(state, 1_000_000 + round(1e6 * silent_s))
    assert outputs.snapshot.failures == ()
    state, _ = tick(state, 1_000_000 + round(1e6 * silent_s))
    lost = [one.value for one in state.vehicle.conditions if one is not Condition.TIME_JUMPED]
    assert lost == (["no ground station"] if silent_s > 10.0 else [])
    never, _ = tick(first_state(CONFIG.airframe), 10**9)
    assert never.vehicle.conditions == ()


def test_home_is_where_it_was_seen_first_until_it_is_armed() -> None:
    state, _ = tick(first_state(CONFIG.airframe), 100_000)
    assert state.vehicle.home is not None
    assert state.vehicle.home.p == (0.0, 0.0, GROUND_Z)
    carried = frame(102_000, p_WB=(3.0, 1.0, GROUND_Z))
    moved, _ = tick(state, 102_000, sensors=carried)
    assert moved.vehicle.home == state.vehicle.home
    armed, _ = tick(moved, 104_000, sensors=replace(carried, t_us=104_000),
                    commands=(command(ARM, 1.0),))  # fmt: skip
    assert armed.vehicle.home is not None
    assert armed.vehicle.home.p == (3.0, 1.0, GROUND_Z)


def test_disarming_opens_the_safe_set_to_another_owner() -> None:
    ours, theirs = (MessageSource(1, 195, link) for link in ("simulator", "gcs"))
    walls = SafeSet((wall((-1.0, 0.0, 0.0), -5.0, 0.1),))
    state, _ = tick(
        first_state(CONFIG.airframe), 100_000, announced=(SafeSetAnnouncement(ours, walls),)
    )
    state, _ = tick(state, 102_000, commands=(command(ARM, 1.0),))
    kept, _ = tick(state, 104_000, announced=(SafeSetAnnouncement(theirs, SafeSet()),))
    assert (kept.mission.owner, kept.mission.safe_set) == (ours, walls)
    state, outputs = tick(state, 106_000, commands=(command(ARM, 0.0),))
    assert not outputs.snapshot.armed
    state, _ = tick(state, 108_000, announced=(SafeSetAnnouncement(theirs, SafeSet()),))
    assert (state.mission.owner, state.mission.safe_set) == (theirs, SafeSet())


@pytest.mark.requirement("REQ-SAFE-7")
def test_what_is_refused_is_told_and_counted_whoever_refuses_it() -> None:
    """By the link, a target by the tick, and a mission, of which nothing is kept."""
    loop = Autopilot(CONFIG)
    state, _ = loop.tick(first_state(CONFIG.airframe), TickInputs(frame(1_000_000)))
    far = EndEffectorTarget(1_100_000, (0.0, 0.0, -2e3), (0.0,) * 3, (0.0,) * 3)
    near = replace(far, p_WE=(0.0, 0.0, -1.0))
    bad = MissionStep(MissionAction.GO, (0.0, math.nan, -1.0))
    inputs = TickInputs(
        frame(1_002_000),
        targets=(far, near),
        mission=MissionUpdate(steps=(bad,), current=0),
        refused=("ball refused: it is too large",),
    )
    state, outputs = loop.tick(state, inputs)
    assert [(text.severity, text.text) for text in outputs.texts if "refused" in text.text] == [
        (Severity.CRITICAL, "target refused: position out of range: 2000 m, at most 1000 m"),
        (Severity.CRITICAL, "ball refused: it is too large"),
        (
            Severity.CRITICAL,
            "mission refused: item 0: the place is more than 1000 m from the origin",
        ),
    ]
    assert outputs.snapshot.safety.refusals == 3
    assert state.mission.stream == (near,)
    assert state.mission.flight.steps == ()
