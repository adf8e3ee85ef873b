"""A scenario as the flight software hears of it, without messages in between."""

from __future__ import annotations

from fsw.autopilot.shapes import BY_NUMBER
from fsw.autopilot.signals import (
    EndEffectorTarget,
    MessageSource,
    SafeSet,
    SafeSetAnnouncement,
    Shape,
    Touch,
    Zone,
)
from sitl.mission_clock import MissionClock
from sitl.scenario import Scenario
from sitl.simulation import START_US
from sitl.zones import Zone as SimulatedZone
from sitl.zones import zones_of

SIMULATOR = MessageSource(1, 195, "simulator")


def safe_set(scenario: Scenario, t_us: int = START_US) -> SafeSet:
    """The safe set of a scenario in the flight software's terms, as announced at a time stamp."""
    return SafeSet(tuple(_zone(one, t_us) for one in zones_of(scenario)))


def moves(scenario: Scenario) -> bool:
    """Whether the safe set is another one as time passes."""
    return any(one.moves for one in zones_of(scenario))


def _zone(one: SimulatedZone, t_us: int) -> Zone:
    place = one.at(1e-6 * (t_us - START_US))
    shape = Shape(BY_NUMBER[one.kind.number].name, place.numbers)
    since_us = t_us if any(place.velocity) else 0
    touch = one.table.touch
    known = None
    if touch is not None:
        low, high = touch.stiffness_range_n_m
        known = Touch(touch.force_max_n, low, high, touch.dissipation_s_m, touch.friction)
    table = one.table
    return Zone(shape, table.clearance_m, table.keep_in, place.velocity, since_us, known)


def announced(scenario: Scenario, t_us: int = START_US) -> tuple[SafeSetAnnouncement, ...]:
    """What the scenario's pilot announces at a time stamp."""
    held = safe_set(scenario, t_us)
    return (SafeSetAnnouncement(SIMULATOR, held),) if held != SafeSet() else ()


def target(clock: MissionClock, t_us: int) -> EndEffectorTarget:
    """The end-effector reference at a time stamp."""
    time_s = 1e-6 * (t_us - START_US)
    point = clock.target_at(time_s)
    return EndEffectorTarget(t_us, point.p, point.v, point.a, clock.yaw_at(time_s), point.force)
