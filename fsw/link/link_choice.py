"""Which links to the ground a flight has, as chosen on the command line."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from fsw.geometry.geodesy import DEFAULT_ORIGIN
from fsw.link.udp_endpoint import Address, LinkError, parse_address
from fsw.link.wire.telemetry_context import GENERIC, PX4
from fsw.signals import Origin

NO_LINK: Final = "none"
AUTOPILOTS: Final = {"px4": PX4, "generic": GENERIC}


@dataclass(frozen=True, slots=True)
class LinkChoice:
    """Addresses of the links; the defaults are those of the command line."""

    gcs: str = "udp:127.0.0.1:14550"  # udp:HOST:PORT of the ground station
    api: str = "udp:127.0.0.1:14540"  # the same of a program, or "none"
    allow_remote: bool = False  # hear other machines though both are on this one
    autopilot: str = "px4"  # or "generic": MAV_AUTOPILOT reported in HEARTBEAT
    origin: Origin = DEFAULT_ORIGIN  # where on Earth the local frame begins
    keys: Path | None = None  # directory of the signing keys; None: default_keys()

    def as_arguments(self) -> list[str]:
        """The same as words of a command line."""
        words = [f"--gcs={self.gcs}", f"--api={self.api}", f"--autopilot={self.autopilot}"]
        place = self.origin
        if place != DEFAULT_ORIGIN:
            words.append(f"--origin={place.latitude!r},{place.longitude!r},{place.altitude!r}")
        if self.allow_remote:
            words.append("--allow-remote")
        if self.keys is not None:
            words.append(f"--keys={self.keys}")
        return words


def parse_origin(text: str) -> Origin:
    """Read LATITUDE,LONGITUDE,ALTITUDE in degrees and metres.

    Raises:
        ValueError: It is no place.
    """
    try:
        latitude, longitude, altitude = (float(word) for word in text.split(","))
    except ValueError:
        raise ValueError(f"origin '{text}' is not LATITUDE,LONGITUDE,ALTITUDE") from None
    # At the poles there is no north.
    if not (abs(latitude) <= 89.0 and abs(longitude) <= 180.0 and -500.0 <= altitude <= 9000.0):
        raise ValueError(
            f"origin '{text}' is out of range: latitude -89 to 89, longitude -180 to 180 degrees, "
            "altitude -500 to 9000 m"
        )
    return Origin(latitude, longitude, altitude)


@dataclass(frozen=True, slots=True)
class LinkAddresses:
    """A choice, checked."""

    gcs: Address
    api: Address | None


def addresses(choice: LinkChoice) -> LinkAddresses:
    """Read the addresses of a choice.

    Raises:
        LinkError: One of them is none.
    """
    api = None if choice.api == NO_LINK else parse_address(choice.api)
    gcs = parse_address(choice.gcs)
    if api == gcs:
        raise LinkError(f"--gcs and --api are both {choice.gcs}; give them different ports")
    return LinkAddresses(gcs, api)


def default_keys() -> Path:
    """Default directory of signing keys."""
    state = os.environ.get("XDG_STATE_HOME")
    return (Path(state) if state else Path.home() / ".local" / "state") / "pandion"
