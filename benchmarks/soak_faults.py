"""What fails in ``python -m benchmarks soak`` beside the sensors that its ground station fails.

MAV_CMD_INJECT_FAILURE has no number for these units; they stand in the flight's scenario.
"""

from __future__ import annotations

import random
from typing import Any, Final

_EVERY_S: Final = 20.0
_FIRST_S: Final = 15.0  # the vehicle has taken off then
_LASTS_S: Final = (0.2, 1.5)
_STOPPED_S: Final = 0.5  # for as long there is no time in the simulation, and so no answer

_ENCODER: Final = ("off", "stuck", "slow", "delayed", "intermittent")
_DATAGRAMS: Final = ("intermittent", "duplicated", "reordered", "delayed")
# Left out is what ends a flight or its log: a lost rotor, a process killed, a full disk.
FAULTS: Final[tuple[dict[str, Any], ...]] = (
    *({"unit": "encoder", "kind": kind, "delay_ms": 20.0} for kind in _ENCODER),
    *({"unit": "to vehicle", "kind": kind, "delay_ms": 20.0} for kind in _DATAGRAMS),
    *({"unit": "to simulator", "kind": kind, "delay_ms": 20.0} for kind in _DATAGRAMS),
    {"unit": "planner", "kind": "stopped"},
    {"unit": "planner", "kind": "killed"},
    {"unit": "simulator", "kind": "stopped"},
    {"unit": "motor", "kind": "weak", "share": 0.8, "instance": 2},
    {"unit": "joint", "kind": "off", "instance": 1},
    {"unit": "joint", "kind": "stuck", "instance": 2},
)


def scenario(seed: int, duration_s: float) -> str:
    """A vehicle on the ground as TOML, of which something fails every 20 s of ``duration_s``."""
    choices = random.Random(seed)
    lines = ["duration_s = inf", "[start]", 'kind = "ground"', "[pilot]", 'plan = "none"']
    lines += ["[trajectory]", 'kind = "hold"', "position_m = [0.0, 0.0, -1.2]"]
    start_s, waiting = _FIRST_S, list[dict[str, Any]]()
    while start_s + _LASTS_S[1] < duration_s:
        if not waiting:
            # Each once before one comes again: an hour has each of them.
            waiting = choices.sample(FAULTS, len(FAULTS))
        fault, lasts_s = waiting.pop(), choices.uniform(*_LASTS_S)
        if fault["unit"] == "planner" and start_s > 0.5 * duration_s:
            continue  # this planner lives to the end, and its memory is judged
        if fault["unit"] == "simulator":
            lasts_s = min(lasts_s, _STOPPED_S)
        times = {"start_s": round(start_s, 3), "duration_s": round(lasts_s, 3)}
        lines.append("[[faults]]")
        for key, value in (fault | times).items():
            lines.append(f'{key} = "{value}"' if isinstance(value, str) else f"{key} = {value}")
        start_s += choices.uniform(0.5, 1.5) * _EVERY_S
    return "\n".join(lines) + "\n"
