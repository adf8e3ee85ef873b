"""Numbers that are allowed alone and contradict each other."""

from __future__ import annotations

from fsw.parameters.flight_config import FlightConfig
from fsw.parameters.registry import BY_NAME

# Pairs of parameters: the first is to be below the second, or at most equal to it.
_BELOW: tuple[tuple[str, str], ...] = (
    ("BAT_CRIT_THR", "BAT_LOW_THR"),
    ("BAT_EMERGEN_THR", "BAT_CRIT_THR"),
)
_AT_MOST: tuple[tuple[str, str], ...] = (
    ("COM_POS_LOW_EPH", "COM_POS_FS_EPH"),
    ("LND_HEIGHT", "LND_AIRBORNE"),
    ("MIS_TAKEOFF_ALT", "TKO_CLIMB_MAX"),
)


def contradictions(config: FlightConfig) -> tuple[str, ...]:
    """A sentence for each pair of parameters that contradict each other."""
    found = []
    for pairs, strictly in ((_BELOW, True), (_AT_MOST, False)):
        for lower, upper in pairs:
            less, more = BY_NAME[lower].read(config), BY_NAME[upper].read(config)
            if less < more or (less == more and not strictly):
                continue
            relation = "below" if strictly else "at most"
            found.append(f"{lower} {less:g} is to be {relation} {upper}, {more:g}")
    return tuple(found)
