"""Whatever comes between two ticks is in the inputs of the next one, and in no other."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import pytest

from fsw.autopilot.signals import BatteryReading, SensorFrame, TickInputs
from fsw.link.inbox import Inbox
from messages import message_ids as ids
from messages.frames import FrameWriter, split

NONE = (0.0, 0.0, 0.0)
SENSORS = SensorFrame(1_002_000, NONE, NONE, (1.0, *NONE), NONE, NONE, NONE[:2], NONE[:2])


def frame(message_id: int, *values: float | bytes) -> Callable[[Inbox], None]:
    (one,) = split(FrameWriter(255, 190).frame(message_id, *values))
    return lambda inbox: inbox.accept(one)


NEWS: dict[str, tuple[str, Callable[[Inbox], None]]] = {
    "battery": ("battery", lambda inbox: inbox.accept_battery(BatteryReading(15.0, 0.5))),
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
