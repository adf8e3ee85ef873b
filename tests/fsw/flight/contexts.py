"""Contexts of commands that several tests start from."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from fsw.flight.modes.base import CommandContext
from fsw.signals import Mode

STANDING = CommandContext(Mode.DISARMED, landed=True, estimate_valid=True, targets_ahead=False)
READY = replace(STANDING, mission_refusal=None, setpoint_fresh=True, targets_ahead=True)
_FLYING = replace(READY, mode=Mode.HOLD, landed=False)


def flying(**changes: Any) -> CommandContext:
    """In the air, with everything that any mode needs."""
    return replace(_FLYING, **changes)
