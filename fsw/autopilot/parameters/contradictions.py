"""Numbers that are allowed alone and contradict each other."""

from __future__ import annotations

import math
from collections.abc import Iterator

from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.parameters.registry import BY_NAME
from fsw.autopilot.tuning import Tuning, tuned

# What one parameter is to be of another, or of some times as much.
_ORDERED: tuple[tuple[str, str, str, int], ...] = (
    ("BAT_CRIT_THR", "below", "BAT_LOW_THR", 1),
    ("BAT_EMERGEN_THR", "below", "BAT_CRIT_THR", 1),
    ("COM_POS_LOW_EPH", "at most", "COM_POS_FS_EPH", 1),
    ("LND_HEIGHT", "at most", "LND_AIRBORNE", 1),
    ("MIS_TAKEOFF_ALT", "at most", "TKO_CLIMB_MAX", 1),
    # A plan that may end at any speed damps nothing: from 60 times on the vehicle swings.
    ("PLN_W_TRACK", "at most", "PLN_W_VEL_N", 20),
)

# Limits of roll and pitch [deg] beyond which the flight is ended; 0: none.
_FAILURES: tuple[str, ...] = ("FD_FAIL_R", "FD_FAIL_P")
# deg above what the vehicle tilts by itself: gusts and a late estimate push it further for a while.
_RESERVE = 15.0


def agreed(config: FlightConfig, tuning: Tuning) -> FlightConfig:
    """The configuration with a tuning in it.

    Raises:
        ValueError: The numbers contradict each other.
    """
    config = tuned(config, tuning)
    against = contradictions(config)
    if against:
        raise ValueError("; ".join(against))
    return config


def contradictions(config: FlightConfig) -> tuple[str, ...]:
    """A sentence for each contradiction between parameters, or with what the vehicle does."""
    found = []
    for lower, relation, upper, times in _ORDERED:
        less, more = BY_NAME[lower].read(config), BY_NAME[upper].read(config)
        if not (less < times * more or (less == times * more and relation == "at most")):
            of = upper if times == 1 else f"{times} times {upper}"
            found.append(f"{lower} {less:g} is to be {relation} {of}, {more:g}")
    return (*found, *_within_usual_tilt(config))


def _within_usual_tilt(config: FlightConfig) -> Iterator[str]:
    """Attitude failures that a flight in which nothing fails would reach."""
    planned = BY_NAME["PLN_TILT_MAX"].read(config)
    loops = round(math.degrees(config.airframe.tilt_max), 6)
    why = f"PLN_TILT_MAX, {planned:g}" if planned > loops else f"the {loops:g} deg of the loops"
    for name in _FAILURES:
        most = BY_NAME[name].read(config)
        if most != 0.0 and not most >= max(planned, loops) + _RESERVE:
            yield f"{name} {most:g} is to be 0 or at least {_RESERVE:g} deg above {why}"
