"""Outgoing messages, before framing, and what encoders make them of beside a snapshot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from fsw.autopilot.geometry.geodesy import DEFAULT_ORIGIN
from fsw.autopilot.ports import LoopHealth, VehicleFacts
from fsw.autopilot.signals import Origin, StatusText
from messages.message_ids import AUTOPILOT

GENERIC, PX4 = 0, 12  # MAV_AUTOPILOT

PlanIds = Mapping[int, int]
"""Identities of the uploaded lists by MAV_MISSION_TYPE, 0 for an empty one; the mission store's."""


@dataclass(frozen=True, slots=True)
class TelemetryContext:
    """What telemetry shows beside the snapshot of a tick: second argument of every encoder."""

    facts: VehicleFacts
    health: LoopHealth
    autopilot: int = PX4
    origin: Origin = DEFAULT_ORIGIN
    start_unix_us: int = 0  # wall time at sensor time 0 [us since 1970]
    plan_ids: PlanIds = field(default_factory=lambda: dict.fromkeys(range(3), 0))


WireValues = tuple[float | bytes, ...]
"""Every field of a message in wire order, see ``messages.frames.wire_fields``."""


@dataclass(frozen=True, slots=True)
class Outgoing:
    """A message to send to the peers of the link."""

    message_id: int
    values: WireValues | bytes  # bytes: its whole payload, packed already, as of files
    component: int = AUTOPILOT  # whose sequence it counts in


ServiceOutput = Outgoing | StatusText
"""What a service sends: messages, and texts for the operator."""
