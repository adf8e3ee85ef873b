"""A flight past its worst moment, as the page of ``pandion view`` shows it, moving."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Final

from PIL import Image

from docs.figures.view import shown_in_browser, time_is

_PAGE: Final = (1180, 620)
_CUT: Final = (96, 40, 744, 472)  # of the page [px]: the scene without what lies beside it
_STEP_S: Final = 0.3  # of the flight, between two pictures
_PICTURES: Final = 70
_LASTS_MS: Final = 90
_HIDE = (
    "document.querySelectorAll('.mantine-Paper-root, .mantine-Notification-root')"
    ".forEach(one => one.style.visibility = 'hidden')"
)


def draw_animation(directory: Path, target: Path) -> None:
    """Draw the flight of a directory from before its smallest margin to after it, as WebP.

    Raises:
        NoBrowser: There is no Chromium.
    """
    pictures = []
    with (
        shown_in_browser(directory, *_PAGE) as (browser, flight, shown),
        tempfile.TemporaryDirectory() as made,
    ):
        assert flight.worst is not None
        begin = flight.worst.t - 0.6 * _STEP_S * _PICTURES
        for number in range(_PICTURES):
            t = begin + number * _STEP_S
            shown.go_to(t)
            browser.wait_for(time_is(t - flight.begin), 60.0)
            browser.value(_HIDE)
            time.sleep(0.25 if number else 3.0)  # until all is drawn
            file = Path(made) / "picture.png"
            browser.screenshot(file)
            with Image.open(file) as whole:
                pictures.append(whole.convert("RGB").crop(_CUT))
    save_moving(pictures, [_LASTS_MS] * len(pictures), target)


def save_moving(pictures: list[Image.Image], lasts_ms: list[int], target: Path) -> None:
    """Write pictures as a WebP that moves and begins anew; each lasts so long [ms]."""
    first, *others = pictures
    first.save(
        target,
        save_all=True,
        append_images=others,
        duration=lasts_ms,
        loop=0,
        quality=55,
        method=6,  # the slowest one, and the smallest file
    )
