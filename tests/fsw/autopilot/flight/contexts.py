"""Contexts of commands that several tests start from."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from fsw.autopilot.flight.commands.arming_health import ArmingHealth
from fsw.autopilot.flight.modes.base import CommandContext
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.signals import MissionProgress, Mode, SafeSet
from fsw.autopilot.tuning import tuned

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
    now_us=0,
    config=flight_config(body="points"),
    health=ArmingHealth(joints=(0.0, 0.0)),
    blocked="",
    speed=1.0,
)
READY = replace(STANDING, mission_refusal=None, setpoint_fresh=True, targets_ahead=True)
_FLYING = replace(READY, mode=Mode.HOLD, landed=False)


def flying(**changes: Any) -> CommandContext:
    """In the air, with everything that any mode needs."""
    return replace(_FLYING, **changes)


def tuned_by(context: CommandContext, path: str, value: float) -> CommandContext:
    """The same of a vehicle with another number in its configuration."""
    return replace(context, config=tuned(context.config, ((path, value),)))
