"""Which links to the ground a flight has, as chosen on the command line."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from command_line.options import option, switch
from command_line.values import one_of, place
from fsw.geometry.geodesy import DEFAULT_ORIGIN
from fsw.link.udp_endpoint import Address, LinkError, parse_address
from fsw.link.wire.telemetry_context import GENERIC, PX4
from fsw.signals import Origin

NO_LINK: Final = "none"
AUTOPILOTS: Final = {"px4": PX4, "generic": GENERIC}


def parse_origin(text: str) -> Origin:
    """Read LATITUDE,LONGITUDE,ALTITUDE in degrees and metres.

    Raises:
        ValueError: It is no place.
    """
    return Origin(*place(text))


def origin_text(origin: Origin) -> str:
    """The opposite of :func:`parse_origin`."""
    return f"{origin.latitude!r},{origin.longitude!r},{origin.altitude!r}"


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkChoice:
    """Where telemetry goes and who is heard; the fields are the options of a command line."""

    gcs: str = option(
        "--gcs udp:HOST:PORT", "GCS address for telemetry", default="udp:127.0.0.1:14550"
    )
    api: str = option(
        "--api udp:HOST:PORT",
        "address of a program, such as one with MAVSDK, or none",
        default="udp:127.0.0.1:14540",
    )
    allow_remote: bool = switch(
        "--allow-remote", "accept other machines even while telemetry goes to this one"
    )
    autopilot: str = option(
        "--autopilot NAME",
        "MAV_AUTOPILOT reported in HEARTBEAT: px4 or generic",
        one_of("autopilot", *AUTOPILOTS),
        default="px4",
    )
    origin: Origin = option(
        "--origin LAT,LON,ALT",
        "origin of the local frame, in degrees and metres above sea level; "
        "a negative latitude needs --origin=LAT,LON,ALT",
        parse_origin,
        default=DEFAULT_ORIGIN,
        text=origin_text,
    )
    keys: Path | None = option(
        "--keys DIR", "directory of the signing keys (default ~/.local/state/pandion)", Path
    )


def addresses(choice: LinkChoice) -> tuple[Address, Address | None]:
    """Where ground stations and programs are: ``--gcs`` and ``--api`` of a choice.

    Raises:
        LinkError: One of them is none.
    """
    api = None if choice.api == NO_LINK else parse_address(choice.api)
    gcs = parse_address(choice.gcs)
    if api == gcs:
        raise LinkError(f"--gcs and --api are both {choice.gcs}; give them different ports")
    return gcs, api
