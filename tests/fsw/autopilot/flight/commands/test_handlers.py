"""Every command is accepted with its event or refused with a reason."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from functools import partial
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsw.autopilot.flight.commands.handlers import Decision, NewHeading, decide
from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.flight.situation import Situation
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.shapes.ball import point
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.vertical_cylinder import column
from fsw.autopilot.shapes.zones import surface
from fsw.autopilot.signals import (
    MAX_DISTANCE,
    BatteryState,
    ChangeSpeed,
    Command,
    CommandAction,
    CommandRequest,
    CommandResult,
    Facing,
    FlyOrbit,
    GoTo,
    Home,
    LookAt,
    MissionProgress,
    Mode,
    MoveJoints,
    Orbit,
    Order,
    Place,
    SafeSet,
    SetHome,
    SetMissionStep,
    StartMission,
    SwitchMode,
    TakeOff,
    Zone,
)
from fsw.link.wire.decode_commands import _READERS
from tests.fsw.autopilot.flight.asked import FLIGHT_MODES, ask
from tests.fsw.autopilot.flight.contexts import (
    AHEAD,
    FRESH,
    LOW,
    MISSION,
    STANDING,
    having,
    tuned_by,
)
from vehicles.vehicle_file import load_vehicle, vehicle_names

ACCEPTED, DENIED = CommandResult.ACCEPTED, CommandResult.DENIED
TEMPORARILY_REJECTED = CommandResult.TEMPORARILY_REJECTED
UNSUPPORTED = CommandResult.UNSUPPORTED
NAN = math.nan
ARM, TAKEOFF, LAND, SET_MODE, SHUTDOWN = 400, 22, 21, 176, 246

IDLING = having(STANDING, mode=Mode.HOLD)
HOLDING = having(STANDING, mode=Mode.HOLD, landed=False, stream=AHEAD)


@pytest.mark.parametrize(
    ("situation", "command", "params", "mode"),
    [
        (IDLING, ARM, (0.0,), Mode.DISARMED),
        (IDLING, TAKEOFF, (), Mode.TAKEOFF),
        (IDLING, SET_MODE, (1.0, 4.0, 2.0), Mode.TAKEOFF),
        (HOLDING, LAND, (), Mode.LAND),
        (HOLDING, SET_MODE, (1.0, 4.0, 6.0), Mode.LAND),
        (HOLDING, SET_MODE, (157.0, 4.0, 6.0), Mode.LAND),  # what a HEARTBEAT has, and armed
        (HOLDING, SET_MODE, (1.0, 4.0, 11.0), Mode.TRAJECTORY),
        (having(HOLDING, mode=Mode.TRAJECTORY), SET_MODE, (1.0, 4.0, 3.0), Mode.HOLD),
    ],
)
def test_a_command_in_order_switches_to_its_mode_whatever_unused_parameters_hold(
    situation: Situation, command: int, params: tuple[float, ...], mode: Mode
) -> None:
    assert ask(situation, command, *params) == Decision(ACCEPTED, mode=mode)


def test_arming_closes_the_loops() -> None:
    assert ask(STANDING, ARM, 1.0) == Decision(ACCEPTED, arm=True)


def test_a_disarm_in_the_air_needs_force_and_is_told_loudly() -> None:
    decision = ask(HOLDING, ARM, 0.0, 21196.0)
    assert (decision.result, decision.mode, decision.alarming) == (ACCEPTED, Mode.DISARMED, True)
    assert "255/190" in decision.reason


@pytest.mark.requirement("REQ-ARM-1")
def test_arming_by_force_says_what_it_ignores_and_never_ignores_the_estimate() -> None:
    broken = having(STANDING, refusals=("the sphere is too small",), p_WB=LOW)
    decision = ask(broken, ARM, 1.0, 21196.0)
    assert (decision.result, decision.arm, decision.alarming) == (ACCEPTED, True, True)
    assert "by force" in decision.reason
    assert ask(having(broken, invalid_ticks=1), ARM, 1.0, 21196.0).arm is False
    assert ask(STANDING, ARM, 1.0, 21196.0) == Decision(ACCEPTED, arm=True)


@pytest.mark.parametrize(
    ("situation", "command", "params", "word"),
    [
        (having(STANDING, invalid_ticks=1), ARM, (1.0,), "estimate"),
        (having(STANDING, mode=Mode.FAULT), ARM, (1.0,), "fault"),
        (HOLDING, ARM, (0.0,), "air"),
        (HOLDING, TAKEOFF, (), "air"),
        (STANDING, LAND, (), "disarmed"),
        (IDLING, SET_MODE, (1.0, 4.0, 11.0), "ground"),
        (having(HOLDING, stream=()), SET_MODE, (1.0, 4.0, 11.0), "END_EFFECTOR_TARGET"),
        (having(HOLDING, mode=Mode.LAND), SET_MODE, (1.0, 4.0, 11.0), "land"),
    ],
)
def test_a_command_out_of_place_is_refused_with_a_reason(
    situation: Situation, command: int, params: tuple[float, ...], word: str
) -> None:
    decision = ask(situation, command, *params)
    assert (decision.result, decision.mode) == (TEMPORARILY_REJECTED, None)
    assert word in decision.reason


@pytest.mark.parametrize(
    ("command", "params"),
    [
        (ARM, (NAN,)),
        (ARM, (math.inf,)),
        (ARM, (0.5,)),
        (ARM, (2.0,)),
        (SET_MODE, (0.0, 4.0, 6.0)),
        (SET_MODE, (28.0, 4.0, 6.0)),
        (SET_MODE, (128.0, 4.0, 6.0)),
        (SET_MODE, (NAN, 4.0, 6.0)),
        (SET_MODE, (math.inf, 4.0, 6.0)),
        (SET_MODE, (1.0, NAN, 3.0)),
        (SET_MODE, (1.0, math.inf, 3.0)),
        (SET_MODE, (1.0, 4.0, NAN)),
        (SET_MODE, (1.0, 4.0, 99.0)),
        (SET_MODE, (1.0, 1.0, 0.0)),
        (SET_MODE, (1.0, 1e30, 1e30)),
    ],
)
def test_a_parameter_that_means_nothing_is_denied(command: int, params: tuple[float, ...]) -> None:
    decision = ask(HOLDING, command, *params)
    assert (decision.result, decision.mode) == (DENIED, None)
    assert decision.reason


@pytest.mark.parametrize("command", [0, 16, 2500, 65535])
def test_an_unknown_command_is_unsupported_without_a_text(command: int) -> None:
    """Ground stations probe for much that is not there, and a text each would hide the others."""
    assert ask(HOLDING, command) == Decision(UNSUPPORTED)


@pytest.mark.parametrize(
    ("situation", "command", "params"),
    [
        (HOLDING, ARM, (1.0,)),
        (STANDING, ARM, (0.0,)),
        (HOLDING, SET_MODE, (1.0, 4.0, 3.0)),
        (having(HOLDING, mode=Mode.TRAJECTORY), SET_MODE, (1.0, 4.0, 11.0)),
        (having(HOLDING, mode=Mode.LAND), LAND, ()),
    ],
)
def test_asking_again_for_what_is_so_is_accepted_and_changes_nothing(
    situation: Situation, command: int, params: tuple[float, ...]
) -> None:
    decision = ask(situation, command, *params)
    assert (decision.result, decision.mode, decision.reason) == (ACCEPTED, None, "")


def test_shutdown_belongs_to_the_simulator_s_link_alone() -> None:
    decision = ask(STANDING, SHUTDOWN, 2.0)
    assert decision.result == DENIED
    assert "the console shuts down" in decision.reason


@pytest.mark.parametrize(
    ("height", "accepted"),
    [
        *[(height, True) for height in (1.5, math.nan, 50.0, 50.36, 0.58)],
        *[(height, False) for height in (0.3, 0.0, -1.5, 50.4, 0.5, 122.0)],
    ],
)
def test_a_takeoff_goes_to_a_height_above_where_the_vehicle_stands(
    height: float, accepted: bool
) -> None:
    standing = having(STANDING, mode=Mode.HOLD, p_WB=(0.0, 0.0, -0.32))
    decision = ask(standing, TAKEOFF, *[math.nan] * 6, height)
    assert (decision.mode is Mode.TAKEOFF) is accepted
    assert accepted or "height" in decision.reason
    if accepted and not math.isnan(height):
        assert decision.climb == pytest.approx(min(max(height - 0.32, 0.3), 50.0))


@pytest.mark.parametrize(
    ("command", "params", "intended"),
    [
        (TAKEOFF, (NAN,) * 6 + (2.0,), Mode.TAKEOFF),
        (SET_MODE, (1.0, 4.0, 2.0), Mode.TAKEOFF),
        (SET_MODE, (1.0, 4.0, 3.0), Mode.HOLD),
        (SET_MODE, (1.0, 4.0, 4.0), Mode.MISSION),
        (SET_MODE, (1.0, 6.0, 0.0), Mode.OFFBOARD),
    ],
)
def test_a_mode_can_be_chosen_before_arming(
    command: int, params: tuple[float, ...], intended: Mode
) -> None:
    ready = having(STANDING, flight=MISSION, offboard=FRESH, p_WB=(0.0, 0.0, -0.3))
    decision = ask(ready, command, *params)
    assert (decision.result, decision.mode, decision.intended_mode) == (ACCEPTED, None, intended)
    assert decision.climb == (pytest.approx(1.7) if command == TAKEOFF else None)


def test_starting_a_mission_arms_where_arming_is_possible() -> None:
    ready = having(STANDING, flight=MISSION)
    decision = ask(ready, 300, 0.0, 0.0)
    assert (decision.arm, decision.intended_mode) == (True, Mode.MISSION)
    blind = ask(having(ready, invalid_ticks=1), 300, 0.0, 0.0)
    assert (blind.result, blind.arm, blind.intended_mode) == (TEMPORARILY_REJECTED, False, None)
    assert "estimate" in blind.reason
    without = ask(STANDING, 300, 0.0, 0.0)
    assert (without.result, without.mode) == (TEMPORARILY_REJECTED, None)


@pytest.mark.parametrize("remaining", [0.0, 0.09])
def test_an_empty_battery_forbids_arming(remaining: float) -> None:
    decision = ask(having(STANDING, battery=BatteryState(remaining=remaining)), ARM, 1.0)
    assert decision.result == TEMPORARILY_REJECTED
    assert "battery" in decision.reason
    assert ask(having(STANDING, battery=BatteryState(remaining=0.1)), ARM, 1.0).arm


@pytest.mark.requirement("REQ-MODE-5")
@pytest.mark.parametrize("wanted", [Mode.HOLD, Mode.RETURN, Mode.LAND, Mode.OFFBOARD])
def test_while_nothing_else_can_be_flown_every_mode_is_refused(wanted: Mode) -> None:
    lost = (Condition.POSITION_LOST,)
    blocked = having(HOLDING, mode=Mode.DESCEND, offboard=FRESH, conditions=lost)
    decision = decided(SwitchMode(wanted), blocked)
    assert decision.result == TEMPORARILY_REJECTED
    assert decision.reason == f"no {wanted.value}: position unknown; the vehicle descends"
    assert decided(SwitchMode(wanted), having(blocked, conditions=())).mode is wanted
    assert ask(blocked, 185, 1.0).mode is Mode.FAULT


def test_termination_is_for_an_armed_vehicle() -> None:
    decision = ask(HOLDING, 185, 1.0)
    assert (decision.result, decision.mode, decision.alarming) == (ACCEPTED, Mode.FAULT, True)
    assert ask(STANDING, 185, 1.0).result == DENIED
    assert ask(HOLDING, 185, 0.5).result == DENIED, "as PX4: it cannot be taken back"
    assert ask(HOLDING, 185, 1e38).result == DENIED, "a number out of range is no wish"


@pytest.mark.parametrize("command", [310, 209])
def test_an_actuator_test_is_refused_with_a_reason(command: int) -> None:
    decision = ask(STANDING, command, 0.1)
    assert decision.result == DENIED
    assert "closed loop" in decision.reason


def test_the_checks_before_arming_can_be_asked_for() -> None:
    assert ask(STANDING, 401).reason == "ready to arm"
    assert "estimate" in ask(having(STANDING, invalid_ticks=1), 401).reason
    assert ask(HOLDING, 401).result == TEMPORARILY_REJECTED


def test_an_inconsistent_safe_set_forbids_arming_and_following() -> None:
    for situation, command in ((STANDING, (ARM, 1.0)), (HOLDING, (SET_MODE, 1.0, 4.0, 11.0))):
        decision = ask(having(situation, refusals=("the sphere is too small",)), *command)
        assert decision.result == DENIED
        assert "too small" in decision.reason


def test_a_terminated_vehicle_is_disarmed_already() -> None:
    assert ask(having(HOLDING, mode=Mode.FAULT), ARM, 0.0) == Decision(ACCEPTED)


def drawn(**vehicle: Any) -> st.SearchStrategy[Situation]:
    return st.builds(
        partial(having, STANDING),
        mode=st.sampled_from(Mode),
        landed=st.booleans(),
        invalid_ticks=st.integers(0, 1),
        stream=st.sampled_from([(), AHEAD]),
        **vehicle,
    )


vehicles = st.sampled_from([flight_config(vehicle=load_vehicle(name)) for name in vehicle_names()])
situations = drawn(config=vehicles)
commands = st.sampled_from([ARM, TAKEOFF, LAND, SET_MODE, SHUTDOWN, 1, 999])
Seven = tuple[float, float, float, float, float, float, float]
params = st.tuples(*[st.floats(allow_nan=True, allow_infinity=True)] * 7)


@given(commands, params, situations)
def test_whatever_arrives_is_answered_and_a_mode_can_always_follow(
    command: int, values: Seven, situation: Situation
) -> None:
    decision = ask(situation, command, *values)
    if decision.mode in FLIGHT_MODES:
        assert decision.result == ACCEPTED
        assert FLIGHT_MODES[decision.mode].can_follow(FLIGHT_MODES[situation.mode])
    if decision.arm:
        assert situation.mode is Mode.DISARMED
    if decision.result not in (ACCEPTED, UNSUPPORTED):
        assert decision.reason


@pytest.mark.requirement("REQ-MODE-8")
@given(situations)
def test_a_vehicle_in_the_air_is_not_disarmed_unless_forced(situation: Situation) -> None:
    decision = ask(having(situation, landed=False), ARM, 0.0)
    assert decision.mode is None


# ---------------------------------------------------------------- actions, as the link decodes them

REQUEST = CommandRequest(0, (NAN,) * 7, 255, 190)
HIGH = having(HOLDING, p_WB=(1.0, 2.0, -5.0), home=Home((0.0, 0.0, -0.5), 0.0))
CIRCLE = FlyOrbit(Place((4.0, 6.0), 5.0), 2.0)
WALLED = having(HIGH, safe_set=SafeSet((wall((-1.0, 0.0, 0.0), -10.0, 0.5),)))


def decided(action: CommandAction, context: Situation = HIGH) -> Decision:
    return decide(Command(action, REQUEST), context, FLIGHT_MODES)


def test_an_orbit_is_flown_around_its_place_in_its_mode() -> None:
    decision = decided(replace(CIRCLE, speed=0.3, clockwise=False, facing=Facing.TANGENT))
    assert (decision.result, decision.mode, decision.reason) == (ACCEPTED, Mode.ORBIT, "")
    goal = decision.goal
    assert goal is not None
    assert goal.orbit == Orbit((4.0, 6.0, -5.0), 2.0, 0.3, False, Facing.TANGENT)
    assert goal.motion.p == (4.0, 6.0, -5.0)
    again = decided(CIRCLE, having(HIGH, mode=Mode.ORBIT))
    assert (again.result, again.mode, again.goal is not None) == (ACCEPTED, None, True)


@pytest.mark.parametrize(
    ("asked", "usual", "flown", "slower"),
    [(0.3, 1.0, 0.3, False), (None, 0.2, 0.2, False), (None, 1.5, 0.48, False),
     (0.49, 1.0, 0.48, True), (9.0, 1.0, 0.48, True)],
)  # fmt: skip
def test_an_orbit_is_as_fast_as_asked_or_as_the_nose_can_turn_which_is_said(
    asked: float | None, usual: float, flown: float, slower: bool
) -> None:
    """A radius of 2 m at a turn rate of 0.3 rad/s, of which a fifth is kept for corrections."""
    decision = decided(replace(CIRCLE, speed=asked), having(HIGH, speed=usual))
    assert decision.goal is not None
    assert decision.goal.orbit is not None
    assert decision.goal.orbit.speed == pytest.approx(flown)
    assert decision.reason == ("orbit at 0.48 m/s: faster cannot be flown at 2 m" if slower else "")


def test_no_orbit_is_faster_than_the_vehicle_however_wide() -> None:
    wide = decided(replace(CIRCLE, radius=50.0, speed=9.0))
    assert wide.goal is not None
    assert wide.goal.orbit is not None
    assert wide.goal.orbit.speed == HIGH.config.steering.speed


@pytest.mark.parametrize(
    ("context", "result", "word"),
    [
        (having(HIGH, mode=Mode.LAND), TEMPORARILY_REJECTED, "not possible while land"),
        (
            having(HIGH, landed=True),
            TEMPORARILY_REJECTED,
            "no orbit: the vehicle is on the ground",
        ),
        (having(HIGH, mode=Mode.DISARMED), TEMPORARILY_REJECTED, "no orbit: the vehicle is not"),
        (tuned_by(HIGH, "limits.airborne_height", 5.0), DENIED, "no orbit: 5.0 m"),
    ],
)
def test_an_orbit_that_cannot_be_flown_now_is_refused(
    context: Situation, result: CommandResult, word: str
) -> None:
    decision = decided(CIRCLE, context)
    assert (decision.result, decision.goal, decision.mode) == (result, None, None)
    assert word in decision.reason


@pytest.mark.parametrize(
    ("radius", "north", "refused"),
    [
        (2.0, 7.49, False),
        (2.0, 7.5, True),
        (4.0, 5.49, False),
        (4.0, 5.51, True),
        (1.0, 20.0, True),
    ],
)
def test_a_circle_keeps_the_clearance_of_a_wall_with_its_nearest_point(
    radius: float, north: float, refused: bool
) -> None:
    decision = decided(FlyOrbit(Place((north, 0.0), 5.0), radius), WALLED)
    assert (decision.result == DENIED) is refused
    assert ("zone 1" in decision.reason) is refused


def test_a_circle_is_wider_than_a_slanted_wall_sees_it_only_along_the_ground() -> None:
    slanted = having(HIGH, safe_set=SafeSet((wall((0.6, 0.0, -0.8), 0.0, 0.5),)))  # rises north
    assert decided(FlyOrbit(Place((0.0, 0.0), 5.0), 5.8), slanted).result == ACCEPTED
    assert decided(FlyOrbit(Place((0.0, 0.0), 5.0), 5.9), slanted).result == DENIED


@pytest.mark.parametrize(
    ("obstacle", "refused"),
    [
        (point((6.4, 6.0, -5.0), 0.5), True),  # 0.4 m outside the circle
        (point((6.6, 6.0, -5.0), 0.5), False),
        (point((5.6, 6.0, -5.0), 0.5), True),  # as much inside
        (point((5.4, 6.0, -5.0), 0.5), False),
        (point((6.0, 6.0, -5.6), 0.5), False),  # above a point of it
        (point((6.0, 6.0, -4.6), 0.5), True),
        (column((6.0, 6.0), 0.5), True),  # at any height
        (point((4.0, 6.0, -5.0), 1.9), False),  # in the middle
    ],
)
def test_a_circle_keeps_clear_of_points_beside_above_and_inside(
    obstacle: Zone, refused: bool
) -> None:
    decision = decided(CIRCLE, having(HIGH, safe_set=SafeSet((obstacle,))))
    assert (decision.result == DENIED) is refused
    assert ("zone 1" in decision.reason) is refused


def test_zones_far_from_a_circle_cost_one_look_each(monkeypatch: pytest.MonkeyPatch) -> None:
    """A burst of 16 orbits with 64 zones took 1.8 s of one tick, and the flight was ended."""
    looks = itertools.count()

    def looked(*given: Any) -> Any:
        next(looks)
        return surface(*given)

    monkeypatch.setattr("fsw.autopilot.flight.commands.handlers.surface", looked)
    far = tuple(point((200.0, 6.0 * k, -5.0), 0.5) for k in range(63))
    near = having(HIGH, safe_set=SafeSet((*far, point((6.4, 6.0, -5.0), 0.5))))
    assert decided(CIRCLE, near).result == DENIED
    assert next(looks) < 300


@pytest.mark.parametrize(
    ("speed", "refused"), [(0.0099, True), (0.01, False), (1.5, False), (1.51, True), (None, False)]
)
def test_a_speed_is_changed_within_its_range(speed: float | None, refused: bool) -> None:
    decision = decided(ChangeSpeed(speed))
    assert decision.result == (DENIED if refused else ACCEPTED)
    assert decision.speed == (None if refused else ChangeSpeed(speed))


def test_the_nose_is_turned_to_a_place_of_an_armed_vehicle_and_freed_anywhere() -> None:
    look = LookAt(Place((3.0, 4.0), 1.0))
    assert decided(look).look_at == NewHeading((3.0, 4.0, -1.0))
    assert decided(look, STANDING).result == TEMPORARILY_REJECTED
    assert decided(look, having(HIGH, mode=Mode.FAULT)).result == TEMPORARILY_REJECTED
    assert decided(LookAt(Place((MAX_DISTANCE, 1.0), 0.0))).result == DENIED
    assert decided(LookAt(Place((MAX_DISTANCE, 0.0), 0.0))).result == ACCEPTED
    assert decided(LookAt(None), STANDING) == Decision(ACCEPTED, look_at=NewHeading(None))


@pytest.mark.parametrize(
    ("height", "climb"),
    [(5.3, 0.3), (5.26, 0.3), (5.24, None), (55.0, 50.0), (55.04, 50.0), (55.06, None), (7.0, 2.0)],
)
def test_a_takeoff_climbs_to_its_height_within_what_a_ground_station_rounds(
    height: float, climb: float | None
) -> None:
    standing = having(HIGH, landed=True)
    decision = decided(TakeOff(Place(height=height)), standing)
    assert decision.climb == (None if climb is None else pytest.approx(climb))
    if climb is None:
        assert decision.result == TEMPORARILY_REJECTED
        assert "outside 5.3 to 55.0 m" in decision.reason
    above_home = decided(TakeOff(Place(height=height - 0.5, above_home=True)), standing)
    assert above_home.climb == decision.climb or above_home.climb == pytest.approx(decision.climb)


@pytest.mark.parametrize("home", [None, HIGH.vehicle.home])
def test_a_height_above_home_needs_a_home_or_counts_from_the_origin(home: Home | None) -> None:
    goal = decided(GoTo(Place((1.0, 1.0), 3.0, above_home=True)), having(HIGH, home=home)).goal
    assert goal is not None
    assert goal.motion.p == (1.0, 1.0, -3.0 if home is None else -3.5)


def test_a_place_without_coordinates_is_the_present_one() -> None:
    goal = decided(GoTo(Place(), yaw=0.3)).goal
    assert goal is not None
    assert (goal.motion.p, goal.motion.yaw) == (HIGH.estimate.p_WB, 0.3)


def uploaded(total: int, current: int = 0, **changes: object) -> Situation:
    progress = MissionProgress(total=total, current=current)
    return having(HIGH, flight=replace(MISSION, progress=progress), **changes)


@pytest.mark.parametrize(
    ("first", "last", "result", "step"),
    [
        (0.0, 0.0, ACCEPTED, None),
        (0.0, 2.0, ACCEPTED, None),
        (0.0, 1.0, DENIED, None),
        (1.0, 0.0, ACCEPTED, 1),
        (2.0, 9.0, ACCEPTED, 2),
        (3.0, 0.0, DENIED, None),
    ],
)
def test_a_mission_starts_at_a_step_and_goes_on_to_its_end(
    first: float, last: float, result: CommandResult, step: int | None
) -> None:
    decision = decided(StartMission(first, last), uploaded(3))
    assert (decision.result, decision.mission_step) == (result, step)
    assert decision.mode is (Mode.MISSION if result == ACCEPTED else None)


def test_a_mission_that_starts_on_the_ground_arms_if_arming_is_possible() -> None:
    standing = uploaded(3, mode=Mode.DISARMED, landed=True)
    decision = decided(StartMission(), standing)
    assert (decision.arm, decision.intended_mode, decision.mode) == (True, Mode.MISSION, None)
    unclear = decided(StartMission(), having(standing, p_WB=LOW))
    assert (unclear.result, unclear.arm) == (TEMPORARILY_REJECTED, False)


@pytest.mark.parametrize(
    ("number", "reset", "step"),
    [(0.0, False, 0), (2.0, False, 2), (3.0, False, None), (-1.0, False, 1), (-1.0, True, 0),
     (-2.0, False, None)],
)  # fmt: skip
def test_the_current_step_is_set_if_there_is_one(
    number: float, reset: bool, step: int | None
) -> None:
    decision = decided(SetMissionStep(number, reset), uploaded(3, current=1))
    assert (decision.mission_step, decision.result == ACCEPTED) == (step, step is not None)


@pytest.mark.parametrize(
    ("mode", "stops"), [(Mode.MISSION, True), (Mode.HOLD, True), (Mode.OFFBOARD, False)]
)
def test_a_mission_is_paused_by_holding(mode: Mode, stops: bool) -> None:
    decision = decided(Order.PAUSE_MISSION, having(HIGH, mode=mode))
    assert (decision.result == ACCEPTED) is stops
    assert decision.mode is (Mode.HOLD if mode is Mode.MISSION else None)
    assert decision.stop is (mode is Mode.HOLD)


def test_arming_checks_are_made_on_the_ground_and_answered_in_words() -> None:
    assert decided(Order.CHECK_ARMING, STANDING).reason == "ready to arm"
    nearly_empty = having(STANDING, battery=BatteryState(remaining=0.0))
    assert "battery" in decided(Order.CHECK_ARMING, nearly_empty).reason
    ended = decided(Order.CHECK_ARMING, having(STANDING, mode=Mode.FAULT))
    assert ended.result == DENIED
    assert "terminated; restart the flight software" in ended.reason
    assert decided(Order.CHECK_ARMING).result == TEMPORARILY_REJECTED


@pytest.mark.parametrize("mode", [Mode.LAND, Mode.MISSION])
def test_joints_are_moved_in_hold_alone(mode: Mode) -> None:
    decision = decided(MoveJoints((0.1, 0.1)), having(HIGH, mode=mode))
    assert (decision.result, decision.joints) == (TEMPORARILY_REJECTED, None)
    assert "hold first" in decision.reason
    kept = decided(MoveJoints((None, None)), having(HIGH, q_arm=(0.2, -0.3)))
    assert kept.joints == (0.2, -0.3)


def test_home_needs_an_estimate_and_keeps_the_heading() -> None:
    assert decided(SetHome(None), having(HIGH, yaw=0.7)).home == Home(HIGH.estimate.p_WB, 0.7)
    lost = decided(SetHome(None), having(HIGH, invalid_ticks=1))
    assert (lost.result, lost.home) == (TEMPORARILY_REJECTED, None)


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({}, ""),
        (
            {"config": tuned_by(HIGH, "steering.highest", 4.0).config},
            "5.0 m above the origin is too high; the maximum is 4 m",
        ),
        ({"fence": SafeSet((wall((-1.0, 0.0, 0.0), -8.0, 0.1),))}, "outside the fence, by 1.10 m"),
        ({"sender": (1, 1), "home_owner": (255, 190)}, "while armed only 255/190"),
    ],
)
def test_home_is_below_the_ceiling_inside_the_fence_and_its_owners(
    changes: dict[str, object], why: str
) -> None:
    decision = decided(SetHome(Place((9.0, 0.0), 5.0)), having(HIGH, **changes))
    assert (decision.home is None) is bool(why)
    assert why in decision.reason
    assert decision.result == (DENIED if why else ACCEPTED)
    assert decision.reason.startswith("home not set by" if why else "home set by")


@pytest.mark.requirement("REQ-ARM-9")
@pytest.mark.parametrize("situation", [STANDING, HIGH])
def test_a_failure_is_injected_only_where_the_parameter_allows_it(
    situation: Situation,
) -> None:
    refused = ask(situation, 420, 0.0, 1.0, 0.0)
    assert refused.result == DENIED
    assert "SYS_FAILURE_EN" in refused.reason
    allowed = tuned_by(situation, "limits.failure_injection", 1)
    assert ask(allowed, 420, 0.0, 1.0, NAN) == Decision(CommandResult.IN_PROGRESS)
    assert ask(allowed, 420, 0.5, 1.0, 0.0).result == DENIED
    assert ask(allowed, 420, math.inf, 1.0, 0.0).result == DENIED


@pytest.mark.parametrize("number", range(1, 8))
@pytest.mark.parametrize("value", [math.inf, -math.inf])
@pytest.mark.parametrize("command", sorted(_READERS))
def test_no_parameter_of_any_command_may_be_infinite(
    command: int, value: float, number: int
) -> None:
    """DO_REPOSITION to an infinite heading was accepted."""
    params = [math.nan] * 7
    params[number - 1] = value
    decision = ask(tuned_by(HOLDING, "limits.failure_injection", 1), command, *params)
    assert decision.result == DENIED
    assert f"param{number} is infinite" in decision.reason


@pytest.mark.parametrize(
    ("params", "accepted"),
    [
        ((math.nan, 1.0, math.nan, 12.5), True),
        ((math.nan, 1.0, math.nan, 12.6), False),
        ((math.nan, 1.0, math.nan, -1e9), False),
        ((20.0, 1.0), True),
        ((20.1, 1.0), False),
        ((-1.0, 1.0), True),
        ((1.0, 3.4e38), False),
        ((1.0, -1.0), False),
    ],
)
def test_heading_speed_and_flags_of_a_place_are_in_range(
    params: tuple[float, ...], accepted: bool
) -> None:
    decision = ask(having(HOLDING, p_WB=(0.0, 0.0, -2.0)), 192, *params)
    assert (decision.result == ACCEPTED) is accepted, decision
    assert accepted or decision.reason.startswith("no goto: ")


def test_a_speed_that_is_not_flown_is_told() -> None:
    decision = ask(having(HOLDING, p_WB=(0.0, 0.0, -2.0)), 192, 5.0, 1.0)
    assert decision.result == ACCEPTED
    assert decision.reason == "goto at 1.5 m/s: faster is not flown (STR_V_MAX)"


def test_a_place_above_the_highest_height_is_refused() -> None:
    low = tuned_by(HOLDING, "steering.highest", 5.0)
    for command in (192, 34):
        decision = ask(low, command, *[math.nan] * 6, 5.5)
        assert decision.result == DENIED
        assert decision.reason.endswith("too high; the maximum is 5 m")


def test_above_px4_disarming_gives_back_and_its_rotors_are_not_ours_to_stop() -> None:
    above = replace(HOLDING, config=replace(HOLDING.config, inner="px4"))
    given_back = ask(above, ARM, 0.0)
    assert (given_back.result, given_back.mode, given_back.reason) == (ACCEPTED, Mode.DISARMED, "")
    refused = ask(above, 185, 1.0)
    assert refused.result == DENIED
    assert "PX4's" in refused.reason
