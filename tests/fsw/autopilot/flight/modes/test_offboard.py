"""Offboard setpoints: the newest one, its timeout, and its effect on the vehicle."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from fsw.autopilot.flight.modes.offboard import (
    Offboard,
    accept_setpoints,
    current_problem,
    is_fresh,
    report,
)
from fsw.autopilot.flight.setpoints.generator import PositionGoal, ReferenceState
from fsw.autopilot.flight.state import FlightState, OffboardMemory, SetpointMemory
from fsw.autopilot.signals import (
    AttitudeSetpoint,
    Home,
    JointSetpoint,
    Mode,
    MotionSetpoint,
    OffboardReport,
    PositionFrom,
    SensorFrame,
    SetpointKind,
    StatusText,
    TickInputs,
    Vec3,
)
from tests.fsw.autopilot.flight.contexts import READY, having
from tests.fsw.autopilot.flight.in_flight import GROUND_Z, flying, limits, vehicle_at
from tests.fsw.records import changed, with_record

CONFIG = limits(setpoint_timeout_us=500_000, landed_time_us=500_000)
OFFBOARD = Offboard(CONFIG)
MOTION = MotionSetpoint(False, (1.0, 2.0, -3.0))
ATTITUDE = AttitudeSetpoint(0.5, (1.0, 0.0, 0.0, 0.0))
JOINTS = JointSetpoint((0.2, -0.3))
SENSORS = SensorFrame(
    t_us=0,
    p_WB=(0.0, 0.0, -2.0),
    v_WB=(0.0, 0.0, 0.0),
    q_WB=(1.0, 0.0, 0.0, 0.0),
    gyro_B=(0.0, 0.0, 0.0),
    accel_B=(0.0, 0.0, -9.81),
    q_arm=(0.0, 0.0),
    qd_arm=(0.0, 0.0),
)
NOW_US = 10_000_000
NAN = math.nan
HERE: Vec3 = (0.0, 0.0, -2.0)


def reported(t_us: int = NOW_US, **fields: Any) -> TickInputs:
    return TickInputs(replace(SENSORS, t_us=t_us), **fields)


def accepted(
    memory: OffboardMemory,
    inputs: TickInputs,
    texts: list[StatusText] | None = None,
    vehicle: FlightState | None = None,
) -> OffboardMemory:
    state = replace(vehicle or flying(Mode.OFFBOARD), offboard=memory)
    return accept_setpoints(state, inputs, CONFIG, [] if texts is None else texts)


def hearing(**memory: Any) -> FlightState:
    return replace(flying(Mode.OFFBOARD), offboard=OffboardMemory(**memory))


def test_the_newest_of_motion_and_attitude_counts_and_joints_count_beside_them() -> None:
    memory = accepted(OffboardMemory(), reported(motion=MOTION))
    assert (memory.motion, memory.attitude, memory.motion_us) == (MOTION, None, NOW_US)
    memory = accepted(memory, reported(NOW_US + 1, attitude=ATTITUDE))
    assert (memory.motion, memory.attitude, memory.motion_us) == (None, ATTITUDE, NOW_US + 1)
    memory = accepted(memory, reported(NOW_US + 2, joints=JOINTS))
    assert (memory.attitude, memory.joints) == (ATTITUDE, JOINTS)
    assert (memory.motion_us, memory.joints_us) == (NOW_US + 1, NOW_US + 2)
    memory = accepted(memory, reported(NOW_US + 3, motion=MOTION))
    assert (memory.motion, memory.attitude, memory.joints) == (MOTION, None, JOINTS)
    assert (memory.accepted, memory.refused) == (4, 0)


def test_what_is_out_of_range_is_counted_and_not_kept() -> None:
    before = OffboardMemory(motion=MOTION, motion_us=5, accepted=7, refused=2)
    wild = reported(
        motion=MotionSetpoint(False, (1e9, 0.0, 0.0)),
        attitude=AttitudeSetpoint(9.0),
        joints=JointSetpoint((9.0, 0.0)),
        refused_setpoints=4,
    )
    refused = accepted(before, wild)
    assert refused.problem.startswith("joint 1 at 516 deg")
    assert (refused.motion, refused.motion_us) == (MOTION, 5)
    assert (refused.accepted, refused.refused) == (7, 2 + 4 + 3)
    mixed = accepted(before, replace(wild, joints=JOINTS, refused_setpoints=0))
    assert (mixed.accepted, mixed.refused) == (8, 4)


def test_the_reason_of_a_refusal_is_a_text_every_few_seconds_and_the_answer_to_the_mode() -> None:
    memory, texts = OffboardMemory(), list[StatusText]()
    for k in range(200):  # 10 s at 20 Hz
        wrong = reported(
            NOW_US + 50_000 * k, refused_setpoints=1, setpoint_problem="forces are not supported"
        )
        memory = accepted(memory, wrong, texts)
    assert [one.text for one in texts] == ["setpoint refused: forces are not supported"] * 2
    now_us = NOW_US + 50_000 * 199
    state = hearing(problem=memory.problem, problem_us=memory.problem_us)
    problem = current_problem(CONFIG, state, now_us)
    refused = OffboardMemory(problem=problem, problem_us=0)
    refusal = OFFBOARD.refusal(having(READY, offboard=refused))
    assert refusal == "not offboard: setpoints are refused: forces are not supported"
    dropped = OFFBOARD.waits(state, now_us)
    assert dropped == "offboard cancelled: setpoints were refused: forces are not supported"
    later = OFFBOARD.waits(state, now_us + 600_000)
    assert later == "offboard cancelled: setpoints stopped before arming"
    # One for another vehicle has no reason that is ours to tell.
    foreign, texts = accepted(OffboardMemory(), reported(refused_setpoints=1), texts), []
    assert (foreign.refused, foreign.problem, texts) == (1, "", [])


def test_a_position_from_the_vehicle_or_above_home_is_a_place_from_its_arrival_on() -> None:
    facing_east = vehicle_at((1.0, 2.0, -3.0))._replace(yaw=0.5 * math.pi)
    state = flying(Mode.OFFBOARD)
    vehicle = replace(state.vehicle, home=Home((5.0, 5.0, -0.25), 0.0))
    state = with_record(replace(state, vehicle=vehicle), state_estimate=facing_east)

    def place(motion: MotionSetpoint, at: FlightState = state) -> Vec3 | None:
        kept = accepted(OffboardMemory(), reported(motion=motion), vehicle=at).motion
        assert kept is None or kept.p_from is PositionFrom.ORIGIN
        return None if kept is None else kept.p

    offset = MotionSetpoint(False, p=(1.0, 0.0, -0.5), p_from=PositionFrom.VEHICLE)
    assert place(offset) == (2.0, 2.0, -3.5)
    assert place(replace(offset, along_heading=True)) == pytest.approx((1.0, 3.0, -3.5))
    tip = place(replace(offset, of_end_effector=True))
    assert tip is not None
    assert tip[2] > -3.4, "it counts from the end-effector, which hangs below"
    above = MotionSetpoint(False, p=(1.0, 0.0, -2.0), p_from=PositionFrom.HOME_HEIGHT)
    assert place(above) == (1.0, 0.0, -2.25)
    for motion, without in (
        (offset, with_record(state, has_estimate=0)),
        (above, replace(state, vehicle=replace(state.vehicle, home=None))),
        (replace(offset, p=(1000.0, 0.0, 0.0)), state),
    ):
        assert place(motion, without) is None


def test_an_open_axis_moves_by_its_velocity_and_stays_open_as_time_goes_on() -> None:
    held = MotionSetpoint(False, p=(NAN, NAN, -3.0), v=(0.5, -0.25, NAN))
    state = hearing(motion=held, motion_us=NOW_US)
    goal = OFFBOARD.aim(state, vehicle_at(HERE, t_us=NOW_US + 200_000)).setpoint.goal
    assert goal is not None
    assert goal.motion.p is not None
    assert goal.motion.p[2] == -3.0
    assert math.isnan(goal.motion.p[0])


@pytest.mark.parametrize("heard", ["motion_us", "joints_us"])
@pytest.mark.parametrize(("age_us", "fresh"), [(0, True), (499_999, True), (500_000, False)])
def test_a_setpoint_is_fresh_for_half_a_second(heard: str, age_us: int, fresh: bool) -> None:
    state = hearing(**{heard: NOW_US})
    assert is_fresh(CONFIG, state, NOW_US + age_us) is fresh
    waits = OFFBOARD.waits(state, NOW_US + age_us)
    assert (waits is None) is fresh
    assert not is_fresh(CONFIG, hearing(), 100), "nothing was ever heard"


def test_it_needs_setpoints() -> None:
    assert OFFBOARD.refusal(READY) is None
    assert "no setpoint" in (OFFBOARD.refusal(having(READY, offboard=OffboardMemory())) or "")


def test_a_refusal_says_how_long_it_waits_for_setpoints() -> None:
    patient = Offboard(limits(setpoint_timeout_us=2_500_000))
    refusal = patient.refusal(having(READY, offboard=OffboardMemory()))
    assert refusal == "not offboard: no setpoint was received in the last 2.5 s"


@pytest.mark.parametrize(
    ("motion", "rises"),
    [
        (MotionSetpoint(False, (0.0, 0.0, GROUND_Z - 0.11)), True),
        (MotionSetpoint(False, (5.0, 0.0, GROUND_Z - 0.09)), False),
        (MotionSetpoint(True, (0.0, 0.0, GROUND_Z - 0.01)), True),
        (MotionSetpoint(True, (0.0, 0.0, GROUND_Z + 0.01)), False),
        (MotionSetpoint(False, v=(1.0, 1.0, -0.11)), True),
        (MotionSetpoint(False, v=(1.0, 1.0, -0.09)), False),
        (MotionSetpoint(False, v=(0.0, 0.0, 0.5)), False),
        (MotionSetpoint(False, a=(1.0, 1.0, -0.11)), True),
        (MotionSetpoint(False, a=(1.0, 1.0, -0.09)), False),
    ],
)
def test_a_standing_vehicle_flies_when_a_setpoint_asks_it_to_rise(
    motion: MotionSetpoint, rises: bool
) -> None:
    state = hearing(motion=motion, motion_us=NOW_US)
    standing = replace(state, vehicle=replace(state.vehicle, landed=True))
    on_ground = vehicle_at((0.0, 0.0, GROUND_Z), t_us=NOW_US)
    assert OFFBOARD.update(standing, on_ground)[1].lift_off is rises
    silent = on_ground._replace(t_us=NOW_US + 500_000)
    assert not OFFBOARD.update(standing, silent)[1].lift_off


def pressed(by: float, since_us: int, *, of_end_effector: bool = False) -> FlightState:
    """With the setpoint ``by`` [m] in the ground, and rotors that idle since then."""
    reference = ReferenceState(of_end_effector, (0.0, 0.0, GROUND_Z + by), HERE, 0.0)
    state = hearing(motion=MOTION, motion_us=NOW_US)
    vehicle = replace(state.vehicle, unloaded=(since_us, 0.0))
    return replace(state, vehicle=vehicle, setpoint=SetpointMemory(reference))


def test_a_setpoint_in_the_ground_lands_it_when_the_ground_is_felt() -> None:
    standing = vehicle_at((0.0, 0.0, GROUND_Z), t_us=NOW_US)
    landed, result = OFFBOARD.update(pressed(0.11, NOW_US - 400_000), standing)
    assert landed.vehicle.landed
    assert result.next_mode is None, "it stays in its mode"
    waiting, _ = OFFBOARD.update(pressed(0.11, NOW_US - 399_999), standing)
    assert not waiting.vehicle.landed
    assert waiting.vehicle.unloaded is not None
    for state, estimate in (
        (pressed(0.09, 0), standing),
        (pressed(0.5, 0, of_end_effector=True), standing),
        (replace(pressed(0.5, 0), setpoint=SetpointMemory()), standing),
        (pressed(0.5, NOW_US - 400_000), vehicle_at(HERE, (0.0, 0.0, 2.5), NOW_US)),
    ):
        after, _ = OFFBOARD.update(state, estimate)
        assert not after.vehicle.landed
        assert after.vehicle.moved_us == NOW_US
        assert after.vehicle.unloaded is None


def aimed(state: FlightState, age_us: int = 0) -> SetpointMemory:
    return OFFBOARD.aim(state, vehicle_at(HERE, t_us=NOW_US + age_us)).setpoint


def test_a_place_that_moves_has_moved_since_it_was_sent() -> None:
    moving = MotionSetpoint(True, (1.0, 2.0, -3.0), v=(0.5, -1.0, 0.25))
    goal = aimed(hearing(motion=moving, motion_us=NOW_US), 400_000).goal
    assert goal is not None
    assert goal.motion.p == pytest.approx((1.2, 1.6, -2.9))
    assert goal.motion.v == moving.v
    for still in (replace(moving, along_heading=True), MOTION, MotionSetpoint(False, v=HERE)):
        goal = aimed(hearing(motion=still, motion_us=NOW_US), 400_000).goal
        assert goal == PositionGoal(still, None, CONFIG.steering.speed)


def test_without_a_young_motion_the_body_stays_and_the_joints_move() -> None:
    state = hearing(motion=MOTION, motion_us=NOW_US - 500_000, joints=JOINTS, joints_us=NOW_US)
    setpoint = aimed(state)
    assert setpoint.goal is not None
    assert setpoint.goal.motion == MotionSetpoint(False, v=(0.0, 0.0, 0.0))
    assert setpoint.goal.joints == JOINTS.q_arm


def test_joints_that_were_asked_for_are_kept_when_no_more_are() -> None:
    goal = PositionGoal(MOTION, joints=(0.5, 0.5))
    state = hearing(motion=MOTION, motion_us=NOW_US, joints=JOINTS, joints_us=NOW_US - 500_000)
    kept = aimed(replace(state, setpoint=SetpointMemory(None, goal)))
    assert kept.goal is not None
    assert kept.goal.joints == (0.5, 0.5)


def test_the_setpoint_begins_anew_only_where_it_is_of_another_point() -> None:
    last = SetpointMemory(ReferenceState(False, (7.0, 7.0, -7.0), HERE, 0.0), PositionGoal(MOTION))
    body = replace(hearing(motion=MOTION, motion_us=NOW_US), setpoint=last)
    assert aimed(body).reference == last.reference
    tip = replace(hearing(motion=MotionSetpoint(True, HERE), motion_us=NOW_US), setpoint=last)
    reference = aimed(tip).reference
    assert reference is not None
    assert reference.of_end_effector
    assert reference.p != last.reference.p  # type: ignore[union-attr]
    assert reference.q_arm is None, "the arm is the planner's"
    with_joints = replace(tip, offboard=replace(tip.offboard, joints=JOINTS, joints_us=NOW_US))
    reference = aimed(with_joints).reference
    assert reference is not None
    assert reference.q_arm == (0.0, 0.0), "where it is"


def test_an_attitude_is_an_acceleration_by_the_mass_that_was_weighed() -> None:
    state = hearing(attitude=ATTITUDE, motion_us=NOW_US)
    light = replace(state, record=changed(state.record, mass=2.0))
    goal = aimed(light).goal
    assert goal is not None
    thrust = 0.5 * 4.0 * CONFIG.airframe.weakest_thrust
    assert goal.motion.a == pytest.approx((0.0, 0.0, 9.81 - thrust / 2.0))


def test_rates_go_on_from_the_attitude_of_the_last_setpoint() -> None:
    rolling = AttitudeSetpoint(0.5, None, (0.5, 0.0, 0.0))
    state = hearing(attitude=rolling, motion_us=NOW_US)
    first = OFFBOARD.aim(state, vehicle_at(HERE, t_us=NOW_US))
    second = OFFBOARD.aim(first, vehicle_at(HERE, t_us=NOW_US))
    step = 0.5 * CONFIG.planner.period
    assert first.offboard.tilt.roll == pytest.approx(step)
    assert second.offboard.tilt.roll == pytest.approx(2.0 * step)
    again = OFFBOARD.aim(replace(second, setpoint=SetpointMemory()), vehicle_at(HERE, t_us=NOW_US))
    assert again.offboard.tilt.roll == pytest.approx(step), "level at the start"


@pytest.mark.parametrize(
    ("memory", "kind"),
    [
        ({"attitude": ATTITUDE, "motion_us": 5}, SetpointKind.ATTITUDE),
        ({"motion": MOTION, "motion_us": 5}, SetpointKind.BODY),
        ({"motion": MotionSetpoint(True, HERE), "motion_us": 5}, SetpointKind.END_EFFECTOR),
        ({"joints": JOINTS, "joints_us": 5}, SetpointKind.JOINTS),
    ],
)
def test_telemetry_shows_the_kind_in_use_and_its_age(
    memory: dict[str, Any], kind: SetpointKind
) -> None:
    state = hearing(accepted=3, refused=1, **memory)
    reported = report(state, 1005)
    assert (reported.kind, reported.accepted, reported.refused, reported.age_us) == (
        kind,
        3,
        1,
        1000,
    )
    elsewhere = replace(state, vehicle=replace(state.vehicle, mode=Mode.HOLD))
    assert report(elsewhere, 1005).kind is SetpointKind.NONE
    assert report(hearing(), 1005) == OffboardReport()
    assert report(hearing(refused=2), 1005).age_us == 0


def test_setpoints_alone_say_how_fast_and_where_the_nose_points() -> None:
    state = flying(Mode.OFFBOARD, speed=0.2, look_at=(9.0, 9.0, 0.0))
    goal = PositionGoal(MOTION)
    assert OFFBOARD.guided(goal, state) is goal
