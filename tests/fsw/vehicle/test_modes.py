"""The transition table as a whole."""

from __future__ import annotations

import pytest

from fsw.signals import Mode
from fsw.vehicle.modes import TRANSITIONS, Event, next_mode

FLYING = [mode for mode in Mode if mode not in (Mode.DISARMED, Mode.FAULT)]


@pytest.mark.parametrize("mode", FLYING)
def test_landing_terminating_disarming_and_holding_are_always_possible_in_flight(
    mode: Mode,
) -> None:
    assert next_mode(mode, Event.LAND) is Mode.LAND
    assert next_mode(mode, Event.HOLD) is Mode.HOLD
    assert next_mode(mode, Event.DISARM) is Mode.DISARMED
    assert next_mode(mode, Event.TERMINATE) is Mode.FAULT


@pytest.mark.parametrize("event", Event)
def test_nothing_leaves_a_terminated_vehicle(event: Event) -> None:
    assert next_mode(Mode.FAULT, event) is None


def test_a_disarmed_vehicle_can_only_be_armed_or_terminated() -> None:
    possible = {event for event in Event if next_mode(Mode.DISARMED, event) is not None}
    assert possible == {Event.ARM, Event.TERMINATE}


def test_a_landing_must_be_broken_off_before_anything_else_can_begin() -> None:
    for event in (Event.FOLLOW, Event.START_MISSION, Event.GO_OFFBOARD, Event.CIRCLE):
        before = {mode for mode in FLYING if next_mode(mode, event) is not None}
        assert before == set(FLYING) - {Mode.LAND}


def test_every_mode_can_be_reached_from_disarmed() -> None:
    reached = {Mode.DISARMED}
    for _ in Mode:
        reached |= {after for (before, _), after in TRANSITIONS.items() if before in reached}
    assert reached == set(Mode)


def test_every_event_means_something_somewhere() -> None:
    assert {event for _, event in TRANSITIONS} == set(Event)
