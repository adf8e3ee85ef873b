"""How commands, failsafes and completed modes move the vehicle, and what they leave alone."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import pytest

from fsw.autopilot.flight.commander import Commander
from fsw.autopilot.flight.commands.arming import CHECKS, Subject
from fsw.autopilot.flight.commands.handlers import decide
from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.flight.modes.land import Land
from fsw.autopilot.flight.safety import way_home
from fsw.autopilot.flight.setpoints.generator import PositionGoal, ReferenceState
from fsw.autopilot.flight.state import (
    FlightState,
    PlanMemory,
    SafetyMemory,
    SetpointMemory,
    first_state,
)
from fsw.autopilot.model.kinematics import end_effector
from fsw.autopilot.mpc.reference import still_at
from fsw.autopilot.signals import (
    VEHICLE_PILOT,
    Arm,
    ArmingReport,
    ChangeSpeed,
    Command,
    CommandAction,
    CommandRequest,
    CommandResult,
    Disarm,
    FlyOrbit,
    GoTo,
    Home,
    JointVector,
    LookAt,
    Mode,
    MotionSetpoint,
    MoveJoints,
    Place,
    PlannerCounters,
    Sender,
    SetHome,
    Severity,
    StateEstimate,
    StatusText,
    SwitchMode,
    TakeOff,
    Vec3,
)
from tests.fsw.autopilot.flight.asked import FLIGHT_MODES
from tests.fsw.autopilot.flight.in_flight import CONFIG, GROUND_Z, flying, vehicle_at
from tests.fsw.paper_arm import LIMIT1
from tests.fsw.records import with_record

COMMANDER = Commander(CONFIG)
NUMBERS = itertools.count()  # of commands: the same one again would be a repetition
NOW_US = 7_000_000
HERE: Vec3 = (1.0, 2.0, -3.0)
HOVERING = vehicle_at(HERE, t_us=NOW_US)._replace(yaw=0.5, q_arm=(0.2, -0.1))
STANDING = vehicle_at((1.0, 2.0, GROUND_Z), t_us=NOW_US)
DISARMED = replace(
    first_state(CONFIG.airframe), vehicle=replace(flying(Mode.DISARMED).vehicle, landed=True)
)
UNDER_WAY = ReferenceState(False, (1.2, 2.0, -3.0), (0.3, 0.0, 0.0), 0.7, 0.1, (0.2, -0.1))


def carried_out(
    state: FlightState, *actions: CommandAction, estimate: StateEstimate = HOVERING
) -> tuple[FlightState, list[StatusText]]:
    """The state after commands, all accepted, and the texts."""
    texts: list[StatusText] = []
    for action in actions:
        request = CommandRequest(next(NUMBERS), (math.nan,) * 7, 255, 190)
        state, acks = COMMANDER.handle_commands(state, estimate, (Command(action, request),), texts)
        assert [ack.result for ack in acks] == [CommandResult.ACCEPTED], texts
    return state, texts


def after(state: FlightState, *actions: CommandAction, **more: Any) -> FlightState:
    return carried_out(state, *actions, **more)[0]


def watched(
    state: FlightState, estimate: StateEstimate = HOVERING
) -> tuple[FlightState, list[str]]:
    """The state after a look at the failsafes, and the texts."""
    texts: list[StatusText] = []
    return COMMANDER.check_failsafes(state, estimate, texts), [text.text for text in texts]


def steered(goal: PositionGoal | None = None, **changes: Any) -> FlightState:
    """In hold, with a setpoint under way."""
    goal = goal or PositionGoal(MotionSetpoint(False, (5.0, 2.0, -3.0)), joints=(0.3, 0.1))
    return replace(flying(**changes), setpoint=SetpointMemory(UNDER_WAY, goal))


# ---------------------------------------------------------------- what decisions depend on


@pytest.mark.parametrize(
    ("times_us", "ahead"),
    [
        ((), False),
        ((NOW_US - 1,), False),
        ((NOW_US,), True),
        ((NOW_US - 9, NOW_US - 2, NOW_US - 1), False),
        ((NOW_US - 9, NOW_US - 2, NOW_US + 1), True),
    ],
)
def test_targets_are_ahead_until_the_last_one(times_us: tuple[int, ...], ahead: bool) -> None:
    stream = tuple(still_at(HERE, t_us) for t_us in times_us)
    state = flying()
    state = replace(state, mission=replace(state.mission, stream=stream))
    refusal = FLIGHT_MODES[Mode.TRAJECTORY].refusal(COMMANDER.situation(state, HOVERING))
    assert (refusal is None) is ahead
    assert ahead or "no END_EFFECTOR_TARGET ahead of now" in (refusal or "")


def test_joints_are_those_asked_for_or_else_those_measured() -> None:
    def kept(state: FlightState) -> JointVector | None:
        left = Command(MoveJoints((None, None)), CommandRequest(187, (math.nan,) * 7, 255, 190))
        return decide(left, COMMANDER.situation(state, HOVERING), FLIGHT_MODES).joints

    assert kept(steered()) == (0.3, 0.1)
    assert kept(steered(PositionGoal(MotionSetpoint(False, HERE)))) == HOVERING.q_arm
    assert kept(flying()) == HOVERING.q_arm


def test_what_a_decision_depends_on_is_the_vehicle_s() -> None:
    state = replace(flying(speed=0.4), invalid_ticks=1)
    situation = COMMANDER.situation(state, HOVERING, (255, 190))
    assert (situation.state, situation.estimate, situation.config) == (state, HOVERING, CONFIG)
    assert (situation.vehicle, situation.mission) == (state.vehicle, state.mission)
    assert (situation.sender, situation.estimate_is_valid) == ((255, 190), False)
    assert COMMANDER.situation(flying(), HOVERING).estimate_is_valid
    assert not COMMANDER.situation(flying(), HOVERING, known=False).estimate_is_valid


def test_what_is_ill_is_shown_while_the_vehicle_is_armed() -> None:
    conditions = (Condition.ROTOR_FAILED, Condition.DATALINK_LOST, Condition.BATTERY_LOW)
    state = flying(conditions=conditions)
    report = COMMANDER.arming_report(state, HOVERING)
    assert report.failed == (), "it is armed"
    assert report.ill == (Condition.ROTOR_FAILED.value, Condition.BATTERY_LOW.value)
    again = COMMANDER.arming_report(replace(state, arming=report), HOVERING)
    assert again is report, "what has not changed is the same value"


def test_why_arming_is_refused_is_shown_while_it_matters() -> None:
    low = vehicle_at((0.0, 0.0, GROUND_Z - 0.2))
    assert COMMANDER.arming_report(DISARMED, STANDING) == ArmingReport()
    report = COMMANDER.arming_report(DISARMED, low)
    (number,) = report.failed
    assert CHECKS[number].subject is Subject.STANDING
    again = COMMANDER.arming_report(replace(DISARMED, arming=report), low)
    assert again is report, "what has not changed is the same value"
    assert COMMANDER.arming_report(flying(), low) == ArmingReport()
    report = COMMANDER.arming_report(flying(Mode.FAULT), STANDING)
    assert [CHECKS[number].subject for number in report.failed] == [Subject.TERMINATION]


# ---------------------------------------------------------------- commands


@pytest.mark.requirement("REQ-MODE-10")
def test_a_repeated_command_is_answered_again_and_not_carried_out_again() -> None:
    request = CommandRequest(1, (math.nan,) * 7, 255, 190)
    commands = (Command(SwitchMode(Mode.LAND), request),) * 2
    texts: list[StatusText] = []
    state, acks = COMMANDER.handle_commands(flying(), HOVERING, commands, texts)
    assert [ack.result for ack in acks] == [CommandResult.ACCEPTED] * 2
    assert [text.text for text in texts] == ["hold to land: command"]
    assert state.vehicle.mode is Mode.LAND


def asked(
    state: FlightState, action: CommandAction, number: int, sender: int, again: int = 0
) -> FlightState:
    """The state after an accepted command in the same words whenever the ``number`` is the same."""
    request = CommandRequest(number, (math.nan,) * 7, sender, 190, again)
    command = Command(action, request)
    state, acks = COMMANDER.handle_commands(state, HOVERING, (command,), [])
    assert [ack.result for ack in acks] == [CommandResult.ACCEPTED]
    return state


@pytest.mark.requirement("REQ-MODE-10")
@pytest.mark.parametrize("again", [0, 1])
def test_a_repeated_command_acts_again_where_another_sender_has_changed_the_mode(
    again: int,
) -> None:
    state = asked(flying(), SwitchMode(Mode.LAND), 1, sender=255)
    state = asked(state, SwitchMode(Mode.HOLD), 2, sender=7)
    assert state.vehicle.mode is Mode.HOLD
    assert asked(state, SwitchMode(Mode.LAND), 1, 255, again).vehicle.mode is Mode.LAND
    away, back = GoTo(Place((5.0, 2.0), 3.0)), GoTo(Place((1.0, 2.0), 3.0))
    state = asked(asked(flying(), away, 3, sender=255), back, 4, sender=7)
    goal = asked(state, away, 3, 255, again).setpoint.goal
    assert goal is not None
    assert goal.motion.p == (5.0, 2.0, -3.0), "a place counts as well"


UNDONE: dict[str, tuple[CommandAction, CommandAction]] = {
    "home": (SetHome(Place((5.0, 2.0), 3.0)), SetHome(Place((1.0, 2.0), 3.0))),
    "look_at": (LookAt(Place((9.0, 2.0))), LookAt(None)),
    "speed": (ChangeSpeed(0.3), ChangeSpeed(0.7)),
}


@pytest.mark.requirement("REQ-MODE-10")
@pytest.mark.parametrize("again", [0, 1])
@pytest.mark.parametrize("name", UNDONE)
def test_a_repeated_command_acts_again_where_another_sender_has_undone_it(
    name: str, again: int
) -> None:
    """It was acknowledged from memory, and what the other sender had set stayed."""
    mine, other = UNDONE[name]
    # In flight, home is for one of both alone.
    first = asked(DISARMED if name == "home" else flying(), mine, 1, sender=255)
    second = asked(first, other, 2, sender=7)
    assert getattr(second.vehicle, name) != getattr(first.vehicle, name)
    third = asked(second, mine, 1, 255, again)
    assert getattr(third.vehicle, name) == getattr(first.vehicle, name)


@pytest.mark.requirement("REQ-MODE-10")
@pytest.mark.parametrize("name", UNDONE)
def test_a_command_that_another_sender_has_not_undone_does_not_act_twice(name: str) -> None:
    """Its ACK was lost. Only another course undoes a flight to a place."""
    there, (_, other) = GoTo(Place((5.0, 2.0), 3.0)), UNDONE[name]
    state = asked(asked(flying(), there, 1, sender=255), other, 2, sender=7)
    # The setpoint would be another object if the flight were begun again.
    assert asked(state, there, 1, 255, again=1).setpoint is state.setpoint


@pytest.mark.requirement("REQ-MODE-10")
def test_a_repeated_command_acts_again_where_a_failsafe_has_changed_the_mode() -> None:
    planned = replace(flying(Mode.OFFBOARD), plan=PlanMemory(since_us=NOW_US))
    held = asked(planned, SwitchMode(Mode.HOLD), 1, sender=255)
    outside = SafetyMemory(breach_us=NOW_US, breach_by=0.1)
    retreating, said = watched(replace(held, safety=outside))
    assert any("retreating" in text for text in said), said
    assert retreating.vehicle.failsafe_from is Mode.HOLD
    taken = asked(retreating, SwitchMode(Mode.HOLD), 1, sender=255, again=1)
    assert taken.vehicle.failsafe_from is None, "the pilot holds, not the failsafe"


@pytest.mark.requirement("REQ-MODE-10")
def test_a_mode_that_is_complete_is_what_its_command_led_to() -> None:
    state = asked(flying(), SwitchMode(Mode.LAND), 1, sender=255)
    answered = state.vehicle.answered
    on_the_ground = replace(state, vehicle=replace(state.vehicle, landed=True))
    on_the_ground = with_record(on_the_ground, plan_state=None)
    estimate = STANDING
    while on_the_ground.vehicle.mode is Mode.LAND:
        estimate = estimate._replace(t_us=estimate.t_us + 100_000)
        on_the_ground = COMMANDER.check_mode_completion(on_the_ground, estimate, [])
    assert on_the_ground.vehicle.mode is Mode.DISARMED
    assert on_the_ground.vehicle.answered == answered
    # What is acknowledged does nothing more: it is not told that landing is impossible here.
    asked(on_the_ground, SwitchMode(Mode.LAND), 1, sender=255, again=1)


def test_a_refused_command_changes_nothing_and_says_why() -> None:
    request = CommandRequest(1, (math.nan,) * 7, 255, 190)
    texts: list[StatusText] = []
    state, acks = COMMANDER.handle_commands(
        flying(), HOVERING, (Command(Disarm(), request),), texts
    )
    assert [ack.result for ack in acks] == [CommandResult.TEMPORARILY_REJECTED]
    assert [text.severity for text in texts] == [Severity.CRITICAL]
    assert replace(state, vehicle=replace(state.vehicle, answered=())) == flying()


def test_what_is_accepted_is_said_loudly_only_where_it_alarms() -> None:
    _, texts = carried_out(DISARMED, SwitchMode(Mode.TAKEOFF), estimate=STANDING)
    assert all(text.severity is Severity.INFO for text in texts)
    _, texts = carried_out(flying(), Disarm(force=True))
    assert texts[0].severity is Severity.CRITICAL
    slow = FlyOrbit(Place((5.0, 2.0), 3.0), 0.5, speed=1.5)
    _, texts = carried_out(flying(), slow)
    assert texts[0].severity is Severity.INFO
    assert "faster cannot be flown" in texts[0].text


def test_arming_on_the_ground_begins_in_hold_with_home_here_and_all_wishes_forgotten() -> None:
    wishes = replace(
        DISARMED.vehicle,
        look_at=(9.0, 9.0, -1.0),
        speed=0.2,
        conditions=(Condition.BATTERY_LOW, Condition.DATALINK_LOST),
    )
    before = replace(
        DISARMED,
        vehicle=wishes,
        setpoint=SetpointMemory(UNDER_WAY),
        plan=PlanMemory(next_id=7, counters=PlannerCounters(plans=5), refused=True),
    )
    state = after(before, Arm(), estimate=STANDING)
    vehicle = state.vehicle
    assert (vehicle.mode, vehicle.landed, vehicle.flies) == (Mode.HOLD, True, False)
    assert vehicle.home == Home(STANDING.p_WB, STANDING.yaw)
    assert (vehicle.look_at, vehicle.speed) == (None, None)
    assert vehicle.conditions == (), "what is so is reported anew, and acted upon"
    assert state.setpoint == SetpointMemory()
    assert state.plan == PlanMemory(since_us=NOW_US, next_id=7, counters=PlannerCounters(plans=5))
    assert state.record.actuator_command.rotor_thrust == (0.0,) * 4


def test_arming_in_the_air_hovers_at_once() -> None:
    state = after(replace(DISARMED, vehicle=replace(DISARMED.vehicle, landed=False)), Arm())
    assert state.vehicle.flies
    assert state.plan_state is not None
    assert (state.plan_state.p, state.plan_state.v) == (HERE, (0.0, 0.0, 0.0))
    weight = 9.81 * CONFIG.airframe.mass
    assert sum(state.record.actuator_command.rotor_thrust) == pytest.approx(weight, rel=0.05)


def test_a_takeoff_chosen_before_arming_follows_it() -> None:
    chosen = after(DISARMED, TakeOff(Place(height=3.0)), estimate=STANDING)
    assert (chosen.vehicle.mode, chosen.vehicle.intended_mode) == (Mode.DISARMED, Mode.TAKEOFF)
    assert chosen.vehicle.intended_us == NOW_US
    assert chosen.vehicle.climb == pytest.approx(3.0 + GROUND_Z)
    armed, texts = carried_out(chosen, Arm(), estimate=STANDING)
    assert (armed.vehicle.mode, armed.vehicle.intended_mode) == (Mode.TAKEOFF, Mode.HOLD)
    assert armed.vehicle.flies
    assert texts[-1].text == "hold to takeoff: chosen before arming"


def test_without_a_height_a_takeoff_climbs_as_usual() -> None:
    chosen = after(DISARMED, TakeOff(Place()), estimate=STANDING)
    assert chosen.vehicle.climb == CONFIG.limits.takeoff_climb


def test_a_mode_chosen_before_arming_whose_need_is_gone_leaves_hold_and_says_why() -> None:
    chosen = replace(DISARMED, vehicle=replace(DISARMED.vehicle, intended_mode=Mode.MISSION))
    armed, texts = carried_out(chosen, Arm(), estimate=STANDING)
    assert (armed.vehicle.mode, armed.vehicle.landed) == (Mode.HOLD, True)
    assert texts[-1] == StatusText(Severity.CRITICAL, "no mission: none was uploaded")


def test_home_is_set_and_the_rest_stays() -> None:
    state, texts = carried_out(flying(), SetHome(None))
    assert state.vehicle.home == Home(HERE, 0.5)
    assert state.vehicle.mode is Mode.HOLD
    assert [text.text for text in texts] == [
        "home set by 255/190: 1.0 m north 2.0 m east, 3.0 m above the origin"
    ]


@pytest.mark.requirement("REQ-SAFE-9")
@pytest.mark.parametrize(
    ("armed_by", "chosen", "sender", "may"),
    [
        ((255, 190), 0, (255, 190), True),
        ((255, 190), 0, (66, 6), False),
        ((255, 190), 0, (255, 191), False),
        ((255, 190), 9, (255, 190), True),
        ((255, 190), 9, (9, 1), True),
        ((255, 190), 9, (66, 6), False),
        (VEHICLE_PILOT, 0, (66, 6), True),
        (VEHICLE_PILOT, 0, (0, 0), True),
        (VEHICLE_PILOT, 9, (66, 6), False),
        (VEHICLE_PILOT, 9, (9, 1), True),
        ((255, 190), 0, (0, 0), False),
    ],
)
def test_armed_who_armed_or_is_chosen_may_change_where_a_return_ends(
    armed_by: Sender, chosen: int, sender: Sender, may: bool
) -> None:
    """A stranger's home, 30 m away, was flown to without a word."""
    owned = way_home.commanded(flying(), armed_by, None, arms=True).mission
    assert (way_home.against(owned, sender, chosen, armed=True) == "") is may
    assert way_home.against(owned, sender, chosen, armed=False) == ""


def test_where_nobody_is_known_to_have_armed_the_first_owns_where_a_return_ends() -> None:
    state = way_home.commanded(flying(), VEHICLE_PILOT, None, arms=True)
    home = Home(HERE, 0.0)
    owned = way_home.commanded(state, (9, 1), home, arms=False).mission
    assert way_home.against(owned, (66, 6), 0, armed=True)
    assert not way_home.against(owned, (9, 1), 0, armed=True)
    on_ground = way_home.commanded(DISARMED, (66, 6), home, arms=False)
    assert on_ground.mission.home_owner is None


@pytest.mark.requirement("REQ-SAFE-9")
def test_a_stranger_cannot_set_home_in_flight_and_who_armed_can() -> None:
    armed = after(DISARMED, Arm(), estimate=STANDING)
    assert armed.mission.home_owner == (255, 190)
    away, texts = SetHome(Place((-30.0, 0.0), 3.0)), list[StatusText]()
    theirs = Command(away, CommandRequest(179, (math.nan,) * 7, 66, 6))
    kept, (ack,) = COMMANDER.handle_commands(armed, HOVERING, (theirs,), texts)
    assert (kept.vehicle.home, ack.result) == (armed.vehicle.home, CommandResult.DENIED)
    only = "while armed only 255/190 may change where a return ends"
    assert texts[-1].text == f"home not set by 66/6: {only}"
    moved = after(armed, away)
    assert moved.vehicle.home is not None
    assert moved.vehicle.home.p == (-30.0, 0.0, -3.0)


def test_a_speed_is_kept_for_places_and_for_the_mission() -> None:
    state = after(flying(), ChangeSpeed(0.25))
    assert (state.vehicle.speed, state.mission.flight.speed) == (0.25, 0.25)
    assert after(state, ChangeSpeed(None)).vehicle.speed is None


def test_a_place_is_flown_to_from_where_the_vehicle_is_and_the_arm_as_it_is() -> None:
    setpoint = after(flying(), GoTo(Place((4.0, 4.0), 3.0))).setpoint
    assert setpoint.reference == ReferenceState(False, HERE, (0.0,) * 3, 0.5, 0.0, (0.2, -0.1))
    assert setpoint.goal is not None
    assert (setpoint.goal.motion.p, setpoint.goal.joints) == ((4.0, 4.0, -3.0), None)


def test_a_place_is_flown_to_from_the_setpoint_that_is_under_way_with_the_joints_asked() -> None:
    setpoint = after(steered(), GoTo(Place((4.0, 4.0), 3.0))).setpoint
    assert setpoint.reference == UNDER_WAY
    assert setpoint.goal is not None
    assert (setpoint.goal.motion.p, setpoint.goal.joints) == ((4.0, 4.0, -3.0), (0.3, 0.1))


def test_after_a_setpoint_of_the_end_effector_one_of_the_body_begins_anew() -> None:
    arm = replace(UNDER_WAY, of_end_effector=True)
    state = replace(steered(), setpoint=SetpointMemory(arm, steered().setpoint.goal))
    for action in (GoTo(Place((4.0, 4.0), 3.0)), MoveJoints((0.5, -0.5))):
        reference = after(state, action).setpoint.reference
        assert reference is not None
        assert (reference.of_end_effector, reference.p) == (False, HERE)


def test_an_orbit_begins_with_the_heading_of_its_beginning() -> None:
    state = after(steered(), FlyOrbit(Place((5.0, 2.0), 3.0), 2.0))
    assert state.vehicle.mode is Mode.ORBIT
    goal = state.setpoint.goal
    assert goal is not None
    assert goal.orbit is not None
    assert goal.motion.yaw == UNDER_WAY.yaw
    place = after(steered(), GoTo(Place((4.0, 4.0), 3.0))).setpoint.goal
    assert place is not None
    assert place.motion.yaw is None


def test_joints_are_moved_on_the_way_or_where_the_vehicle_stays() -> None:
    limit = LIMIT1
    on_the_way = after(steered(), MoveJoints((0.5, None))).setpoint
    assert on_the_way.reference == UNDER_WAY
    assert on_the_way.goal == PositionGoal(
        MotionSetpoint(False, (5.0, 2.0, -3.0)), (0.5 * limit, 0.1)
    )
    staying = after(flying(), MoveJoints((0.5, None))).setpoint
    assert staying.goal == PositionGoal(MotionSetpoint(False, HERE), (0.5 * limit, -0.1))


def test_a_hold_that_is_commanded_again_stops_on_the_way() -> None:
    setpoint = after(steered(), SwitchMode(Mode.HOLD)).setpoint
    assert setpoint.goal == PositionGoal(MotionSetpoint(False, v=(0.0, 0.0, 0.0)), (0.3, 0.1))
    assert after(flying(), SwitchMode(Mode.HOLD)).setpoint == SetpointMemory()


@pytest.mark.parametrize(
    ("state", "given"),
    [
        (flying(), True),
        (flying(Mode.MISSION), False),
        (replace(DISARMED, vehicle=replace(DISARMED.vehicle, mode=Mode.HOLD)), False),
    ],
    ids=["hold", "mission", "ground"],
)
def test_a_place_to_look_at_gives_a_hold_a_setpoint_that_can_turn(
    state: FlightState, given: bool
) -> None:
    looking = after(state, LookAt(Place((9.0, 9.0), 1.0)))
    assert looking.vehicle.look_at == (9.0, 9.0, -1.0)
    assert (looking.setpoint.reference is not None) is given
    if given:
        assert looking.setpoint.goal == PositionGoal(MotionSetpoint(False, HERE))


def test_a_place_to_look_at_leaves_a_setpoint_under_way() -> None:
    assert after(steered(), LookAt(Place((9.0, 9.0), 1.0))).setpoint == steered().setpoint
    assert after(flying(look_at=HERE), LookAt(None)).vehicle.look_at is None


# ---------------------------------------------------------------- failsafes


SHAKY = replace(flying(), output_replaced=True, plan=PlanMemory(since_us=NOW_US))


@pytest.mark.requirement("REQ-MODE-1")
def test_a_condition_is_reported_once_for_as_long_as_it_lasts() -> None:
    state, texts = watched(SHAKY)
    assert texts == ["actuator command not finite: warn"]
    assert state.vehicle.conditions == (Condition.OUTPUT_NOT_FINITE,)
    same, texts = watched(state)
    assert same is state
    assert texts == []
    over, texts = watched(replace(state, output_replaced=False))
    assert (over.vehicle.conditions, texts) == ((), [])
    assert watched(replace(over, output_replaced=True))[1] != []


@pytest.mark.requirement("REQ-MODE-1")
def test_another_condition_is_reported_alone() -> None:
    state, _ = watched(SHAKY)
    state, texts = watched(replace(state, plan=replace(state.plan, refused=True)))
    assert texts == ["last plan refused: failing: warn"]
    assert len(state.vehicle.conditions) == 2


def offboard_lost() -> FlightState:
    state = flying(Mode.OFFBOARD)
    return replace(state, plan=PlanMemory(since_us=NOW_US))


def test_a_failsafe_switches_and_remembers_what_was_flown() -> None:
    state, texts = watched(offboard_lost())
    assert (state.vehicle.mode, state.vehicle.failsafe_from) == (Mode.HOLD, Mode.OFFBOARD)
    assert texts[0].startswith("failsafe: offboard setpoints stopped")
    assert texts[1] == "offboard to hold: failsafe"


def test_a_second_failsafe_remembers_what_the_pilot_flew() -> None:
    state, _ = watched(offboard_lost())
    state = replace(state, vehicle=replace(state.vehicle, gcs_heard_us=0))
    late = HOVERING._replace(t_us=20_000_000)
    state = replace(state, plan=PlanMemory(since_us=late.t_us))
    state, texts = watched(state, late)
    assert "failsafe: no ground station for 20 s, returning in 5 s" in texts
    assert (state.vehicle.mode, state.vehicle.failsafe_from) == (Mode.HOLD, Mode.OFFBOARD)
    later = HOVERING._replace(t_us=25_000_000)
    state = replace(state, plan=PlanMemory(since_us=later.t_us))
    state, texts = watched(state, later)
    assert "failsafe: no ground station for 25 s, returning" in texts
    assert (state.vehicle.mode, state.vehicle.failsafe_from) == (Mode.RETURN, Mode.OFFBOARD)
    taken_back = after(state, SwitchMode(Mode.HOLD))
    assert taken_back.vehicle.failsafe_from is None


@pytest.mark.requirement("REQ-MODE-7", "REQ-EST-9")
def test_after_the_end_of_the_flight_nothing_else_is_looked_at() -> None:
    over = SafetyMemory(rolled_us=NOW_US - 400_000)
    lost = replace(offboard_lost(), output_replaced=True, safety=over)
    state, texts = watched(lost)
    assert state.vehicle.mode is Mode.FAULT
    assert state.vehicle.failsafe_from is None
    assert texts == [
        "tilt beyond recovery: roll above 60 deg for 0.40 s: terminate",
        "actuator command not finite: warn",
        "offboard setpoints stopped",
        "offboard to fault: terminate",
    ]
    again, texts = watched(replace(state, output_replaced=False))
    assert again.vehicle.conditions == state.vehicle.conditions, "what ended it stays on show"
    assert texts == []


# ---------------------------------------------------------------- modes that are done


def completed(
    state: FlightState, estimate: StateEstimate = HOVERING
) -> tuple[FlightState, list[str]]:
    texts: list[StatusText] = []
    return COMMANDER.check_mode_completion(state, estimate, texts), [text.text for text in texts]


def test_a_mode_that_is_done_hands_its_reference_on_and_a_failsafe_goes_on() -> None:
    climbing = flying(
        Mode.TAKEOFF,
        mode_origin=(1.0, 2.0, -1.0),
        climb=1.0,
        failsafe_from=Mode.OFFBOARD,
        mode_yaw=0.9,
    )
    state, texts = completed(climbing)
    vehicle = state.vehicle
    assert texts == ["takeoff to hold: climb done"]
    assert (vehicle.mode, vehicle.failsafe_from) == (Mode.HOLD, Mode.OFFBOARD)
    assert (vehicle.mode_origin, vehicle.mode_yaw) == ((1.0, 2.0, -2.0), 0.9)
    assert (vehicle.mode_begin_us, vehicle.moved_us) == (NOW_US, NOW_US)


def test_a_mode_that_is_commanded_begins_where_the_end_effector_is() -> None:
    before = flying(Mode.TAKEOFF, mode_origin=(1.0, 2.0, -2.9), climb=50.0)
    state = after(before, SwitchMode(Mode.HOLD))
    here = end_effector(CONFIG.airframe.bodies, HOVERING)[0]
    assert (state.vehicle.mode_origin, state.vehicle.mode_yaw) == (here, 0.5)
    descending = after(before, SwitchMode(Mode.LAND))
    assert Land.continues_reference
    assert descending.vehicle.mode_origin == COMMANDER.mode(before).target(before, NOW_US).p_WE


def test_a_mode_that_lifts_off_flies_with_a_plan_that_begins_where_the_vehicle_stands() -> None:
    idling = replace(DISARMED, vehicle=replace(DISARMED.vehicle, mode=Mode.HOLD))
    state = after(idling, TakeOff(Place()), estimate=STANDING)
    assert state.vehicle.flies
    assert state.plan_state is not None
    assert state.plan_state.p == STANDING.p_WB
    assert state.plan.since_us == NOW_US
    flying_on = replace(flying(), plan=PlanMemory(since_us=5))
    assert after(flying_on, SwitchMode(Mode.LAND)).plan.since_us == 5


def test_the_first_estimate_is_home() -> None:
    state, texts = completed(first_state(CONFIG.airframe))
    assert (state.vehicle.home, texts) == (Home(HERE, 0.5), [])


def test_a_takeoff_chosen_before_arming_is_dropped_with_a_warning() -> None:
    chosen = after(DISARMED, TakeOff(Place(height=3.0)), estimate=STANDING)
    assert completed(chosen, STANDING) == (chosen, [])
    wait_us = CONFIG.limits.takeoff_wait_us
    state, texts = completed(chosen, STANDING._replace(t_us=NOW_US + wait_us))
    assert state.vehicle.intended_mode is Mode.HOLD
    assert texts == ["takeoff cancelled: not armed within 10 s"]


@pytest.mark.requirement("REQ-SAFE-14")
@pytest.mark.parametrize("mode", [Mode.HOLD, Mode.LAND])
def test_what_follows_a_push_begins_off_its_surface(mode: Mode) -> None:
    """A landing would else drag the tool down the wall, beside which a failed rotor swings it."""
    begun = []
    for near in (0, 1):
        state = with_record(flying(Mode.OFFBOARD))
        state.record.pressing.near, state.record.pressing.normal[:] = near, (-0.8, 0.6, 0.0)
        state, _ = carried_out(state, SwitchMode(mode))
        begun.append(state.vehicle.mode_origin)
    moved = [one - other for one, other in zip(begun[1], begun[0], strict=True)]
    assert moved == pytest.approx([-0.24, 0.18, 0.0])
