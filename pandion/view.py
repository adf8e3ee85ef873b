"""``pandion view``: a flight as a page in a browser, from its log or live."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from command_line.options import option, read
from command_line.output import complain, say
from command_line.parser import COULD_NOT_START
from command_line.values import whole

if TYPE_CHECKING:
    from view.flight import Flight

DONE: Final = 0  # exit code
PORT: Final = 8042


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewOptions:
    """What to show, and where."""

    log: Path | None = option(
        "LOG", "flight.ulg, flight.tlog or the flight's directory; none: a running vehicle", Path
    )
    port: int = option(
        "--port N", "of the page; 0: any that is free", whole(0, 65535), default=PORT
    )
    host: str = option(
        "--host ADDRESS", "to serve the page at; 0.0.0.0: to other machines", default="127.0.0.1"
    )


def main(argv: list[str]) -> int:
    """Show until interrupted; returns the exit code."""
    what = "Show a flight in the browser: a log, or without one a running vehicle."
    options = read(ViewOptions, "pandion view", what, argv)
    try:
        return _show(options)
    except ModuleNotFoundError as error:
        complain("pandion view", f"needs the package {error.name}; install pandion[view]")
        return COULD_NOT_START


def _show(options: ViewOptions) -> int:
    from view.flight_data import UlogError
    from view.log_page import LogPage
    from view.page import PageError, address, open_server

    assert options.log is not None
    try:
        flight = _opened(options.log)
        server = open_server(options.host, options.port, flight.title)
    except (UlogError, PageError) as error:
        complain("pandion view", error)
        return COULD_NOT_START
    page = LogPage(server, flight)
    say(f"{flight.title}: open {address(server)}; Ctrl-C ends")
    try:
        threading.Event().wait()
    except KeyboardInterrupt:
        pass
    finally:
        page.close()
        server.stop()
    return DONE


def _opened(path: Path) -> Flight:
    from view.log_flight import LogFlight

    return LogFlight(path)
