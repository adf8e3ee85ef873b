"""GET_HOME_POSITION is answered with an acknowledgement and HOME_POSITION at once."""

from __future__ import annotations

import math
from dataclasses import replace

from fsw.autopilot.signals import StatusText
from fsw.link.telemetry.stream_rates import LinkCommands, StreamRates
from fsw.link.telemetry.streams import GROUND_RATES, STREAMS
from fsw.link.wire.outgoing import Outgoing
from messages import message_ids as ids
from messages.frames import Frame, FrameWriter, split
from tests.fsw.link.snapshots import CONTEXT, SNAPSHOT

GET_HOME_POSITION = 410


def question() -> Frame:
    values = (*(math.nan,) * 7, GET_HOME_POSITION, 1, 1, 0)
    (frame,) = split(FrameWriter(255, 190).frame(ids.COMMAND_LONG, *values))
    return frame


def test_home_is_told_at_once_where_there_is_one() -> None:
    commands = LinkCommands(StreamRates(STREAMS, GROUND_RATES, 2_000), CONTEXT)
    answer = commands.handle(question(), 1_000_000, SNAPSHOT)
    assert answer is not None
    ack, home = answer
    assert isinstance(ack, Outgoing)
    assert isinstance(home, Outgoing)
    assert (ack.message_id, ack.values[:2], ack.values[4:]) == (77, (410, 0), (255, 190))
    assert home.message_id == ids.HOME_POSITION


def test_before_there_is_a_home_the_question_is_refused_for_now() -> None:
    commands = LinkCommands(StreamRates(STREAMS, GROUND_RATES, 2_000), CONTEXT)
    answer = commands.handle(question(), 1_000_000, replace(SNAPSHOT, home=None))
    assert answer is not None
    ack, refusal = answer
    assert isinstance(ack, Outgoing)
    assert ack.values[:2] == (410, 1)
    assert isinstance(refusal, StatusText)
