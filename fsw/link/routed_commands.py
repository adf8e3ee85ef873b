"""Commands that go on to the simulator, until it has answered them.

In real time a datagram may get lost in either direction. So what is not answered is sent again, and
after a while answered here: a ground station that asks is told in time.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from fsw.autopilot.signals import CommandAck, CommandRequest, CommandResult
from fsw.link.bounded_memory import renew
from messages import message_ids
from messages.frames import FrameWriter
from messages.message_ids import SIMULATOR, SYSTEM_ID

_AGAIN_US: Final = 100_000
_OVER_US: Final = 600_000  # a ground station waits for a second at least
_MOST: Final = 16  # as many as a tick takes
_NAMELESS: Final = 255  # in place of 0, which is for addressing only

_Key = tuple[int, int, int]  # command, and system and component of the sender


@dataclass(slots=True)
class _Waiting:
    request: CommandRequest
    since_us: int = -1  # it was sent first; -1: not yet
    sent: int = 0  # times


class RoutedCommands:
    """Those of one link; times are the vehicle's [us]."""

    def __init__(self) -> None:
        self._waiting: dict[_Key, _Waiting] = {}

    def __bool__(self) -> bool:
        return bool(self._waiting)

    def add(self, request: CommandRequest) -> None:
        """Take a command; its sender has given up an earlier one that was the same."""
        renew(self._waiting, (request.command, *_name(request)), _Waiting(request), _MOST)

    def due(self, t_us: int) -> bytes:
        """Frames to send now, in the name of who sent the commands, as a router does."""
        frames = []
        for one in self._waiting.values():
            if one.since_us < 0:
                one.since_us = t_us
            if t_us - one.since_us >= _AGAIN_US * one.sent:
                # What is sent again says so, and is not carried out again.
                confirmation = min(one.request.confirmation + one.sent, 255)
                one.sent += 1
                frames.append(_frame(one.request, confirmation))
        return b"".join(frames)

    def answered(self, acks: Iterable[CommandAck]) -> list[CommandAck]:
        """Those of the simulator's ``acks`` that somebody still waits for."""
        found = []
        for ack in acks:
            sender = (ack.target_system, ack.target_component)
            one = self._waiting.pop((ack.command, *sender), None)
            if one is not None:
                found.append(one.request.answer(ack.result))
        return found

    def given_up(self, t_us: int) -> list[CommandAck]:
        """The answers to what the simulator has not answered; it may have been done or not."""
        over = [
            (key, one.request)
            for key, one in self._waiting.items()
            if one.since_us >= 0 and t_us - one.since_us >= _OVER_US
        ]
        for key, _ in over:
            del self._waiting[key]
        return [request.answer(CommandResult.FAILED) for _, request in over]


def _name(request: CommandRequest) -> tuple[int, int]:
    """The sender, as a frame can say it; pymavlink's component is 0 unless it is told another."""
    return request.source_system or _NAMELESS, request.source_component or _NAMELESS


def _frame(request: CommandRequest, confirmation: int) -> bytes:
    writer = FrameWriter(*_name(request))
    values = (*request.params, request.command, SYSTEM_ID, SIMULATOR, confirmation)
    return writer.frame(message_ids.COMMAND_LONG, *values)
