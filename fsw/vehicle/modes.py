"""The vehicle's modes as one pure transition table.

=============  ==========================================================
mode           meaning
=============  ==========================================================
disarmed       rotors off, arm limp
takeoff        end-effector reference climbs from where the vehicle stood
hold           end-effector stays where it was; on the ground, rotors idle
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
    LAND = "land"
    CLIMB_DONE = "climb done"
    TRAJECTORY_DONE = "trajectory done"
    TOUCHED_DOWN = "touched down"
    TERMINATE = "terminate"


_FLYING = (Mode.TAKEOFF, Mode.HOLD, Mode.TRAJECTORY, Mode.LAND)

TRANSITIONS: dict[tuple[Mode, Event], Mode] = {
    (Mode.DISARMED, Event.ARM): Mode.HOLD,
    (Mode.HOLD, Event.TAKE_OFF): Mode.TAKEOFF,
    (Mode.HOLD, Event.FOLLOW): Mode.TRAJECTORY,
    (Mode.TAKEOFF, Event.CLIMB_DONE): Mode.HOLD,
    (Mode.TRAJECTORY, Event.TRAJECTORY_DONE): Mode.HOLD,
    (Mode.LAND, Event.TOUCHED_DOWN): Mode.DISARMED,
    **{(mode, Event.HOLD): Mode.HOLD for mode in _FLYING},
    **{(mode, Event.LAND): Mode.LAND for mode in _FLYING},
    **{(mode, Event.DISARM): Mode.DISARMED for mode in _FLYING},
    **{(mode, Event.TERMINATE): Mode.FAULT for mode in (Mode.DISARMED, *_FLYING)},
}


def next_mode(mode: Mode, event: Event) -> Mode | None:
    """The mode after an event, or None where the event means nothing in this mode."""
    return TRANSITIONS.get((mode, event))
