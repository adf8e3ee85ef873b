"""Every command is accepted with its event or refused with a reason."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsw.flight.command_handlers import Decision
from fsw.flight.modes.base import CommandContext
from fsw.signals import Charge, CommandResult, Mode
from tests.fsw.flight.asked import FLIGHT_MODES, ask
from tests.fsw.flight.contexts import STANDING

ACCEPTED, DENIED = CommandResult.ACCEPTED, CommandResult.DENIED
TEMPORARILY_REJECTED = CommandResult.TEMPORARILY_REJECTED
UNSUPPORTED = CommandResult.UNSUPPORTED
NAN = math.nan
ARM, TAKEOFF, LAND, SET_MODE, SHUTDOWN = 400, 22, 21, 176, 246

IDLING = replace(STANDING, mode=Mode.HOLD)
HOLDING = replace(STANDING, mode=Mode.HOLD, landed=False, targets_ahead=True)


@pytest.mark.parametrize(
    ("situation", "command", "params", "mode"),
    [
        (IDLING, ARM, (0.0,), Mode.DISARMED),
        (IDLING, TAKEOFF, (), Mode.TAKEOFF),
        (IDLING, SET_MODE, (1.0, 4.0, 2.0), Mode.TAKEOFF),
        (HOLDING, LAND, (), Mode.LAND),
        (HOLDING, SET_MODE, (1.0, 4.0, 6.0), Mode.LAND),
        (HOLDING, SET_MODE, (1.0, 4.0, 11.0), Mode.TRAJECTORY),
        (replace(HOLDING, mode=Mode.TRAJECTORY), SET_MODE, (1.0, 4.0, 3.0), Mode.HOLD),
    ],
)
def test_a_command_in_order_switches_to_its_mode_whatever_unused_parameters_hold(
    situation: CommandContext, command: int, params: tuple[float, ...], mode: Mode
) -> None:
    assert ask(situation, command, *params) == Decision(ACCEPTED, mode=mode)


def test_arming_closes_the_loops() -> None:
    assert ask(STANDING, ARM, 1.0) == Decision(ACCEPTED, arm=True)


def test_a_disarm_in_the_air_needs_force_and_is_told_loudly() -> None:
    decision = ask(HOLDING, ARM, 0.0, 21196.0)
    assert (decision.result, decision.mode, decision.alarming) == (ACCEPTED, Mode.DISARMED, True)
    assert "255/190" in decision.reason


def test_arming_by_force_says_what_it_ignores_and_never_ignores_the_estimate() -> None:
    broken = replace(STANDING, inconsistent="the sphere is too small", standing_unclear=True)
    decision = ask(broken, ARM, 1.0, 21196.0)
    assert (decision.result, decision.arm, decision.alarming) == (ACCEPTED, True, True)
    assert "by force" in decision.reason
    assert ask(replace(broken, estimate_valid=False), ARM, 1.0, 21196.0).arm is False
    assert ask(STANDING, ARM, 1.0, 21196.0) == Decision(ACCEPTED, arm=True)


@pytest.mark.parametrize(
    ("situation", "command", "params", "word"),
    [
        (replace(STANDING, estimate_valid=False), ARM, (1.0,), "estimate"),
        (replace(STANDING, mode=Mode.FAULT), ARM, (1.0,), "fault"),
        (HOLDING, ARM, (0.0,), "air"),
        (HOLDING, TAKEOFF, (), "air"),
        (STANDING, LAND, (), "disarmed"),
        (IDLING, SET_MODE, (1.0, 4.0, 11.0), "ground"),
        (replace(HOLDING, targets_ahead=False), SET_MODE, (1.0, 4.0, 11.0), "END_EFFECTOR_TARGET"),
        (replace(HOLDING, mode=Mode.LAND), SET_MODE, (1.0, 4.0, 11.0), "land"),
    ],
)
def test_a_command_out_of_place_is_refused_with_a_reason(
    situation: CommandContext, command: int, params: tuple[float, ...], word: str
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
        (replace(HOLDING, mode=Mode.TRAJECTORY), SET_MODE, (1.0, 4.0, 11.0)),
        (replace(HOLDING, mode=Mode.LAND), LAND, ()),
    ],
)
def test_asking_again_for_what_is_so_is_accepted_and_changes_nothing(
    situation: CommandContext, command: int, params: tuple[float, ...]
) -> None:
    decision = ask(situation, command, *params)
    assert (decision.result, decision.mode, decision.reason) == (ACCEPTED, None, "")


def test_shutdown_belongs_to_the_simulator_s_link_alone() -> None:
    assert ask(STANDING, SHUTDOWN, 2.0).result == UNSUPPORTED


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
    standing = replace(STANDING, mode=Mode.HOLD, position=(0.0, 0.0, -0.32))
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
    ready = replace(STANDING, mission_refusal=None, setpoint_fresh=True, position=(0.0, 0.0, -0.3))
    decision = ask(ready, command, *params)
    assert (decision.result, decision.mode, decision.intended_mode) == (ACCEPTED, None, intended)
    assert decision.climb == (pytest.approx(1.7) if command == TAKEOFF else None)


def test_starting_a_mission_arms_where_arming_is_possible() -> None:
    ready = replace(STANDING, mission_refusal=None)
    decision = ask(ready, 300, 0.0, 0.0)
    assert (decision.arm, decision.intended_mode) == (True, Mode.MISSION)
    blind = ask(replace(ready, estimate_valid=False), 300, 0.0, 0.0)
    assert (blind.result, blind.arm, blind.intended_mode) == (TEMPORARILY_REJECTED, False, None)
    assert "estimate" in blind.reason
    without = ask(STANDING, 300, 0.0, 0.0)
    assert (without.result, without.mode) == (TEMPORARILY_REJECTED, None)


@pytest.mark.parametrize("charge", [Charge.CRITICAL, Charge.EMERGENCY])
def test_an_empty_battery_forbids_arming(charge: Charge) -> None:
    decision = ask(replace(STANDING, charge=charge), ARM, 1.0)
    assert decision.result == TEMPORARILY_REJECTED
    assert "battery" in decision.reason
    assert ask(replace(STANDING, charge=Charge.LOW), ARM, 1.0).arm


def test_termination_is_for_an_armed_vehicle() -> None:
    decision = ask(HOLDING, 185, 1.0)
    assert (decision.result, decision.mode, decision.alarming) == (ACCEPTED, Mode.FAULT, True)
    assert ask(STANDING, 185, 1.0).result == DENIED
    assert ask(HOLDING, 185, 0.0) == Decision(ACCEPTED)


@pytest.mark.parametrize("command", [310, 209])
def test_an_actuator_test_is_refused_with_a_reason(command: int) -> None:
    decision = ask(STANDING, command, 0.1)
    assert decision.result == DENIED
    assert "closed loop" in decision.reason


def test_the_checks_before_arming_can_be_asked_for() -> None:
    assert ask(STANDING, 401).reason == "ready to arm"
    assert "estimate" in ask(replace(STANDING, estimate_valid=False), 401).reason
    assert ask(HOLDING, 401).result == TEMPORARILY_REJECTED


def test_an_inconsistent_safe_set_forbids_arming_and_following() -> None:
    for situation, command in ((STANDING, (ARM, 1.0)), (HOLDING, (SET_MODE, 1.0, 4.0, 11.0))):
        decision = ask(replace(situation, inconsistent="the sphere is too small"), *command)
        assert decision.result == DENIED
        assert "too small" in decision.reason


def test_a_terminated_vehicle_is_disarmed_already() -> None:
    assert ask(replace(HOLDING, mode=Mode.FAULT), ARM, 0.0) == Decision(ACCEPTED)


situations = st.builds(
    CommandContext,
    mode=st.sampled_from(Mode),
    landed=st.booleans(),
    estimate_valid=st.booleans(),
    targets_ahead=st.booleans(),
)
params = st.tuples(*[st.floats(allow_nan=True, allow_infinity=True)] * 7)


@given(st.sampled_from([ARM, TAKEOFF, LAND, SET_MODE, SHUTDOWN, 1, 999]), params, situations)
def test_whatever_arrives_is_answered_and_a_mode_can_always_follow(
    command: int,
    values: tuple[float, float, float, float, float, float, float],
    situation: CommandContext,
) -> None:
    decision = ask(situation, command, *values)
    if decision.mode in FLIGHT_MODES:
        assert decision.result == ACCEPTED
        assert FLIGHT_MODES[decision.mode].can_follow(FLIGHT_MODES[situation.mode])
    if decision.arm:
        assert situation.mode is Mode.DISARMED
    if decision.result not in (ACCEPTED, UNSUPPORTED):
        assert decision.reason


@given(situations)
def test_a_vehicle_in_the_air_is_not_disarmed_unless_forced(situation: CommandContext) -> None:
    decision = ask(replace(situation, landed=False), ARM, 0.0)
    assert decision.mode is None
