"""The vehicle's modes as one pure transition table.

=============  ==========================================================
mode           meaning
=============  ==========================================================
disarmed       rotors off, arm limp
takeoff        end-effector reference climbs from where the vehicle stood
hold           stays where it was or goes to a place; on the ground, rotors idle
mission        the uploaded mission is flown
return         climbs, goes home, then lands
orbit          circles a point, level
offboard       a ground station's set-points for now are followed
trajectory     the streamed end-effector reference is followed
land           reference descends until the ground is felt, then disarms
fault          terminated: outputs are zero until restarted
=============  ==========================================================
"""

from __future__ import annotations

from enum import Enum

from fsw.signals import Mode


class Event(Enum):
    """What can move the vehicle from one mode to another."""

    ARM = "arm"
    DISARM = "disarm"
    TAKE_OFF = "take off"
    HOLD = "hold"
    FOLLOW = "follow trajectory"
    START_MISSION = "start mission"
    GO_HOME = "return"
    GO_OFFBOARD = "offboard"
    CIRCLE = "orbit"
    LAND = "land"
    CLIMB_DONE = "climb done"
    TRAJECTORY_DONE = "trajectory done"
    MISSION_DONE = "mission done"
    HOME_REACHED = "return point reached"
    TOUCHED_DOWN = "touched down"
    TERMINATE = "terminate"


# Whoever wants to steer a vehicle that lands asks it to hold first.
_STEERABLE = (
    Mode.TAKEOFF,
    Mode.HOLD,
    Mode.MISSION,
    Mode.RETURN,
    Mode.OFFBOARD,
    Mode.ORBIT,
    Mode.TRAJECTORY,
)
ARMED = (*_STEERABLE, Mode.LAND)

TRANSITIONS: dict[tuple[Mode, Event], Mode] = {
    (Mode.DISARMED, Event.ARM): Mode.HOLD,
    **{(mode, Event.TAKE_OFF): Mode.TAKEOFF for mode in (Mode.HOLD, Mode.MISSION, Mode.OFFBOARD)},
    **{(mode, Event.FOLLOW): Mode.TRAJECTORY for mode in _STEERABLE},
    **{(mode, Event.START_MISSION): Mode.MISSION for mode in _STEERABLE},
    **{(mode, Event.GO_OFFBOARD): Mode.OFFBOARD for mode in _STEERABLE},
    **{(mode, Event.CIRCLE): Mode.ORBIT for mode in _STEERABLE},
    **{(mode, Event.GO_HOME): Mode.RETURN for mode in ARMED},
    **{(mode, Event.HOLD): Mode.HOLD for mode in ARMED},
    **{(mode, Event.LAND): Mode.LAND for mode in ARMED},
    **{(mode, Event.DISARM): Mode.DISARMED for mode in ARMED},
    (Mode.TAKEOFF, Event.CLIMB_DONE): Mode.HOLD,
    (Mode.TRAJECTORY, Event.TRAJECTORY_DONE): Mode.HOLD,
    (Mode.MISSION, Event.MISSION_DONE): Mode.HOLD,
    (Mode.RETURN, Event.HOME_REACHED): Mode.LAND,
    (Mode.LAND, Event.TOUCHED_DOWN): Mode.DISARMED,
    **{(mode, Event.TERMINATE): Mode.FAULT for mode in (Mode.DISARMED, *ARMED)},
}


def next_mode(mode: Mode, event: Event) -> Mode | None:
    """The mode after an event, or None where the event means nothing in this mode."""
    return TRANSITIONS.get((mode, event))
