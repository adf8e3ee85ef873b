"""Second argument of every encoder: what telemetry shows beside the snapshot of a tick."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from fsw.autopilot.geometry.geodesy import DEFAULT_ORIGIN
from fsw.autopilot.ports import LoopHealth, VehicleFacts
from fsw.autopilot.signals import Origin

GENERIC, PX4 = 0, 12  # MAV_AUTOPILOT


PlanIds = Mapping[int, int]
"""Identities of the uploaded lists by MAV_MISSION_TYPE, 0 for an empty one; the mission store's."""


@dataclass(frozen=True, slots=True)
class TelemetryContext:
    """Second argument of every encoder."""

    facts: VehicleFacts
    health: LoopHealth
    autopilot: int = PX4
    origin: Origin = DEFAULT_ORIGIN
    start_unix_us: int = 0  # wall time at sensor time 0 [us since 1970]
    plan_ids: PlanIds = field(default_factory=lambda: dict.fromkeys(range(3), 0))
