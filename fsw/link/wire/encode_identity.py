"""What the vehicle is and which modes it has; pure, in wire order."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Final

from fsw.link.wire import message_ids
from fsw.link.wire.outgoing import Outgoing, WireValues
from fsw.link.wire.px4_mode import AVAILABLE_MODES, custom_mode, shown_mode
from fsw.link.wire.telemetry_context import TelemetryContext
from fsw.signals import FlightSnapshot

# MAV_PROTOCOL_CAPABILITY: float parameters, COMMAND_INT, FTP, SET_ATTITUDE_TARGET,
# SET_POSITION_TARGET_LOCAL_NED, MAVLink 2, and missions with fence and rally points, as integers.
_CAPABILITIES: Final = 2 | 4 | 8 | 32 | 64 | 128 | 8192 | 16384 | 32768
_UID: Final = int.from_bytes(b"PANDION", "big")
_NAME_SIZE: Final = 35  # bytes of mode_name
_UNRELEASED: Final = 0  # FIRMWARE_VERSION_TYPE_DEV


def _version_number() -> int:
    """Major, minor and patch in the upper three bytes."""
    try:
        parts = version("pandion").split(".")[:3]
        major, minor, patch = (int(part) for part in parts)
    except (PackageNotFoundError, ValueError):
        return 0
    return major << 24 | minor << 16 | patch << 8 | _UNRELEASED


_VERSION: Final = _version_number()


def autopilot_version(_: FlightSnapshot, __: TelemetryContext) -> WireValues:
    """AUTOPILOT_VERSION: our own version, not one of PX4's."""
    nothing = (0,) * 8
    return (
        *(_CAPABILITIES, _UID, _VERSION, 0, 0, 0, 0, 0),
        *nothing,
        *nothing,
        *nothing,
        *(0,) * 18,
    )


def current_mode(snapshot: FlightSnapshot, _: TelemetryContext) -> WireValues:
    """CURRENT_MODE; what was intended is not told apart from what is."""
    number = custom_mode(shown_mode(snapshot))
    standard = next((m.standard_mode for m in AVAILABLE_MODES if m.custom_mode == number), 0)
    return (number, 0, standard)


def available_modes(which: float, _: FlightSnapshot, __: TelemetryContext) -> Sequence[Outgoing]:
    """AVAILABLE_MODES: all of them, or the one whose number, from 1, is asked for."""
    count = len(AVAILABLE_MODES)
    every = not which >= 1.0  # NaN and 0 ask for all
    return [
        Outgoing(
            message_ids.AVAILABLE_MODES,
            (mode.custom_mode, 0, count, number, mode.standard_mode, _name(mode.name)),
        )
        for number, mode in enumerate(AVAILABLE_MODES, start=1)
        if every or number == which
    ]


def _name(name: str) -> bytes:
    return name.encode("ascii")[: _NAME_SIZE - 1]
