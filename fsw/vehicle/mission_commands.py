"""Commands about the uploaded mission."""

from __future__ import annotations

import math
from dataclasses import replace

from fsw.signals import CommandRequest, Mode
from fsw.vehicle.mode_commands import arm, enter
from fsw.vehicle.modes import Event
from fsw.vehicle.situation import ACCEPTED, DENIED, TEMPORARILY_REJECTED, Decision, Situation


def start_mission(request: CommandRequest, situation: Situation) -> Decision:
    """MISSION_START; parameter 1 is the step to begin with, parameter 2 the last one.

    A vehicle that is not armed is armed by it, as PX4 does.
    """
    first, last = request.params[0], request.params[1]
    total = situation.mission.total
    if math.isfinite(last) and 0.0 < last < total - 1:
        return Decision(DENIED, reason="no mission: it can be flown to its last step only")
    decision = enter(Event.START_MISSION, situation)
    if decision.result == ACCEPTED and situation.mode is Mode.DISARMED:
        armed = arm(situation)
        decision = replace(armed, standby=Mode.MISSION) if armed.event is not None else armed
    if decision.result != ACCEPTED or not (math.isfinite(first) and first > 0.0):
        return decision
    if not first < total:
        return Decision(DENIED, reason=_no_step(first, total))
    return replace(decision, mission_step=int(first))


def pause_or_continue(request: CommandRequest, situation: Situation) -> Decision:
    """DO_PAUSE_CONTINUE: hold where the vehicle is, or go on with the current step."""
    wish = request.params[0]
    if wish == 0.0:
        if situation.mode not in (Mode.MISSION, Mode.HOLD):
            reason = f"not paused: no mission is flown while {situation.mode.value}"
            return Decision(TEMPORARILY_REJECTED, reason=reason)
        return enter(Event.HOLD, situation)
    if wish == 1.0:
        return enter(Event.START_MISSION, situation)
    return Decision(DENIED, reason="pause/continue wants param1 = 0 or 1")


def set_current(request: CommandRequest, situation: Situation) -> Decision:
    """DO_SET_MISSION_CURRENT; -1 in parameter 1 is the current step, 1 in parameter 2 resets."""
    number, reset = request.params[0], request.params[1]
    total = situation.mission.total
    if number == -1.0:
        number = 0.0 if reset == 1.0 else float(situation.mission.current)
    if not 0.0 <= number < total:
        return Decision(DENIED, reason=_no_step(number, total))
    return Decision(ACCEPTED, mission_step=int(number))


def _no_step(number: float, total: int) -> str:
    return f"there is no mission step {number:g}; {total} were uploaded"
