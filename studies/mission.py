"""A scenario as the flight software hears of it, without messages in between."""

from __future__ import annotations

from fsw.shapes.ball import point
from fsw.shapes.half_space import wall
from fsw.shapes.target_sphere import target_sphere
from fsw.signals import (
    EndEffectorTarget,
    MessageSource,
    SafeSet,
    SafeSetAnnouncement,
)
from sitl.mission_clock import MissionClock
from sitl.scenario import Scenario
from sitl.simulation import START_US

SIMULATOR = MessageSource(1, 195, "simulator")


def safe_set(scenario: Scenario) -> SafeSet:
    """The safe set of a scenario in the flight software's terms."""
    zones = [wall(one.normal, one.offset_m, one.clearance_m) for one in scenario.walls]
    zones += [point(one.position_m, one.clearance_m) for one in scenario.obstacles]
    workspace = scenario.workspace
    if workspace is not None:
        zones.append(target_sphere((0.0, 0.0, -workspace.d_iw_m), workspace.radius_m))
    return SafeSet(tuple(zones))


def announced(scenario: Scenario) -> tuple[SafeSetAnnouncement, ...]:
    """What the scenario's pilot announces."""
    held = safe_set(scenario)
    return (SafeSetAnnouncement(SIMULATOR, held),) if held != SafeSet() else ()


def target(clock: MissionClock, t_us: int) -> EndEffectorTarget:
    """The end-effector reference at a time stamp."""
    time_s = 1e-6 * (t_us - START_US)
    at = clock.target_at(time_s)
    return EndEffectorTarget(t_us, at.p, at.v, at.a, clock.yaw_at(time_s))
