"""A headless Chromium, driven over the DevTools protocol: for pictures and for tests.

Source: Chrome DevTools Protocol, https://chromedevtools.github.io/devtools-protocol/
"""

from __future__ import annotations

import base64
import contextlib
import io
import json
import shutil
import subprocess
import tempfile
import time
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final, cast

from PIL import Image

_NAMES: Final = ("chromium", "chromium-browser", "google-chrome")
_START_S: Final = 30.0
_ANSWER_S: Final = 120.0  # drawing in software, on a busy machine
_PIECE_PX: Final = 4000
A4_IN: Final = (8.27, 11.69)
LETTER_IN: Final = (8.5, 11.0)


class NoBrowser(Exception):
    """There is no browser, or it does not start; in one sentence."""


class Page:
    """One page in a browser of its own."""

    def __init__(self, socket: Any) -> None:
        self._socket = socket
        self._number = 0
        self.requests: list[str] = []  # every address that was asked for
        self.complaints: list[str] = []  # what the console said of errors
        for domain in ("Network", "Runtime", "Page", "Log"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """One command of the protocol, and its answer.

        Raises:
            NoBrowser: The browser refused.
        """
        self._number += 1
        request = {"id": self._number, "method": method, "params": parameters}
        self._socket.send(json.dumps(request, allow_nan=False))
        while True:
            message = json.loads(self._socket.recv(timeout=_ANSWER_S))
            if message.get("id") == self._number:
                if "error" in message:
                    raise NoBrowser(f"{method}: {message['error']['message']}")
                return cast("dict[str, Any]", message["result"])
            self._note(message)

    def open(self, address: str) -> None:
        """Go to an address."""
        self.call("Page.navigate", url=address)

    def value(self, expression: str) -> Any:
        """What an expression of JavaScript is."""
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True)
        return result["result"].get("value")

    def wait_for(self, expression: str, patience_s: float = 20.0) -> Any:
        """Ask until an expression is true; its value.

        Raises:
            NoBrowser: It never was.
        """
        until_s = time.monotonic() + patience_s
        while time.monotonic() < until_s:
            if found := self.value(expression):
                return found
            time.sleep(0.1)
        raise NoBrowser(f"never true: {expression}")

    def press(self, x: float, y: float) -> None:
        """Click at a place of the window [px]."""
        self._mouse("mouseMoved", x, y, buttons=0)
        self._mouse("mousePressed", x, y)
        self._mouse("mouseReleased", x, y)

    def drag(self, begin: tuple[float, float], end: tuple[float, float], steps: int = 8) -> None:
        """Press at one place [px], move to another, and let go."""
        self._mouse("mouseMoved", *begin, buttons=0)
        self._draw()  # what is drawn looks for the mouse when it is drawn
        self._mouse("mousePressed", *begin)
        for k in range(1, steps + 1):
            share = k / steps
            x, y = (a + share * (b - a) for a, b in zip(begin, end, strict=True))
            self._mouse("mouseMoved", x, y)
            self._draw()
        self._mouse("mouseReleased", *end)

    def press_on(self, text: str) -> None:
        """Click on what shows exactly this text.

        Raises:
            NoBrowser: Nothing does.
        """
        where = _PLACE % json.dumps(text)
        before, place = None, self.wait_for(where)
        while place != before:  # the page is still arranging itself
            time.sleep(0.3)
            before, place = place, self.wait_for(where)
        self.press(*place)

    def screenshot(self, path: Path) -> None:
        """Write what is seen as PNG."""
        shot = self.call("Page.captureScreenshot", format="png")
        path.write_bytes(base64.b64decode(shot["data"]))

    def screenshot_whole(self, path: Path) -> None:
        """Write the page as PNG down to its end, in pieces: a browser draws no more at once."""
        width, height = self.value("[innerWidth, document.documentElement.scrollHeight]")
        whole = Image.new("RGB", (width, height))
        for top in range(0, height, _PIECE_PX):
            clip = {"x": 0, "y": top, "width": width, "height": min(_PIECE_PX, height - top)}
            shot = self.call(
                "Page.captureScreenshot", format="png", captureBeyondViewport=True,
                clip={**clip, "scale": 1},
            )  # fmt: skip
            with Image.open(io.BytesIO(base64.b64decode(shot["data"]))) as piece:
                whole.paste(piece, (0, top))
        whole.save(path)

    def print_to(self, path: Path, paper_in: tuple[float, float]) -> None:
        """Print the page as PDF on sheets of a width and height [inch]."""
        width, height = paper_in
        printed = self.call(
            "Page.printToPDF", paperWidth=width, paperHeight=height, printBackground=True
        )
        path.write_bytes(base64.b64decode(printed["data"]))

    def _draw(self) -> None:
        """Wait until two more frames are drawn."""
        self.call("Runtime.evaluate", expression=_TWO_FRAMES, awaitPromise=True)

    def _mouse(self, kind: str, x: float, y: float, buttons: int = 1) -> None:
        button = "left" if buttons else "none"
        self.call(
            "Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, buttons=buttons,
            clickCount=1,
        )  # fmt: skip

    def _note(self, message: dict[str, Any]) -> None:
        method, said = message.get("method"), message.get("params", {})
        if method == "Network.requestWillBeSent":
            self.requests.append(said["request"]["url"])
        elif method == "Network.webSocketCreated":
            self.requests.append(said["url"])
        elif method == "Runtime.exceptionThrown":
            self.complaints.append(str(said["exceptionDetails"].get("text")))
        elif method == "Runtime.consoleAPICalled" and said["type"] == "error":
            self.complaints.append(str([one.get("value") for one in said["args"]]))
        elif method == "Log.entryAdded" and said["entry"]["level"] == "error":
            self.complaints.append(f"{said['entry']['text']} {said['entry'].get('url', '')}")


_TWO_FRAMES: Final = (
    "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(1))))"
)
_PLACE: Final = """(() => {
  const wanted = %s;
  const found = [...document.querySelectorAll('button, label, [role=tab], span, b')].filter(
    one => one.textContent.trim() === wanted && one.getClientRects().length);
  if (!found.length) return null;
  const box = found[found.length - 1].getBoundingClientRect();
  return [box.x + box.width / 2, box.y + box.height / 2];
})()"""


def chromium() -> str | None:
    """The browser's program; None: there is none."""
    found: Callable[[str], str | None] = shutil.which
    return next((path for name in _NAMES if (path := found(name))), None)


@contextlib.contextmanager
def page(
    width: int = 1440, height: int = 900, *, dark: bool = False, phone: bool = False
) -> Iterator[Page]:
    """A page of ``width`` and ``height`` [px], drawn in software so that it needs no graphics card.

    It asks for ``dark`` colours, and is laid out as on a ``phone``.

    Raises:
        NoBrowser: There is none, or it does not start.
    """
    from websockets.sync.client import connect

    program = chromium()
    if program is None:
        raise NoBrowser("no chromium on PATH; Debian: apt-get install chromium")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = subprocess.Popen(
            [
                program, "--headless=new", "--no-sandbox", "--disable-dev-shm-usage",
                "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars",
                "--no-first-run", "--disable-background-networking", "--disable-component-update",
                "--disable-extensions", "--disable-quic", "--disable-sync",
                "--remote-debugging-port=0", "--remote-allow-origins=*",
                f"--user-data-dir={profile}", f"--window-size={width},{height}", "about:blank",
            ],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            target = _target(Path(profile) / "DevToolsActivePort")
            with connect(target, max_size=None) as socket:
                opened = Page(socket)
                opened.call(
                    "Emulation.setDeviceMetricsOverride", width=width, height=height,
                    deviceScaleFactor=1, mobile=phone,
                )  # fmt: skip
                scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
                opened.call("Emulation.setEmulatedMedia", features=[scheme])
                yield opened
        finally:
            browser.terminate()
            browser.wait()


def _target(active: Path) -> str:
    until_s = time.monotonic() + _START_S
    while time.monotonic() < until_s:
        with contextlib.suppress(OSError, ValueError, StopIteration, IndexError):
            port = int(active.read_text().split()[0])
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/json", timeout=5.0) as answer:
                pages = json.load(answer)
            return next(str(one["webSocketDebuggerUrl"]) for one in pages if one["type"] == "page")
        time.sleep(0.1)
    raise NoBrowser(f"the browser does not start within {_START_S:.0f} s")
