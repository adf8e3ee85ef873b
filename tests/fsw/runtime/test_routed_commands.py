"""Which commands go on to the simulator."""

from __future__ import annotations

import math

from fsw.autopilot.signals import (
    Command,
    CommandAck,
    CommandAction,
    CommandRequest,
    CommandResult,
    InjectFailure,
    Mode,
    SwitchMode,
)
from fsw.runtime.flight_loop import to_route

INJECT_FAILURE = 420
GOES_ON, DENIED = CommandResult.IN_PROGRESS, CommandResult.DENIED


def asked(
    unit: float, action: CommandAction, number: int = INJECT_FAILURE, unused: float = 0.0
) -> Command:
    """A command of the same sender as all others here."""
    return Command(action, CommandRequest(number, (unit, 1.0, *(unused,) * 5), 255, 190))


def answer(result: CommandResult, number: int = INJECT_FAILURE) -> CommandAck:
    return CommandAck(number, result, 255, 190)


def test_each_command_of_one_sender_goes_on_once() -> None:
    first, second = asked(1.0, InjectFailure(1, 1, 0)), asked(2.0, InjectFailure(2, 1, 0))
    assert to_route((first, second), (answer(GOES_ON),) * 2) == [first.request, second.request]


def test_what_was_denied_does_not_go_on_beside_what_was_not() -> None:
    first, second = asked(1.0, InjectFailure(1, 1, 0)), asked(2.0, InjectFailure(2, 1, 0))
    hold = asked(0.0, SwitchMode(Mode.HOLD), 176)
    acks = (answer(DENIED), answer(CommandResult.ACCEPTED, 176), answer(GOES_ON))
    assert to_route((first, hold, second), acks) == [second.request]
    assert to_route((), ()) == []


def test_what_mavlink_leaves_out_as_nan_goes_on_as_what_was_understood() -> None:
    action = InjectFailure(1, 1, 0)
    (sent,) = to_route((asked(1.0, action, unused=math.nan),), (answer(GOES_ON),))
    assert sent == asked(1.0, action).request
