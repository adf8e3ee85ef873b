"""What all pages share: the server, its look, and who may do what with it."""

from __future__ import annotations

import contextlib
import io
import re
import socket
from collections.abc import Iterator
from functools import partial
from typing import Final

import viser
import websockets.asyncio.server

LOCAL: Final = ("127.0.0.1", "localhost", "::1")


class PageError(Exception):
    """A page that cannot be shown, in one sentence."""


class Server(viser.ViserServer):
    """viser's, without the tunnel to another host that a browser could ask it for."""

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Refuse: anyone with the address could command the vehicle."""
        return None

    def stop(self) -> None:
        """Stop serving, without a word."""
        with contextlib.redirect_stdout(io.StringIO()):
            super().stop()


def open_server(host: str, port: int, title: str) -> Server:
    """A page's server at a port of this machine.

    Raises:
        PageError: The port is in use, or the address is none of this machine.
    """
    with socket.socket() as probe:  # viser would take another port
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            reason = error.strerror or str(error)
            raise PageError(
                f"cannot serve at {host}:{port}: {reason.lower()}; choose another --port"
            ) from None
        port = int(probe.getsockname()[1])
    # It prints its address in a box.
    with contextlib.redirect_stdout(io.StringIO()), _own_pages_only(host, port):
        server = Server(host=host, port=port, label=title, verbose=False)
    server.gui.configure_theme(
        show_logo=False, show_share_button=False, control_width="large", brand_color=(9, 105, 218)
    )
    server.gui.main_panel.dock_right()
    server.gui.main_panel.set_width(430)
    return server


@contextlib.contextmanager
def _own_pages_only(host: str, port: int) -> Iterator[None]:
    """Let a server that starts meanwhile refuse browsers that show a page of another site.

    Any site's page may open a socket to this machine, and could command the vehicle. viser has no
    option for that; websockets has.
    """
    local = r"http://(127\.0\.0\.1|localhost|\[::1\])(:\d+)?"
    other = rf"http://[^/]+:{port}" if host not in LOCAL else local
    usual = websockets.asyncio.server.serve
    origins = [None, re.compile(local), re.compile(other)]
    try:
        websockets.asyncio.server.serve = partial(usual, origins=origins)
        yield
    finally:
        websockets.asyncio.server.serve = usual


def address(server: Server) -> str:
    """What to open in a browser."""
    host = server.get_host()
    shown = "127.0.0.1" if host in (*LOCAL, "0.0.0.0") else host
    return f"http://{shown}:{server.get_port()}"
