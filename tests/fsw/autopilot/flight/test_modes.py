"""Which mode can follow which, and that a mode is one file."""

from __future__ import annotations

from pathlib import Path

import pytest

import fsw.autopilot.flight.modes as modes_package
from fsw.autopilot.flight.commands.handlers import DENIED
from fsw.autopilot.flight.modes import MODES, NAV_STATES
from fsw.autopilot.signals import CommandResult, Mode
from tests.fsw.autopilot.flight.asked import FLIGHT_MODES, ask
from tests.fsw.autopilot.flight.contexts import READY, flying

FLYING = tuple(mode for mode, kind in MODES.items() if kind.px4.offered)
ARM_DISARM, SET_MODE, TERMINATE = 400, 176, 185


def custom(mode: Mode) -> tuple[float, float, float]:
    """DO_SET_MODE's parameters."""
    return 1.0, float(MODES[mode].px4.main), float(MODES[mode].px4.sub)


def test_every_mode_but_disarmed_and_terminated_is_one_file() -> None:
    assert set(MODES) == set(Mode) - {Mode.DISARMED, Mode.FAULT}
    files = {path.stem for path in Path(str(modes_package.__file__)).parent.glob("*.py")}
    assert files - {"__init__", "base"} == {
        kind.__module__.rpartition(".")[2] for kind in MODES.values()
    }
    assert len({kind.__module__ for kind in MODES.values()}) == len(MODES)


def test_no_two_modes_have_the_same_px4_number() -> None:
    offered = [kind.px4 for kind in MODES.values() if kind.px4.offered]
    assert len({(px4.main, px4.sub) for px4 in offered}) == len(offered) == len(MODES) - 1
    assert not MODES[Mode.DESCEND].px4.offered, "no command begins it"


@pytest.mark.parametrize("mode", FLYING)
@pytest.mark.parametrize("wanted", [Mode.HOLD, Mode.LAND])
def test_holding_and_landing_are_always_possible_in_flight(mode: Mode, wanted: Mode) -> None:
    assert FLIGHT_MODES[wanted].can_follow(FLIGHT_MODES[mode])
    decision = ask(flying(mode=mode), SET_MODE, *custom(wanted))
    assert decision.result == CommandResult.ACCEPTED
    assert decision.mode is (None if mode is wanted else wanted)


@pytest.mark.requirement("REQ-MODE-6")
@pytest.mark.parametrize("mode", FLYING)
def test_disarming_by_force_and_terminating_are_always_possible_in_flight(mode: Mode) -> None:
    assert ask(flying(mode=mode), ARM_DISARM, 0.0, 21196.0).mode is Mode.DISARMED
    assert ask(flying(mode=mode), TERMINATE, 1.0).mode is Mode.FAULT


@pytest.mark.requirement("REQ-MODE-7")
@pytest.mark.parametrize("wanted", FLYING)
def test_nothing_leaves_a_terminated_vehicle(wanted: Mode) -> None:
    decision = ask(flying(mode=Mode.FAULT), SET_MODE, *custom(wanted))
    assert decision.result != CommandResult.ACCEPTED
    assert decision.mode is None
    assert not ask(flying(mode=Mode.FAULT), ARM_DISARM, 1.0).arm


@pytest.mark.parametrize("wanted", FLYING)
def test_a_disarmed_vehicle_flies_in_no_mode_before_it_is_armed(wanted: Mode) -> None:
    assert ask(READY, SET_MODE, *custom(wanted)).mode is None


@pytest.mark.parametrize("wanted", FLYING)
def test_a_landing_is_interrupted_by_hold_and_return_alone(wanted: Mode) -> None:
    possible = FLIGHT_MODES[wanted].can_follow(FLIGHT_MODES[Mode.LAND])
    assert possible is (wanted in (Mode.HOLD, Mode.RETURN, Mode.LAND))


@pytest.mark.parametrize("wanted", [mode for mode in FLYING if mode is not Mode.TAKEOFF])
@pytest.mark.parametrize("mode", [mode for mode in MODES if mode is not Mode.LAND])
def test_any_other_mode_is_interrupted_by_any(mode: Mode, wanted: Mode) -> None:
    assert FLIGHT_MODES[wanted].can_follow(FLIGHT_MODES[mode])


def test_an_inconsistent_configuration_follows_no_trajectory() -> None:
    decision = ask(flying(refusals=("too small",)), SET_MODE, *custom(Mode.TRAJECTORY))
    assert decision.result == DENIED


def test_every_mode_has_the_number_that_px4_shows_for_its_main_and_sub_mode() -> None:
    """As PX4's own get_px4_custom_mode has them; Descend is shown as AUTO.LAND."""
    numbers = {
        (4, 2): 17, (4, 3): 4, (4, 4): 3, (4, 5): 5, (4, 6): 18, (6, 0): 14, (3, 1): 21,
        **{(4, 11 + k): 23 + k for k in range(8)},
    }  # fmt: skip
    shown = {mode: numbers[kind.px4.main, kind.px4.sub] for mode, kind in MODES.items()}
    assert {**shown, Mode.DESCEND: 12, Mode.DISARMED: 4, Mode.FAULT: 13} == NAV_STATES
