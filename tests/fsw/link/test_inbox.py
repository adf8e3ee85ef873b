"""Whatever comes between two ticks is in the inputs of the next one, and in no other."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import pytest

from fsw.autopilot.signals import MessageSource, SensorFrame, TickInputs
from fsw.link.inbox import Inbox
from messages import message_ids as ids
from messages.frames import FrameWriter, split

NONE = (0.0, 0.0, 0.0)
SENSORS = SensorFrame(1_002_000, NONE, NONE, (1.0, *NONE), NONE, NONE, NONE[:2], NONE[:2])
BATTERY = (0, 0, 0, 15_000, *(0,) * 13, 50)  # of a BATTERY_STATUS: mV, %


def frame(message_id: int, *values: float | bytes) -> Callable[[Inbox], None]:
    (one,) = split(FrameWriter(255, 190).frame(message_id, *values))
    return lambda inbox: inbox.accept(one)


NEWS: dict[str, tuple[str, Callable[[Inbox], None]]] = {
    "battery": ("battery", lambda inbox: inbox.accept_battery(BATTERY)),
    "jump": ("sensor_clock_jump_us", lambda inbox: inbox.accept_clock_jump(-4_000)),
    "command": ("commands", frame(ids.COMMAND_LONG, 1.0, *NONE, *NONE, 400, 1, 1, 0)),
    "station": ("ground_station_heard", frame(ids.HEARTBEAT, 0, 6, 8, 0, 4, 3)),
    "refused": (
        "refused_setpoints",
        frame(ids.SET_ATTITUDE_TARGET, 0, *(float("nan"),) * 4, *NONE, 0.5, 9, 1, 0),
    ),
}


def taken(inbox: Inbox) -> TickInputs:
    return inbox.take_inputs(SENSORS, None, None, None)


@pytest.mark.parametrize(("field", "accept"), NEWS.values(), ids=NEWS)
def test_news_by_itself_is_in_the_next_tick_alone(
    field: str, accept: Callable[[Inbox], None]
) -> None:
    inbox = Inbox()
    nothing = taken(inbox)
    assert nothing == TickInputs(SENSORS)
    accept(inbox)
    inputs = taken(inbox)
    changed = [
        one.name
        for one in dataclasses.fields(TickInputs)
        if getattr(inputs, one.name) != getattr(nothing, one.name)
    ]
    assert changed == [field]
    assert taken(inbox) == nothing


OWNER = MessageSource(66, 6, "gcs", "127.0.0.1:5555")


def ball(
    inbox: Inbox, source: MessageSource, index: int, count: int, north: float, radius: float = 0.5
) -> None:
    """One ball of a set arrives."""
    begin, tail = (0, 0.1, *NONE, north, 0.0, -1.0, radius), (1, 0, index, count, 1, 0)
    writer = FrameWriter(source.system, source.component)
    (one,) = split(writer.frame(ids.OBSTACLE_SHAPE, *begin, *(0.0,) * 12, *tail, *(0.0,) * 5, 0))
    inbox.accept(one, source)


def norths(inbox: Inbox, source: MessageSource) -> list[float]:
    """Where the balls are that are announced by a source."""
    sets = [one.safe_set for one in inbox.take().announced if one.source == source]
    return [zone.shape.numbers[0] for one in sets for zone in one.zones]


def stranger(k: int, port: int = 1) -> MessageSource:
    return MessageSource(100 + k, 1, "gcs", f"127.0.0.1:{port}")


def test_a_zone_that_is_refused_leaves_out_its_set_and_no_other() -> None:
    """With the next set, of as many zones, the rest of the last one was in force."""
    inbox = Inbox()
    ball(inbox, OWNER, 0, 2, 1.0, radius=float("nan"))
    ball(inbox, OWNER, 1, 2, 2.0)
    for north in (3.0, 5.0):
        ball(inbox, OWNER, 0, 2, north)
        ball(inbox, OWNER, 1, 2, north + 1.0)
        assert norths(inbox, OWNER) == [north, north + 1.0]


def test_a_set_of_which_a_zone_is_lost_is_told_once() -> None:
    inbox = Inbox()
    for index in (0, 2, 3):
        ball(inbox, OWNER, index, 4, 1.0)
    (text,) = inbox.take().refused
    assert "zone 3 of 4 does not follow" in text
    assert str(OWNER) in text
    assert inbox.refused == 2


@pytest.mark.parametrize("place", ["incomplete", "whole"])
def test_who_writes_many_ids_keeps_nobody_else_s_set_out(place: str) -> None:
    """One socket, which wrote eight, kept the owner's out, and nothing was said."""
    inbox = Inbox()
    for index in (0, 1):
        for k in range(8):
            ball(inbox, stranger(k), 0, 2 if place == "incomplete" else 1, 50.0)
        ball(inbox, OWNER, index, 2, float(index))
    received = inbox.take()
    assert any(one.source == OWNER for one in received.announced)
    assert "too many sources" in received.refused[0]
    assert inbox.refused >= 6


@pytest.mark.parametrize("place", ["incomplete", "whole"])
def test_the_owner_of_the_safe_set_is_heard_whoever_else_speaks(place: str) -> None:
    inbox = Inbox()
    inbox.owner = OWNER
    for index in (0, 1):
        ball(inbox, OWNER, index, 2, float(index))
        for k in range(40):
            ball(inbox, stranger(k, port=k), 0, 2 if place == "incomplete" else 1, 50.0)
    assert norths(inbox, OWNER) == [0.0, 1.0]
    for k in range(40):
        ball(inbox, stranger(k, port=k), 0, 1, 50.0)
    for index in (0, 1):
        ball(inbox, OWNER, index, 2, float(index))
    received = inbox.take()
    assert OWNER in [one.source for one in received.announced]
    assert len(received.announced) <= 4


def test_what_makes_way_for_the_owner_is_told() -> None:
    inbox = Inbox()
    inbox.owner = OWNER
    for k in range(4):
        ball(inbox, stranger(k, port=k), 0, 1, 50.0)
    assert inbox.refused == 0
    ball(inbox, OWNER, 0, 1, 1.0)
    received = inbox.take()
    assert [one.source for one in received.announced] == [*map(stranger, range(3), range(3)), OWNER]
    assert (inbox.refused, len(received.refused)) == (1, 1)


def test_who_has_been_there_for_longer_keeps_its_place() -> None:
    """Its place was that of its last zone, and the next newcomer took it."""
    inbox = Inbox()
    for index in range(3):
        ball(inbox, OWNER, index, 3, float(index))
        for k in range(20):
            ball(inbox, stranger(k, port=100 * index + k), 0, 2, 50.0)
    assert norths(inbox, OWNER) == [0.0, 1.0, 2.0]
