"""The page of a flight at its worst moment, as a browser shows it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from PIL import Image

from docs.figures.browser import Page, page
from view.log_flight import LogFlight
from view.log_page import LogPage
from view.page import address, open_server

SIZE = (1440, 900)
_TIME = "document.querySelector('[data-pandion=time]')?.textContent"
# viser warns that it draws without a graphics card.
CLOSE = "document.querySelectorAll('.mantine-Notification-closeButton').forEach(b => b.click())"


@contextmanager
def shown_in_browser(
    directory: Path, width_px: int, height_px: int, *, dark: bool = False, phone: bool = False
) -> Iterator[tuple[Page, LogFlight, LogPage]]:
    """A flight's page in a browser's window.

    Raises:
        NoBrowser: There is no Chromium.
    """
    with page(width_px, height_px, dark=dark, phone=phone) as browser:
        flight = LogFlight(directory)
        server = open_server("127.0.0.1", 0, flight.title)
        shown = LogPage(server, flight)
        browser.open(address(server))
        browser.wait_for(_TIME, 60.0)
        yield browser, flight, shown
        shown.close()
        server.stop()


def time_is(seconds: float) -> str:
    """What is true in the page once it shows a time of the flight [s]."""
    return f"{_TIME} === '{seconds:.2f} s'"


def draw_view(directory: Path, target: Path) -> None:
    """Take a picture of a flight's page.

    Raises:
        NoBrowser: There is no Chromium.
    """
    with shown_in_browser(directory, *SIZE) as (browser, flight, _):
        browser.value(CLOSE)
        browser.press_on("worst margin")
        assert flight.worst is not None
        browser.wait_for(time_is(flight.worst.t - flight.begin), 60.0)
        time.sleep(3.0)  # until all is drawn
        browser.screenshot(target)
    # A quarter of the size, and looks the same.
    with Image.open(target) as whole:
        palette = whole.convert("RGB").quantize(256, Image.Quantize.MAXCOVERAGE, kmeans=2)
    palette.save(target, optimize=True)
