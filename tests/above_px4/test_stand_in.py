"""The stand-in for PX4 beside what a real one answered and did (v1.17 at a70a558393)."""

from __future__ import annotations

import math
from typing import Any, cast

import pytest

from messages.frames import FrameWriter, split
from tests.processes.test_px4_process import AIRFRAME
from tests.px4_companion_stand_in import (
    ACK,
    CURRENT_MODE,
    HOLD,
    OFFBOARD,
    SET_ACTUATOR,
    SET_INTERVAL,
    SET_MODE,
    TARGET,
    TIMESYNC,
    Px4Companion,
    allocated,
)

COMPANION = FrameWriter(1, 191)


def asked(px4: Px4Companion, number: int, *params: float) -> list[tuple[int, tuple[Any, ...]]]:
    px4.said = b""
    seven = (*params, *(0.0,) * (7 - len(params)))
    px4.hear_companion(COMPANION.frame(76, *seven, number, 1, 1, 0))
    return [(f.message_id, cast("tuple[Any, ...]", f.payload_values)) for f in split(px4.said)]


def answers(said: list[tuple[int, tuple[Any, ...]]]) -> list[tuple[int, int]]:
    return [(values[0], values[1]) for message, values in said if message == ACK]


def hovering() -> Px4Companion:
    px4 = Px4Companion(AIRFRAME)
    px4.airborne()
    px4._last_us = 20_000_000
    return px4


def streamed(px4: Px4Companion) -> None:
    values = (20_000, *(0.0,) * 11, 0, 1, 1, 1)
    px4.hear_companion(COMPANION.frame(TARGET, *values))


@pytest.mark.parametrize(
    ("number", "params", "results"),
    [
        (SET_INTERVAL, (331.0, 8000.0), [0]),
        (SET_INTERVAL, (60000.0, 8000.0), [4]),
        (SET_ACTUATOR, (0.3, -0.2), [0]),
        (30999, (), [3]),
        (SET_MODE, (1.0, 4.0, 3.0), [0, 0]),
    ],
)
def test_it_answers_as_px4_did(number: int, params: tuple[float, ...], results: list[int]) -> None:
    found = answers(asked(hovering(), number, *params))
    assert found == [(number, result) for result in results]


def test_offboard_needs_a_stream_and_is_told_at_once_where_that_is_asked_for() -> None:
    px4 = hovering()
    asked(px4, SET_INTERVAL, float(CURRENT_MODE), 20_000.0)
    assert answers(asked(px4, SET_MODE, 1.0, 6.0, 0.0)) == [(SET_MODE, 0), (SET_MODE, 1)]
    assert px4.mode == HOLD
    streamed(px4)
    said = asked(px4, SET_MODE, 1.0, 6.0, 0.0)
    assert px4.mode == OFFBOARD
    assert [values[0] for message, values in said if message == CURRENT_MODE] == [0x60000]


def test_it_echoes_times_in_its_own() -> None:
    px4 = hovering()
    px4.said = b""
    px4.hear_companion(COMPANION.frame(TIMESYNC, 0, 123456789))
    (answer,) = split(px4.said)
    assert answer.payload_values == (20_000_000_000, 123456789)


@pytest.mark.parametrize(
    ("asked", "motors"),
    [
        ((0.512, 0.484, 0.781, 0.014), (0.0, 0.738, 1.0, 0.053)),
        ((0.506, -0.307, -0.695, 0.017), (1.0, 0.258, 0.017, 0.692)),
        ((0.518, -0.282, 0.81, 0.002), (0.0, 0.155, 1.0, 0.554)),
        ((0.594, 0.011, 1.63, -0.111), (0.0, 0.358, 1.0, 0.342)),
        ((0.511, -1.476, -0.078, 0.014), (0.405, 0.0, 0.295, 1.0)),
        ((0.557, -0.218, -0.143, -0.083), (0.575, 0.486, 0.373, 0.794)),
    ],
)
def test_rotors_are_asked_for_what_px4s_log_has(
    asked: tuple[float, ...], motors: tuple[float, ...]
) -> None:
    """Thrust and torques as its log has them: a roll or pitch of 1 is 0.707 of two rotors."""
    thrust, roll, pitch, yaw = asked
    shares = allocated(thrust, math.sqrt(0.5) * roll, math.sqrt(0.5) * pitch, yaw)
    assert shares == pytest.approx(motors, abs=2e-3)
