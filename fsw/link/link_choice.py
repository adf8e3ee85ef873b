"""Which links to the ground a flight has, as chosen on the command line."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from command_line.options import option, switch
from command_line.values import one_of, place
from fsw.autopilot.geometry.geodesy import DEFAULT_ORIGIN
from fsw.autopilot.signals import Origin
from fsw.link.wire.outgoing import GENERIC, PX4
from messages.addresses import LinkAddress, LinkError, SerialLine, parse_link_address

NO_LINK: Final = "none"
AUTOPILOTS: Final = {"px4": PX4, "generic": GENERIC}


def parse_origin(text: str) -> Origin:
    """Read LATITUDE,LONGITUDE,ALTITUDE in degrees and metres; ``ValueError`` if it is no place."""
    return Origin(*place(text))


def origin_text(origin: Origin) -> str:
    """The opposite of :func:`parse_origin`."""
    return f"{origin.latitude!r},{origin.longitude!r},{origin.altitude!r}"


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkChoice:
    """Where telemetry goes and who is heard; the fields are the options of a command line."""

    gcs: str = option(
        "--gcs ADDRESS",
        "of the ground station: udp:HOST:PORT, tcp:HOST:PORT, tcpin:HOST:PORT (listens) or "
        "serial:DEVICE:BAUD",
        default="udp:127.0.0.1:14550",
    )
    api: str = option(
        "--api ADDRESS",
        "the same of a program, such as one with MAVSDK, or none",
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


def addresses(choice: LinkChoice) -> tuple[LinkAddress, LinkAddress | None]:
    """Where ground stations and programs are; ``LinkError`` if that is no address, or the same."""
    api = None if choice.api == NO_LINK else parse_link_address(choice.api)
    gcs = parse_link_address(choice.gcs)
    # Two links cannot both speak on one serial line, whatever its speed.
    lines = [one.device for one in (api, gcs) if isinstance(one, SerialLine)]
    if api == gcs or len(set(lines)) < len(lines):
        raise LinkError(
            f"--gcs {choice.gcs} and --api {choice.api} are the same; "
            "give them different ports or lines"
        )
    return gcs, api
