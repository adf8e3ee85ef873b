"""What the tool meets: within what the vehicle is told of a surface, and beyond it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Final

from sitl.faults.keys import Fault
from sitl.plant.stiffness import TooStiffError
from sitl.scenario import Push, Scenario, ScenarioZone, WayPoint
from sitl.scenario_validation import fault_problem
from sitl.start import effects
from sitl.touch import touched_zones

_TRAVEL_M: Final = 0.15  # that a surface comes before it stands again
_COMES: Final = 0.1  # m/s


@dataclass(frozen=True, slots=True)
class Met:
    """Surfaces, and the sensors that feel them, from the beginning of a stretch on."""

    name: str
    # 0: the least stiffness that the vehicle is told of, 1: the greatest, between them by ratio;
    # each one beyond doubles or halves it.
    hardness: float
    friction: float  # times what it is told of
    speed: float = 0.0  # m/s, out of the surface, that nobody announces
    faults: tuple[Fault, ...] = ()  # of sensors

    def as_json(self) -> dict[str, Any]:
        """For a result."""
        return {
            "name": self.name,
            "hardness": self.hardness,
            "friction": self.friction,
            "speed_m_s": self.speed,
            "sensors": [str(fault) for fault in self.faults],
        }


WITHIN: Final = (
    Met("softest", 0.0, 1.0),
    Met("hardest", 1.0, 1.0),
    Met("hardest, smooth", 1.0, 0.0),
    Met("softest, smooth", 0.0, 0.0),
)
_LATE, _WRONG = 6.0, 1.0  # ms; times what is usual
BEYOND: Final = (
    Met("half as stiff", -1.0, 1.0),
    Met("twice as stiff", 2.0, 1.0),
    Met("four times as stiff", 3.0, 1.0),
    Met("half as rough again", 0.0, 1.5),
    Met("comes", 1.0, 1.0, _COMES),
    Met("goes", 1.0, 1.0, -_COMES),
    Met("encoders late", 1.0, 1.0, faults=(Fault("encoder", "delayed", delay_ms=_LATE),)),
    Met("encoders biased", 1.0, 1.0, faults=(Fault("encoder", "wrong", size=_WRONG),)),
    Met("positions late", 1.0, 1.0, faults=(Fault("vio", "delayed", delay_ms=10.0 * _LATE),)),
    Met("accelerometer biased", 1.0, 1.0, faults=(Fault("accel", "wrong", size=_WRONG),)),
)
"""What the start-up analysis makes no claim about; its claim is of exact states."""


def touches(scenario: Scenario) -> bool:
    """Whether the tool is to press on something."""
    return isinstance(scenario.trajectory, Push) and bool(touched_zones(scenario))


def unclaimed(scenario: Scenario) -> tuple[Met, ...]:
    """Of what is not claimed, that which the plant can follow and the scenario's sensors know."""
    return tuple(met for met in BEYOND if _flies(scenario, met))


def _flies(scenario: Scenario, met: Met) -> bool:
    try:
        effects(met_by(scenario, met))
    except TooStiffError:
        return False
    return all(fault_problem(fault, scenario) is None for fault in met.faults)


def met_by(scenario: Scenario, met: Met, starts_s: float = 0.0) -> Scenario:
    """The scenario whose surfaces are as ``met``, and come from ``starts_s`` [s] on if they do."""
    zones = tuple(
        zone if zone.touch is None else _met(scenario, zone, met, starts_s)
        for zone in scenario.zones
    )
    return replace(scenario, zones=zones)


def _met(scenario: Scenario, zone: ScenarioZone, met: Met, starts_s: float) -> ScenarioZone:
    touch = zone.touch
    assert touch is not None
    low, high = touch.stiffness_range_n_m
    inside = min(max(met.hardness, 0.0), 1.0)
    stiffness = low * math.pow(high / low, inside) * math.pow(2.0, met.hardness - inside)
    changed = replace(touch, stiffness_n_m=stiffness, friction=met.friction * touch.friction)
    zone = replace(zone, touch=changed)
    if met.speed == 0.0:
        return zone
    assert isinstance(scenario.trajectory, Push)
    x, y, z = (math.copysign(_TRAVEL_M, met.speed) * one for one in scenario.trajectory.normal)
    ends_s = starts_s + _TRAVEL_M / abs(met.speed)
    points = WayPoint(starts_s, (0.0, 0.0, 0.0)), WayPoint(ends_s, (x, y, z))
    return replace(zone, way_points=points)
