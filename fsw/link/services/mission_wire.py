"""Mission messages to and from the vehicle's own items; pure."""

from __future__ import annotations

import math
from typing import Final, cast

from fsw.autopilot.signals import FlightSnapshot, MissionProgress, MissionState, Mode, Vec4
from fsw.link.wire.decode import Numbers
from fsw.link.wire.mission_items import (
    INVALID_PARAM1,
    LOCAL_FRAMES,
    NO_PLACE,
    BadItem,
    MissionItem,
)
from fsw.link.wire.outgoing import Outgoing, PlanIds, TelemetryContext, WireValues
from messages import message_ids as ids

Peer = tuple[int, int]
"""System and component of a client."""

_NO_MISSION: Final = 0xFFFF  # in place of a total; 0 would mean that totals are not supported
_ACTIVE, _SUSPENDED = 1, 2  # mission_mode
_FRAME_MISSION: Final = 2  # MAV_FRAME of a command without a place


def item_int(values: Numbers) -> MissionItem:
    """Read a MISSION_ITEM_INT."""
    return MissionItem(
        command=int(values[8]),
        frame=int(values[11]),
        params=cast(Vec4, values[0:4]),
        x=int(values[4]),
        y=int(values[5]),
        z=values[6],
        autocontinue=int(values[13]),
    )


def item_float(values: Numbers) -> MissionItem:
    """Read a MISSION_ITEM, whose x and y are degrees or metres."""
    frame = int(values[11])
    whole = []
    for number, value in enumerate(values[4:6]):
        scaled = value * _scale(frame)
        if math.isnan(scaled):
            scaled = float(NO_PLACE)
        if not abs(scaled) <= NO_PLACE:
            raise BadItem(INVALID_PARAM1 + 4 + number, f"{value:g} is no place")
        whole.append(round(scaled))
    return item_int((*values[0:4], *whole, *values[6:]))


def encode_item(item: MissionItem, seq: int, kind: int, peer: Peer, as_int: bool) -> Outgoing:
    """MISSION_ITEM_INT, or MISSION_ITEM for a request in floats."""
    x: float = item.x
    y: float = item.y
    if not as_int:
        scale = _scale(item.frame)
        x = math.nan if item.x == NO_PLACE else item.x / scale
        y = math.nan if item.y == NO_PLACE else item.y / scale
    tail = (seq, item.command, *peer, item.frame, 0, item.autocontinue, kind)
    message_id = ids.MISSION_ITEM_INT if as_int else ids.MISSION_ITEM
    return Outgoing(message_id, (*item.params, x, y, item.z, *tail))


def encode_ack(result: int, kind: int, peer: Peer, opaque_id: int = 0) -> Outgoing:
    """MISSION_ACK; the id is that of the list which an upload has put on the vehicle."""
    return Outgoing(ids.MISSION_ACK, (*peer, result, kind, opaque_id))


def mission_current(snapshot: FlightSnapshot, context: TelemetryContext) -> WireValues:
    """MISSION_CURRENT of a snapshot."""
    return current_values(snapshot.mission, snapshot.mode is Mode.MISSION, context.plan_ids)


def current_values(progress: MissionProgress, in_mission: bool, plans: PlanIds) -> WireValues:
    """MISSION_CURRENT."""
    which = (plans[0], plans[1], plans[2])
    if progress.state is MissionState.NO_MISSION:
        return (0, _NO_MISSION, int(progress.state), _SUSPENDED, *which)
    mode = _ACTIVE if in_mission else _SUSPENDED
    return (progress.current, progress.total, int(progress.state), mode, *which)


def _scale(frame: int) -> float:
    if frame == _FRAME_MISSION:
        return 1.0
    return 1e4 if frame in LOCAL_FRAMES else 1e7
