"""A command that is sent again because its ACK was lost must not act twice.

Answers are remembered for as long as nothing else has changed what the vehicle does: the commander
forgets them when a failsafe or another command does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fsw.signals import CommandRequest, CommandResult

_AT_ONCE_US = 500_000  # the same words within this are the same command
_RESENT_US = 3_000_000  # a command that says it is a repetition: four sends half a second apart
_SENDERS = 8  # remembered; a flood of senders must not grow the memory

Words = tuple[int, int | None, tuple[float | None, ...]]
"""Command, frame and parameters; None for NaN, so that the same words are equal."""


@dataclass(frozen=True, slots=True)
class AnsweredCommand:
    """The last command of one sender."""

    sender: tuple[int, int]  # system, component
    words: Words
    result: int  # CommandResult
    t_us: int


def answered_before(
    memory: tuple[AnsweredCommand, ...], request: CommandRequest, t_us: int
) -> AnsweredCommand | None:
    """The recent result of the same command of the same sender."""
    for last in memory:
        if last.sender == _sender(request):
            patience = _RESENT_US if request.confirmation > 0 else _AT_ONCE_US
            if last.result != CommandResult.ACCEPTED and request.confirmation == 0:
                return None  # nothing was done; by now it may be possible
            same = last.words == _words(request)
            return last if same and t_us - last.t_us < patience else None
    return None


def remember(
    memory: tuple[AnsweredCommand, ...], request: CommandRequest, result: int, t_us: int
) -> tuple[AnsweredCommand, ...]:
    """The memory with this command as its sender's last."""
    sender = _sender(request)
    others = [last for last in memory if last.sender != sender]
    return (AnsweredCommand(sender, _words(request), result, t_us), *others[: _SENDERS - 1])


def _sender(request: CommandRequest) -> tuple[int, int]:
    return request.source_system, request.source_component


def _words(request: CommandRequest) -> Words:
    """All but the confirmation."""
    params = tuple(None if math.isnan(value) else value for value in request.params)
    return request.command, request.frame, params
