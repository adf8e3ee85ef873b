"""One file a flight mode; a file that is added here is a mode that can be flown."""

from __future__ import annotations

import importlib
import pkgutil
from typing import Final

from fsw.autopilot.flight.modes.base import FlightMode
from fsw.autopilot.signals import Mode


def _found() -> dict[Mode, type[FlightMode]]:
    """The subclass of each module of this folder, in the order of ``Mode``."""
    for module in pkgutil.iter_modules(__path__):
        importlib.import_module(f"{__name__}.{module.name}")
    known = {kind.mode: kind for kind in FlightMode.__subclasses__()}
    return {mode: known[mode] for mode in Mode if mode in known}


MODES: Final = _found()
# PX4's NAVIGATION_STATE. It has none for a disarmed vehicle, which shows what it would start in.
NAV_STATES: Final = {
    Mode.DISARMED: MODES[Mode.HOLD].px4.nav_state,
    **{mode: kind.px4.nav_state for mode, kind in MODES.items()},
    Mode.FAULT: 13,  # termination
}
