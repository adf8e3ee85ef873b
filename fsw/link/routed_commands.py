"""Commands that go on to the simulator, until it has answered them.

In real time a datagram may get lost in either direction. So what is not answered is sent again, and
after a while answered here: a ground station that asks is told in time.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from fsw.link.bounded_memory import renew
from fsw.link.wire import message_ids
from fsw.link.wire.message_ids import SIMULATOR, SYSTEM_ID
from fsw.signals import CommandAck, CommandRequest, CommandResult
from messages.frames import FrameWriter

_AGAIN_US: Final = 100_000
_OVER_US: Final = 600_000  # a ground station waits for a second at least
_MOST: Final = 16  # as many as a tick takes

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
        key = (request.command, request.source_system, request.source_component)
        renew(self._waiting, key, _Waiting(request), _MOST)

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
        return [ack for ack in acks if self._waiting.pop(_key(ack), None) is not None]

    def given_up(self, t_us: int) -> list[CommandAck]:
        """The answers to what the simulator has not answered; it may have been done or not."""
        over = [
            key
            for key, one in self._waiting.items()
            if one.since_us >= 0 and t_us - one.since_us >= _OVER_US
        ]
        for key in over:
            del self._waiting[key]
        return [CommandAck(key[0], CommandResult.FAILED, *key[1:]) for key in over]


def _key(ack: CommandAck) -> _Key:
    return ack.command, ack.target_system, ack.target_component


def _frame(request: CommandRequest, confirmation: int) -> bytes:
    writer = FrameWriter(request.source_system, request.source_component)
    values = (*request.params, request.command, SYSTEM_ID, SIMULATOR, confirmation)
    return writer.frame(message_ids.COMMAND_LONG, *values)
