"""The arming checks."""

from __future__ import annotations

from fsw.flight.modes.base import CommandContext
from fsw.signals import Charge


def refusal(context: CommandContext, *, force: bool = False) -> str | None:
    """Why the vehicle cannot be armed now; force overrides all but a missing estimate."""
    if not context.estimate_valid:
        return "not armed: the state estimate is invalid"
    if force:
        return None
    if context.standing_unclear:
        return "not armed: neither at rest on the ground nor clearly in the air; check the height"
    if context.charge >= Charge.CRITICAL:
        return "not armed: the battery is nearly empty"
    return f"not armed: {context.inconsistent}" if context.inconsistent else None


def is_permanent(context: CommandContext) -> bool:
    """Whether the configuration prevents arming, so that waiting does not help."""
    ready = not context.standing_unclear and context.charge < Charge.CRITICAL
    return context.estimate_valid and ready and bool(context.inconsistent)
