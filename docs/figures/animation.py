"""A flight past its worst moment, as the page of ``pandion view`` shows it, moving."""

from __future__ import annotations

import io
import tempfile
import time
from pathlib import Path
from typing import Final

from PIL import Image

from docs.figures.browser import page
from view.log_flight import LogFlight
from view.log_page import LogPage
from view.page import address, open_server

_PAGE: Final = (1180, 620)
_CUT: Final = (96, 40, 744, 472)  # of the page [px]: the scene without what lies beside it
_STEP_S: Final = 0.3  # of the flight, between two pictures
_PICTURES: Final = 70
_LASTS_MS: Final = 90
_TIME = "document.querySelector('[data-pandion=time]')?.textContent"
_HIDE = (
    "document.querySelectorAll('.mantine-Paper-root, .mantine-Notification-root')"
    ".forEach(one => one.style.visibility = 'hidden')"
)


def draw_animation(directory: Path, target: Path) -> None:
    """Draw the flight of a directory from before its smallest margin to after it, as WebP.

    Raises:
        NoBrowser: There is no Chromium.
    """
    with page(*_PAGE) as browser, tempfile.TemporaryDirectory() as made:
        flight = LogFlight(directory)
        server = open_server("127.0.0.1", 0, flight.title)
        shown = LogPage(server, flight)
        browser.open(address(server))
        browser.wait_for(_TIME, 60.0)
        assert flight.worst is not None
        begin = flight.worst.t - 0.6 * _STEP_S * _PICTURES
        pictures = []
        for number in range(_PICTURES):
            t = begin + number * _STEP_S
            shown.go_to(t)
            browser.wait_for(f"{_TIME} === '{t - flight.begin:.2f} s'", 60.0)
            browser.value(_HIDE)
            time.sleep(0.25 if number else 3.0)  # until all is drawn
            file = Path(made) / "picture.png"
            browser.screenshot(file)
            with Image.open(io.BytesIO(file.read_bytes())) as whole:
                pictures.append(whole.convert("RGB").crop(_CUT))
        shown.close()
        server.stop()
    first, *others = pictures
    first.save(target, save_all=True, append_images=others, duration=_LASTS_MS, loop=0, quality=60)
