"""What the vehicle is, and its flight modes in PX4's numbering; pure, in wire order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from command_line.version import version
from fsw.autopilot.flight.modes import MODES
from fsw.autopilot.signals import FlightSnapshot, Mode
from fsw.link.wire.outgoing import Outgoing, TelemetryContext, WireValues
from messages import message_ids

# MAV_PROTOCOL_CAPABILITY: missions in floats and integers, float parameters, encoded bytewise
# (which is one with a cast for a REAL32), COMMAND_INT, FTP, SET_ATTITUDE_TARGET,
# SET_POSITION_TARGET_LOCAL_NED, flight termination, MAVLink 2, fence and rally points.
_CAPABILITIES: Final = 1 | 2 | 4 | 8 | 16 | 32 | 64 | 128 | 2048 | 8192 | 16384 | 32768
# The release of PX4 whose behaviour towards ground stations is followed: QGroundControl asks for
# 1.4.1 at least. It is marked as a development version, which is no release of anybody's; Pandion's
# own version is that of the middleware (docs/decisions/0018-px4-compatibility.md).
_FOLLOWED: Final = 1 << 24 | 16 << 16
_PROTOCOL_1, _PROTOCOL_2 = 100, 200
_UID: Final = int.from_bytes(b"PANDION", "big")
_NAME_SIZE: Final = 35  # bytes of mode_name
_UNRELEASED: Final = 0  # FIRMWARE_VERSION_TYPE_DEV
_NOT_SELECTABLE: Final = 2  # MAV_MODE_PROPERTY: entered by a command of its own
# A disarmed vehicle has no flight mode of its own; PX4 shows the one it would start in. Terminated,
# rotors off: PX4 has no mode for it; system_status says that it is an emergency.
_SHOWN_AS: Final = {Mode.DISARMED: Mode.HOLD, Mode.FAULT: Mode.LAND}

MODE_BY_PX4: Final = {
    (float(m.px4.main), float(m.px4.sub)): mode for mode, m in MODES.items() if m.px4.offered
}
MODE_BY_STANDARD: Final = {
    float(m.px4.standard or m.px4.also_standard): mode
    for mode, m in MODES.items()
    if m.px4.selectable and (m.px4.standard or m.px4.also_standard)
}


@dataclass(frozen=True, slots=True)
class AvailableMode:
    """One row of AVAILABLE_MODES."""

    name: str
    custom_mode: int
    standard_mode: int  # MAV_STANDARD_MODE, 0 where it is none of those
    properties: int  # MAV_MODE_PROPERTY


def shown_mode(snapshot: FlightSnapshot) -> Mode:
    """The mode for ground stations: while disarmed the one that arming would lead to."""
    return snapshot.intended_mode if snapshot.mode is Mode.DISARMED else snapshot.mode


def custom_mode(mode: Mode) -> int:
    """PX4's custom_mode: main mode in bits 16 to 23, sub mode in bits 24 to 31."""
    px4 = MODES[_SHOWN_AS.get(mode, mode)].px4
    return px4.main << 16 | px4.sub << 24


# What a ground station may offer, in the order of AVAILABLE_MODES.
AVAILABLE_MODES: Final = tuple(
    AvailableMode(
        mode.value.capitalize(),
        custom_mode(mode),
        kind.px4.standard,
        0 if kind.px4.selectable else _NOT_SELECTABLE,
    )
    for mode, kind in MODES.items()
    if kind.px4.offered
)


def _version_number() -> int:
    """Major, minor and patch in the upper three bytes."""
    try:
        major, minor, patch = (int(part) for part in version().split(".")[:3])
    except ValueError:
        return 0
    return major << 24 | minor << 16 | patch << 8 | _UNRELEASED


_VERSION: Final = _version_number()


def autopilot_version(_: FlightSnapshot, __: TelemetryContext) -> WireValues:
    """AUTOPILOT_VERSION: the PX4 that is followed, our version as middleware, and nothing else."""
    return (_CAPABILITIES, _UID, _FOLLOWED | _UNRELEASED, _VERSION, *(0,) * 46)


def current_mode(snapshot: FlightSnapshot, _: TelemetryContext) -> WireValues:
    """CURRENT_MODE, and the one that was intended where a failsafe has taken over."""
    number = custom_mode(shown_mode(snapshot))
    standard = next((m.standard_mode for m in AVAILABLE_MODES if m.custom_mode == number), 0)
    before = snapshot.failsafe_from
    return (number, number if before is None else custom_mode(before), standard)


def protocol_version(_: FlightSnapshot, __: TelemetryContext) -> WireValues:
    """PROTOCOL_VERSION: 2, and 1 for peers that use it; the hashes are not set."""
    return (_PROTOCOL_2, _PROTOCOL_1, _PROTOCOL_2, *(0,) * 16)


def available_modes(which: float, _: FlightSnapshot, __: TelemetryContext) -> Sequence[Outgoing]:
    """AVAILABLE_MODES: all of them, or the one whose number ``which`` [1], from 1, is asked for."""
    count = len(AVAILABLE_MODES)
    every = not which >= 1.0  # NaN and 0 ask for all
    return [
        Outgoing(
            message_ids.AVAILABLE_MODES,
            (
                *(mode.custom_mode, mode.properties, count, number, mode.standard_mode),
                mode.name.encode("ascii")[: _NAME_SIZE - 1],
            ),
        )
        for number, mode in enumerate(AVAILABLE_MODES, start=1)
        if every or number == which
    ]
