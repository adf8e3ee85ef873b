"""Where a return ends, and with it a failsafe that returns: at home, or at a nearer rally point.

Every change is told, with who made it. While armed it is for the source that armed the vehicle, and
for the system that SAFE_OWNER names, alone. Where neither is known, the first that changes it owns
it until the vehicle is armed again: a scenario arms, or PX4.
"""

from __future__ import annotations

from fsw.autopilot.flight.state import FlightState, MissionMemory
from fsw.autopilot.shapes.zones import surfaces
from fsw.autopilot.signals import VEHICLE_PILOT, Home, SafeSet, Sender, Vec2
from fsw.frozen import replace

_NAMED = 3  # places; the others are counted


def commanded(state: FlightState, sender: Sender, home: Home | None, *, arms: bool) -> FlightState:
    """The state after a command of a sender, which ``arms`` or sets ``home``, or neither."""
    mission = state.mission
    if arms:
        mission = replace(mission, home_owner=None if sender == VEHICLE_PILOT else sender)
    elif home is not None:
        mission = changed(mission, sender, armed=state.vehicle.armed)
    return state if mission is state.mission else replace(state, mission=mission)


def changed(mission: MissionMemory, sender: Sender, *, armed: bool) -> MissionMemory:
    """The memory after a sender has changed where a return ends."""
    if not armed or mission.home_owner is not None:
        return mission
    return replace(mission, home_owner=sender)


def against(mission: MissionMemory, sender: Sender | None, chosen: int, *, armed: bool) -> str:
    """Why a sender may not change where a return ends; empty if it may.

    The ``chosen`` system always may; 0: none is.
    """
    owner = mission.home_owner
    if not armed or sender is None or sender == owner:
        return ""
    if sender[0] == chosen != 0 or (owner is None and not chosen):
        return ""
    whose = f"system {chosen}" if owner is None else f"{owner[0]}/{owner[1]}"
    return f"while armed only {whose} may change where a return ends"


def outside(fence: SafeSet, north_east: Vec2) -> str:
    """Why a return cannot end at ``north_east`` [m, NED]: a fence is the same at every height.

    A sphere that follows the target says nothing of places.
    """
    for number, at in enumerate(surfaces(fence, (*north_east, 0.0), 0), start=1):
        if not at.distance > 0.0:
            return f"it is outside the fence, by {-at.distance:.2f} m at its zone {number}"
    return ""


def told(places: tuple[Vec2, ...]) -> str:
    """The ``places`` [m, NED] in words."""
    named = [f"{north:.1f} m north {east:.1f} m east" for north, east in places[:_NAMED]]
    more = [f"{len(places) - _NAMED} more"] if len(places) > _NAMED else []
    return ", ".join([*named, *more]) or "none"
