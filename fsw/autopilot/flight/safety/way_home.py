"""Where a return ends, and with it a failsafe that returns: at home, or at a nearer rally point.

Every change is told, with who made it. While armed it is for the source that armed the vehicle, and
for the system that SAFE_OWNER names, alone. Where neither is known, the first that changes it owns
it until the vehicle is armed again: a scenario arms, or PX4.
"""

from __future__ import annotations

from fsw.autopilot.flight.state import VehicleMemory
from fsw.autopilot.shapes.zones import surfaces
from fsw.autopilot.signals import VEHICLE_PILOT, MissionUpdate, SafeSet, Sender, Vec2
from fsw.frozen import replace

_NAMED = 3  # places; the others are counted


def armed_by(vehicle: VehicleMemory, sender: Sender) -> VehicleMemory:
    """The memory of a vehicle that a sender has armed."""
    return replace(vehicle, home_owner=None if sender == VEHICLE_PILOT else sender)


def changed_by(vehicle: VehicleMemory, sender: Sender) -> VehicleMemory:
    """The memory after a sender has changed where a return ends."""
    if not vehicle.armed or vehicle.home_owner is not None:
        return vehicle
    return replace(vehicle, home_owner=sender)


def against_sender(vehicle: VehicleMemory, sender: Sender, chosen: int) -> str:
    """Why a sender may not change where a return ends; empty if it may.

    The ``chosen`` system always may; 0: none is.
    """
    owner = vehicle.home_owner
    if not vehicle.armed or sender == owner or (chosen and sender[0] == chosen):
        return ""
    if owner is None and not chosen:
        return ""
    whose = f"system {chosen}" if owner is None else f"{owner[0]}/{owner[1]}"
    return f"while armed only {whose} may change where a return ends"


def outside(fence: SafeSet, north_east: Vec2) -> str:
    """Why a place [m] cannot be where a return ends; a fence is the same always and everywhere up.

    But for a sphere around the target, which is no place.
    """
    for number, at in enumerate(surfaces(fence, (*north_east, 0.0), 0), start=1):
        if not at.distance > 0.0:
            return f"it is outside the fence, by {-at.distance:.2f} m at its zone {number}"
    return ""


def against_upload(vehicle: VehicleMemory, update: MissionUpdate | None, chosen: int) -> str:
    """Why who uploaded something may not change rally points; empty if it may."""
    if update is None or update.source is None:
        return ""
    return against_sender(vehicle, update.source.sender, chosen)


def uploaded(vehicle: VehicleMemory, update: MissionUpdate | None) -> VehicleMemory:
    """The memory after other rally points were taken."""
    if update is None or update.source is None:
        return vehicle
    return changed_by(vehicle, update.source.sender)


def told(places: tuple[Vec2, ...]) -> str:
    """Places [m] in words."""
    named = [f"{north:.1f} m north {east:.1f} m east" for north, east in places[:_NAMED]]
    more = [f"{len(places) - _NAMED} more"] if len(places) > _NAMED else []
    return ", ".join([*named, *more]) or "none"
