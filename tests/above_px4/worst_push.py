"""The push that moves PX4's loops furthest off their plan, as the tube says that they are."""

from __future__ import annotations

import numpy as np

from fsw.autopilot.barriers.safe_approach import stand_off
from fsw.autopilot.control.px4_tube import horizontal_loop, softer
from fsw.autopilot.control.tube import after_a_push
from fsw.autopilot.parameters.consistency import loop_tube
from fsw.autopilot.parameters.flight_config import above_px4, flight_config
from sitl.scenario import V3, Sequence

_DT = 0.01  # s, for which each value holds
_LASTS = 8.0  # s; what was before that adds 2 mm
_CONFIG = above_px4(flight_config())
_MOST = _CONFIG.surroundings.disturbance  # m/s^2
BOUND = _MOST * loop_tube(_CONFIG).base  # m, that is printed
KEPT = stand_off(_CONFIG.planner.walls)  # m, that plans keep from walls


def worst_push(starts_s: float, axis: int) -> Sequence:
    """At its end, on an ``axis``, the base is as far off as the tube says; it begins at a time."""
    response = after_a_push(*horizontal_loop(softer(_CONFIG.px4)), _DT, _LASTS)[::-1, 0]
    values: list[V3] = []
    for sign in np.sign(response).tolist():
        one = [0.0, 0.0, 0.0]
        one[axis] = _MOST * sign
        values.append((one[0], one[1], one[2]))
    return Sequence(tuple(values), _DT, starts_s, name=f"worst {axis}")
