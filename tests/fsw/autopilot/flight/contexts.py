"""Contexts of commands that several tests start from."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from fsw.autopilot.flight.commands.arming_health import ArmingHealth
from fsw.autopilot.flight.modes.base import CommandContext
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.model.body import body_of
from fsw.autopilot.signals import MissionProgress, Mode, SafeSet

STANDING = CommandContext(
    mode=Mode.DISARMED,
    landed=True,
    estimate_valid=True,
    targets_ahead=False,
    standing_unclear=False,
    inconsistent="",
    mission=MissionProgress(),
    mission_refusal="no mission: none was uploaded",
    setpoint_fresh=False,
    setpoint_problem="",
    position=(0.0, 0.0, 0.0),
    yaw=0.0,
    joints=(0.0, 0.0),
    home=None,
    safe_set=SafeSet(),
    body=body_of("points", AIRFRAME),
    now_us=0,
    climb_range=(0.3, 50.0),
    airframe=AIRFRAME,
    health=ArmingHealth(),
    blocked="",
    speed=1.0,
    max_speed=1.5,
    yaw_rate=0.3,
    acceleration=1.0,
)
READY = replace(STANDING, mission_refusal=None, setpoint_fresh=True, targets_ahead=True)
_FLYING = replace(READY, mode=Mode.HOLD, landed=False)


def flying(**changes: Any) -> CommandContext:
    """In the air, with everything that any mode needs."""
    return replace(_FLYING, **changes)
