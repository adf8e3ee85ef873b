"""``pandion top``: a running vehicle's messages, margins and texts in a terminal."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Final

from command_line.options import option, read
from command_line.output import print_error
from command_line.parser import COULD_NOT_START
from messages.addresses import LinkError, parse_link_address
from vehicles.vehicle_file import VehicleError, load_vehicle

LEFT: Final = 0  # exit code


@dataclass(frozen=True, slots=True, kw_only=True)
class TopOptions:
    """One inspector."""

    vehicle: str = option(
        "--vehicle ADDRESS",
        "of the vehicle: udp:HOST:PORT, tcp:HOST:PORT or serial:DEVICE:BAUD",
        default="udp:127.0.0.1:18570",
    )
    airframe: str = option(
        "--airframe NAME",
        "what the vehicle is, which messages do not tell: a vehicle that comes with Pandion, or a "
        ".toml file",
        default="paper",
    )


def main(argv: list[str]) -> int:
    """Watch until the user leaves; returns the exit code."""
    what = "Inspect a running vehicle: rates and fields of its messages, margins, texts."
    options = read(TopOptions, "pandion top", what, argv)
    try:
        vehicle, flown = parse_link_address(options.vehicle), load_vehicle(options.airframe)
        if not sys.stdout.isatty():
            print_error("pandion top", "needs a terminal; over SSH: ssh -t HOST pandion top")
            return COULD_NOT_START
        from fsw.autopilot.model.airframe import airframe_of
        from view.top.app import TopApp
        from view.top.peer import TelemetryPeer

        app = TopApp(TelemetryPeer(vehicle), airframe_of(flown))
    except (LinkError, VehicleError) as error:
        print_error("pandion top", error)
        return COULD_NOT_START
    app.run()
    return app.return_code or LEFT  # 1 after an exception, which it has printed and does not raise
