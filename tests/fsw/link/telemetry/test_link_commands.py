"""Commands to the link itself, in both forms, through a real socket and read with pymavlink."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest

from fsw.link.telemetry.streams import ON_REQUEST, STREAMS
from fsw.link.wire.identity import AVAILABLE_MODES
from messages import dialect
from messages import message_ids as ids
from messages.frames import Frame, FrameWriter
from tests.fsw.link.ground import Ground, ground_station

NAN = math.nan
GET, SET, REQUEST, CAPABILITIES = 510, 511, 512, 520
ACCEPTED, LATER, DENIED, FAILED = 0, 1, 2, 4


@pytest.fixture
def ground() -> Iterator[Ground]:
    with ground_station() as ground:
        ground.fly(5)
        yield ground


def long(command: int, *params: float, target: int = 1) -> bytes:
    """A COMMAND_LONG as MAVSDK fills it: NaN where nothing is meant."""
    numbers = [*params, *[NAN] * (7 - len(params))]
    return FrameWriter(245, 190).frame(ids.COMMAND_LONG, *numbers, command, 1, target, 0)


def integer(command: int, *params: float) -> bytes:
    """The same as a COMMAND_INT."""
    numbers = [*params, *[NAN] * (4 - len(params))]
    values = (*numbers, 0, 0, NAN, command, 1, 1, 0, 0, 0)
    return FrameWriter(245, 190).frame(ids.COMMAND_INT, *values)


def ask(ground: Ground, datagram: bytes) -> tuple[tuple[Any, ...], list[Frame]]:
    """The acknowledgement, and everything else that came with it."""
    ground.heard()
    ground.polled(datagram)
    ack, *rest = ground.heard()
    assert ack.message_id == ids.COMMAND_ACK
    assert (ack.system_id, ack.component_id) == (1, 1)
    assert ack.payload_values[4:] == (245, 190)
    assert ground.inbox.take().commands == []  # none of the tick's business
    return ack.payload_values[:2], rest


@pytest.mark.parametrize("form", [long, integer])
def test_an_interval_is_set_acknowledged_and_kept(ground: Ground, form: Any) -> None:
    assert ask(ground, form(SET, ids.ATTITUDE, 100_000)) == ((SET, ACCEPTED), [])
    ack, (received,) = ask(ground, form(GET, ids.ATTITUDE))
    assert ack == (GET, ACCEPTED)
    assert received.message_id == ids.MESSAGE_INTERVAL
    assert received.payload_values == (100_000, ids.ATTITUDE)
    attitudes = [f for f in ground.fly(2500) if f.message_id == ids.ATTITUDE]
    assert abs(len(attitudes) - 50) <= 1


def test_a_repeated_command_gets_the_same_answer(ground: Ground) -> None:
    answers = [ask(ground, long(SET, ids.ATTITUDE, 100_000)) for _ in range(3)]
    assert answers == [((SET, ACCEPTED), [])] * 3


@pytest.mark.parametrize(
    ("command", "params", "word"),
    [
        (SET, (float(ids.ATTITUDE), 100.0), "tick"),
        (SET, (NAN, 1e6), "param1"),
        (SET, (30.0, NAN), "param2"),
        (SET, (30.0, math.inf), "param2"),
        (SET, (30.0, 1e30), "param2"),
        (GET, (NAN,), "param1"),
        (REQUEST, (NAN,), "param1"),
        (CAPABILITIES, (0.0,), "param1"),
    ],
)
def test_a_refusal_says_why(
    ground: Ground, command: int, params: tuple[float, ...], word: str
) -> None:
    ack, texts = ask(ground, long(command, *params))
    assert ack == (command, DENIED)
    assert {text.message_id for text in texts} == {ids.STATUSTEXT}
    reported = b"".join(bytes(text.payload_values[1]) for text in texts)  # type: ignore[arg-type]
    assert word in reported.decode()


@pytest.mark.parametrize(
    ("command", "params", "result"),
    [
        (REQUEST, (4711.0,), DENIED),
        (REQUEST, (259.0,), DENIED),  # CAMERA_INFORMATION
        (REQUEST, (280.0,), DENIED),  # GIMBAL_MANAGER_INFORMATION
        (SET, (4711.0, 1e6), FAILED),
    ],
)
def test_a_probe_for_what_is_not_there_is_acknowledged_without_a_text(
    ground: Ground, command: int, params: tuple[float, ...], result: int
) -> None:
    """QGroundControl sends a dozen of them at each start; a text each lit its warning triangle."""
    assert ask(ground, long(command, *params)) == ((command, result), [])


def test_the_protocol_version_comes_by_the_old_command_too(ground: Ground) -> None:
    ack, (received,) = ask(ground, long(519, 1.0))
    assert ack == (519, ACCEPTED)
    assert received.payload_values[:3] == (200, 100, 200)


@pytest.mark.parametrize("form", [long, integer])
@pytest.mark.parametrize("message_id", sorted({s.message_id for s in STREAMS} | set(ON_REQUEST)))
def test_every_message_that_is_sent_can_be_requested(
    ground: Ground, form: Any, message_id: int
) -> None:
    ack, received = ask(ground, form(REQUEST, message_id))
    assert ack == (REQUEST, ACCEPTED)
    assert {frame.message_id for frame in received} == {message_id}


def test_what_does_not_exist_yet_is_refused_for_now(ground: Ground) -> None:
    ground.fly(5, home=None)
    ack, (text,) = ask(ground, long(REQUEST, ids.HOME_POSITION))
    assert ack == (REQUEST, LATER)
    assert text.message_id == ids.STATUSTEXT


def test_the_version_comes_by_the_old_command_too(ground: Ground) -> None:
    ack, (received,) = ask(ground, long(CAPABILITIES, 1.0, target=0))
    assert ack == (CAPABILITIES, ACCEPTED)
    capabilities = int(received.payload_values[0])
    for name in ("COMMAND_INT", "FTP", "MAVLINK2", "MISSION_INT", "PARAM_FLOAT"):
        assert capabilities & getattr(dialect, f"MAV_PROTOCOL_CAPABILITY_{name}"), name


@pytest.mark.parametrize("which", [NAN, 0.0])
def test_all_modes_are_listed_once(ground: Ground, which: float) -> None:
    _, received = ask(ground, long(REQUEST, ids.AVAILABLE_MODES, which))
    rows = [frame.payload_values for frame in received]
    assert [row[3] for row in rows] == list(range(1, len(AVAILABLE_MODES) + 1))
    assert {row[2] for row in rows} == {len(AVAILABLE_MODES)}
    names = [bytes(row[5]).rstrip(b"\0").decode() for row in rows]  # type: ignore[arg-type]
    assert names == [mode.name for mode in AVAILABLE_MODES]


def test_one_mode_is_listed_if_one_is_asked_for(ground: Ground) -> None:
    _, (received,) = ask(ground, long(REQUEST, ids.AVAILABLE_MODES, 2.0))
    assert received.payload_values[0] == AVAILABLE_MODES[1].custom_mode
    ack, _ = ask(ground, long(REQUEST, ids.AVAILABLE_MODES, 99.0))
    assert ack == (REQUEST, LATER)


def test_a_data_stream_request_changes_no_rate(ground: Ground) -> None:
    """MAVProxy sends it every 15 s, with stream 0 for all and 4 Hz."""
    for stream in (0, 6, 10):
        ground.polled(FrameWriter(255, 230).frame(66, 4, 1, 1, stream, 1))
    attitudes = [f for f in ground.fly(500) if f.message_id == ids.ATTITUDE]
    assert abs(len(attitudes) - 50) <= 1


def test_other_commands_go_to_the_tick(ground: Ground) -> None:
    ground.heard()
    ground.polled(long(400, 1.0) + integer(400, 1.0))
    assert [one.request.command for one in ground.inbox.take().commands] == [400, 400]
    assert ground.heard() == []


def test_a_command_to_another_system_is_not_answered(ground: Ground) -> None:
    ground.heard()
    numbers = (30.0, 1e5, *[NAN] * 5)
    ground.polled(FrameWriter(245, 190).frame(ids.COMMAND_LONG, *numbers, SET, 2, 1, 0))
    assert ground.heard() == []
    assert ground.link.rates.interval_us(ids.ATTITUDE) == 20_000
