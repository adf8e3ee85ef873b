"""Tests of where a page is in a flight."""

from view.scene import Event
from view.timeline import Timeline

AT = Timeline(begin=1.0, end=11.0, t=5.0)
EVENTS = (Event(2.0, "mode", "a"), Event(5.0, "text", "b"), Event(8.0, "text", "c"))


def test_time_passes_only_while_playing_and_at_the_chosen_speed() -> None:
    assert AT.advance(1.0) == AT
    fast = Timeline(1.0, 11.0, 5.0, speed=4.0, playing=True)
    assert fast.advance(0.5).t == 7.0


def test_the_end_stops_it_and_play_begins_again() -> None:
    over = Timeline(1.0, 11.0, 10.5, playing=True).advance(1.0)
    assert (over.t, over.playing) == (11.0, False)
    assert (over.toggle().t, over.toggle().playing) == (1.0, True)


def test_a_jump_stops_within_the_flight() -> None:
    assert Timeline(1.0, 11.0, 5.0, playing=True).go_to(99.0) == Timeline(1.0, 11.0, 11.0)
    assert AT.go_to(0.0).t == 1.0


def test_jumps_go_to_the_next_event_of_a_kind() -> None:
    assert AT.next_event(EVENTS).t == 8.0
    assert AT.previous_event(EVENTS).t == 2.0
    assert AT.previous_event(EVENTS, "text") == AT
    assert AT.next_event(EVENTS, "mode") == AT
