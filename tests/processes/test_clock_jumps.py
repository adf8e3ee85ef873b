"""Both processes, and a clock of the sensors that jumps: told once, and the flight goes on."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from messages.frames import split
from tests.processes.both_processes import (
    HIL_ACTUATOR_CONTROLS,
    Capture,
    Misbehaviour,
    fly_through,
)

STATUSTEXT = 253
END_EFFECTOR_TARGET = 60202
CRITICAL = 2
SCENARIO = """
duration_s = 1.6
[start]
kind = "airborne"
[pilot]
plan = "trajectory"
[trajectory]
kind = "hold"
position_m = [0.0, 0.0, -1.2]
[[faults]]
unit = "clock"
kind = "jump"
start_s = 0.6
jump_s = {jump_s}
"""


def values_of(message_id: int, datagrams: list[bytes]) -> list[tuple[Any, ...]]:
    """Of all messages of a kind."""
    frames = [frame for datagram in datagrams for frame in split(datagram)]
    return [one.payload_values for one in frames if one.message_id == message_id]


def urgent_texts(flown: Capture) -> list[str]:
    texts = [values for values in values_of(STATUSTEXT, flown.to_sitl) if values[0] <= CRITICAL]
    return [values[1].rstrip(b"\0").decode() for values in texts]


@pytest.mark.long
@pytest.mark.requirement("REQ-TIME-4")
@pytest.mark.parametrize(
    ("jump_s", "options"),
    [
        (-0.5, ()),
        (-0.004, ("--realtime", "--sensors", "mocap")),
        (-0.5, ("--realtime", "--sensors", "mocap")),
        (6.0, ("--realtime",)),
    ],
    ids=["back", "a little back in real time", "back in real time, measured", "ahead in real time"],
)
def test_a_clock_that_jumps_is_told_once_and_the_flight_goes_on(
    jump_s: float, options: tuple[str, ...], tmp_path: Path
) -> None:
    scenario = tmp_path / "clock.toml"
    scenario.write_text(SCENARIO.format(jump_s=jump_s))
    flown = fly_through(Misbehaviour(), tmp_path / "out", *options, scenario=str(scenario))
    assert (flown.sitl_exit, flown.fsw_exit) == (0, 0)
    assert flown.result["completed"]
    by = f"{jump_s:+.2f} s" if abs(jump_s) >= 0.1 else f"{1e3 * jump_s:+g} ms"
    assert urgent_texts(flown) == [f"time jumped by {by}"]
    (told,) = [line for line in flown.warned if "jumped" in line]
    assert re.fullmatch(rf"fsw: 0\.[67] s: time jumped by {re.escape(by)}", told)
    answered_us = values_of(HIL_ACTUATOR_CONTROLS, flown.to_sitl)[-1][0]
    assert answered_us == pytest.approx(1e6 * (2.6 + jump_s), abs=10_000)
    # The pilot's clock has not jumped: it sends targets 2 s ahead.
    assert values_of(END_EFFECTOR_TARGET, flown.to_fsw)[-1][0] in (4_500_000, 4_600_000)
