"""Which loops fly: our own, or what asks PX4's; and what their safety filter keeps off zones."""

from __future__ import annotations

from fsw.autopilot.control.cascade import Cascade, KeepClear
from fsw.autopilot.control.px4_loops import Px4Loops
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.frozen import replace


def loops_of(config: FlightConfig) -> Cascade:
    """The loops of a configuration."""
    tick, clear = config.tick, _keep_clear(config)
    if config.inner == "px4":
        return Px4Loops(config.airframe, config.tuning, config.px4, tick, clear)
    return Cascade(config.airframe, config.tuning, config.inner, tick, clear)


def _keep_clear(config: FlightConfig) -> KeepClear:
    """What the safety filter keeps off zones; it works where the planner has barriers to rely on.

    Controllers that are flown for comparison are to show what they do without it.
    """
    enabled = config.safety_filter.enabled and config.keeps_barriers
    return KeepClear(
        config.body,
        config.planner.tunings,
        replace(config.safety_filter, enabled=int(enabled)),
        config.steering.speed,
    )
