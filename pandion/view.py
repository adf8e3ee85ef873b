"""``pandion view``: a flight as a page in a browser, from its log or live."""

from __future__ import annotations

import contextlib
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from command_line.options import option, read, switch
from command_line.output import print_error, say
from command_line.parser import COULD_NOT_START
from command_line.values import whole
from pandion.view_beside import PORT

if TYPE_CHECKING:
    from view.flight import Flight

DONE: Final = 0  # exit code
VEHICLE: Final = "udp:127.0.0.1:18570"


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewOptions:
    """What to show, and where."""

    log: Path | None = option(
        "LOG", "flight.ulg, flight.tlog or the flight's directory; none: a running vehicle", Path
    )
    vehicle: str = option(
        "--vehicle ADDRESS",
        "of a running vehicle: udp:HOST:PORT, tcp:HOST:PORT or serial:DEVICE:BAUD",
        default=VEHICLE,
    )
    airframe: str = option(
        "--airframe NAME",
        "what a running vehicle or that of a .tlog is, which messages do not tell: a vehicle that "
        "comes with Pandion, or a .toml file",
        default="paper",
    )
    port: int = option(
        "--port N", "of the page; 0: any that is free", whole(0, 65535), default=PORT
    )
    host: str = option(
        "--host ADDRESS", "to serve the page at; 0.0.0.0: to other machines", default="127.0.0.1"
    )
    allow_commands: bool = switch(
        "--allow-commands", "command the vehicle from other machines as well"
    )


def main(argv: list[str]) -> int:
    """Show until interrupted; returns the exit code."""
    what = "Show a flight in the browser: a log, or without one a running vehicle."
    options = read(ViewOptions, "pandion view", what, argv)
    return _show_live(options) if options.log is None else _show_log(options, options.log)


def _show_log(options: ViewOptions, log: Path) -> int:
    from vehicles.vehicle_file import VehicleError
    from view.flight_data import UlogError

    try:
        flight = _opened(log, options.airframe)
    except (UlogError, VehicleError) as error:
        print_error("pandion view", error)
        return COULD_NOT_START
    from view.log_page import LogPage
    from view.page import PageError, address, open_server

    try:
        server = open_server(options.host, options.port, flight.title)
    except PageError as error:
        print_error("pandion view", error)
        return COULD_NOT_START
    for sentence in flight.unusable:
        print_error("pandion view", f"{sentence}; shown without it")
    page = LogPage(server, flight)
    say(f"{flight.title}: open {address(server)}; Ctrl-C ends")
    try:
        _wait()
    finally:
        page.close()
        server.stop()
    return DONE


def _show_live(options: ViewOptions) -> int:
    from fsw.autopilot.model.airframe import airframe_of
    from messages.addresses import LinkError, parse_link_address
    from vehicles.vehicle_file import VehicleError, load_vehicle
    from view.live_link import VehicleLink
    from view.live_page import LivePage
    from view.page import LOCAL, PageError, address, open_server

    try:
        commands = options.host in LOCAL or options.allow_commands
        where, airframe = parse_link_address(options.vehicle), load_vehicle(options.airframe)
        link = VehicleLink(where, airframe_of(airframe), commands=commands)
        server = open_server(options.host, options.port, f"vehicle at {options.vehicle}")
    except (LinkError, PageError, VehicleError) as error:
        print_error("pandion view", error)
        return COULD_NOT_START
    link.start()
    page = LivePage(server, link)
    can = "" if commands else ", read only"
    say(f"vehicle at {options.vehicle}{can}: open {address(server)}; Ctrl-C ends")
    try:
        _wait()
    finally:
        page.close()
        link.close()
        server.stop()
    return DONE


def _wait() -> None:
    """Until Ctrl-C."""
    with contextlib.suppress(KeyboardInterrupt):
        threading.Event().wait()


def _opened(path: Path, airframe: str) -> Flight:
    """By what it begins with: ground stations name their logs .tlog, .TLOG, .raw and otherwise."""
    from messages.ulog_reader import is_ulog

    if path.suffix == ".ulg" or path.is_dir() or is_ulog(path):
        from view.log_flight import LogFlight

        return LogFlight(path)
    from fsw.autopilot.model.airframe import airframe_of
    from vehicles.vehicle_file import load_vehicle
    from view.tlog_flight import TlogFlight

    return TlogFlight(path, airframe_of(load_vehicle(airframe)))
