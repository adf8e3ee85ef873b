"""What all pages share: the server, its look, and who may do what with it."""

from __future__ import annotations

import asyncio
import contextlib
import gzip
import html
import http
import io
import ipaddress
import logging
import re
import socket
from collections.abc import Iterator, Sequence
from typing import Any, Final
from urllib.parse import urlsplit

import viser
import websockets.asyncio.server

from command_line.html_page import ICON
from command_line.printable import printable

LOCAL: Final = ("127.0.0.1", "localhost")
_UNHEARD: Final = logging.getLogger("peers of a page")
_UNHEARD.setLevel(logging.CRITICAL + 1)
_TITLE: Final = re.compile(rb"<title>[^<]*</title>")
_VISERS_ICON: Final = re.compile(rb'(<link\s+rel="icon"\s+)href="[^"]*"')
_ROOT: Final = re.compile(rb'(<div id="root">)</div>')
# viser is dark if the address says so; its sheet of a phone is 20 em wide, what we show is wider.
_HEAD: Final = """
<style>
:root { color-scheme: light dark; }
@media (max-width: 36em) {
  [style*="width: 20em"] { width: 100% !important; }
  .mantine-Paper-root[style*="width: 20em"] { max-height: 45% !important; }
}
</style>
<script>
if (matchMedia("(prefers-color-scheme: dark)").matches) {
  const asked = new URL(location);
  asked.searchParams.set("darkMode", "");
  history.replaceState(null, "", asked);
}
</script>"""
# The script that draws the scene replaces it.
_LOADING: Final = (
    '<p style="font: 16px system-ui, sans-serif; margin: 40vh auto 0; text-align: center">'
    "loading the scene ...</p>"
)


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
    title = printable(title)
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
    with contextlib.redirect_stdout(io.StringIO()), _own_pages_only(title):
        server = Server(host=host, port=port, label=title, verbose=False)
    server.gui.configure_theme(
        show_logo=False, show_share_button=False, control_width="large", brand_color=(9, 105, 218)
    )
    server.gui.main_panel.dock_right()
    server.gui.main_panel.set_width(430)
    return server


@contextlib.contextmanager
def _own_pages_only(title: str) -> Iterator[None]:
    """Let a server that starts meanwhile refuse browsers that show a page of another site.

    What it serves has our ``title`` and icon, and says that the scene is loading until it is there.

    Any site's page may open a socket to this machine, and could command the vehicle. viser has no
    option for that; websockets lets a request be looked at first. Whatever a peer sends, nothing of
    it is logged: a request that cannot be read is answered with 400, a socket closed.
    """
    module: Any = websockets.asyncio.server
    usual = module.serve

    def guarded(handler: Any, *args: Any, process_request: Any, **more: Any) -> Any:
        async def look(connection: Any, request: Any) -> Any:
            try:
                origins, hosts = request.headers.get_all("Origin"), request.headers.get_all("Host")
                if not is_own(origins, hosts):
                    return connection.respond(http.HTTPStatus.FORBIDDEN, "a page of another site\n")
                return titled(process_request(connection, request), title)
            except Exception:
                return connection.respond(http.HTTPStatus.BAD_REQUEST, "no such page\n")

        async def speak(connection: Any) -> None:
            asyncio.get_running_loop().set_exception_handler(lambda *_: None)
            if connection.subprotocol == f"viser-v{viser.__version__}":
                await handler(connection)
            else:  # viser would print it
                await connection.close(1002, f"Version mismatch. Server: {viser.__version__}")

        return usual(speak, *args, process_request=look, logger=_UNHEARD, **more)

    try:
        module.serve = guarded
        yield
    finally:
        module.serve = usual


def titled(response: Any, title: str) -> Any:
    """The same response, a page with ``title``, our icon and a word while the scene loads.

    It is dark where the browser asks for that, and fits a phone.
    """
    if response is None or "text/html" not in response.headers.get("Content-Type", ""):
        return response
    packed = response.headers.get("Content-Encoding") == "gzip"
    body = gzip.decompress(response.body) if packed else response.body
    named = f"<title>{html.escape(title)} - Pandion</title>{_HEAD}".encode()
    # What comes from outside must be no template: it may have group references.
    body = _TITLE.sub(lambda _: named, body, count=1)
    body = _VISERS_ICON.sub(rb'\g<1>href="%b"' % ICON.encode(), body, count=1)
    body = _ROOT.sub(rb"\g<1>%b</div>" % _LOADING.encode(), body, count=1)
    response.body = gzip.compress(body, 1) if packed else body
    del response.headers["Content-Length"]
    response.headers["Content-Length"] = str(len(response.body))
    return response


def is_own(origins: Sequence[str], hosts: Sequence[str]) -> bool:
    """Whether a request comes from the page that it asks for, or from no browser at all.

    The page's name must be a number or this machine's own: a name of another site may be made to
    lead here once its page is open.
    """
    if not origins:
        return True
    if len(origins) > 1 or len(hosts) != 1:
        return False
    origin = urlsplit(origins[0])
    name = origin.hostname or ""
    if origin.scheme != "http" or origin.netloc.removesuffix(":80") != hosts[0].removesuffix(":80"):
        return False
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return name in ("localhost", socket.gethostname().lower(), socket.getfqdn().lower())
    return True


def address(server: Server) -> str:
    """What to open in a browser."""
    host = server.get_host()
    shown = "127.0.0.1" if host in (*LOCAL, "0.0.0.0") else host
    return f"http://{shown}:{server.get_port()}"
