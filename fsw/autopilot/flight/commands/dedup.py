"""A command that is sent again because its ACK was lost must not act twice.

Answers are remembered for as long as they are true: the commander forgets them when a failsafe or
another command changes what the vehicle does, and those about home, speed and the like when another
command changes that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from fsw.autopilot.signals import CommandRequest, CommandResult, Sender

_AT_ONCE_US = 500_000  # the same words within this are the same command
_RESENT_US = 3_000_000  # a command that says it is a repetition: four sends half a second apart
_SENDERS = 8  # remembered; a flood of senders must not grow the memory

COURSE: Final = "course"  # among what changes: what the vehicle does, or will do once it is armed

Words = tuple[int, int | None, tuple[float | None, ...]]
"""Command, frame and parameters; None for NaN, so that the same words are equal."""


@dataclass(frozen=True, slots=True)
class AnsweredCommand:
    """The last command of one sender."""

    sender: Sender
    words: Words
    result: int  # CommandResult
    t_us: int
    changed: frozenset[str] = frozenset()  # by it


Answers = tuple[AnsweredCommand, ...]
"""The last one to each sender."""


def answered_before(memory: Answers, request: CommandRequest, t_us: int) -> AnsweredCommand | None:
    """The recent result of the same command of the same sender."""
    for last in memory:
        if last.sender == request.sender:
            patience = _RESENT_US if request.confirmation > 0 else _AT_ONCE_US
            if last.result != CommandResult.ACCEPTED and request.confirmation == 0:
                return None  # nothing was done; by now it may be possible
            same = last.words == _words(request)
            return last if same and t_us - last.t_us < patience else None
    return None


def still_true(memory: Answers, changes: frozenset[str]) -> Answers:
    """The answers that stay true when a new command makes these ``changes``.

    A takeoff has still been done when somebody else has moved home: it must not be done again.
    What was refused may be possible now.
    """
    if not changes:
        return memory
    if COURSE in changes:
        return ()
    accepted = CommandResult.ACCEPTED
    return tuple(
        [last for last in memory if last.result == accepted and not last.changed & changes]
    )


def remember(
    memory: Answers,
    request: CommandRequest,
    result: int,
    t_us: int,
    changed: frozenset[str] = frozenset(),
) -> Answers:
    """The memory with this command, and what it ``changed``, as its sender's last."""
    sender = request.sender
    others = [last for last in memory if last.sender != sender]
    answered = AnsweredCommand(sender, _words(request), result, t_us, changed)
    return (answered, *others[: _SENDERS - 1])


def _words(request: CommandRequest) -> Words:
    """All but the confirmation."""
    params = tuple(None if math.isnan(value) else value for value in request.params)
    return request.command, request.frame, params
