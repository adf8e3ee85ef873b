"""Whole pages as a reader sees them, to be looked at: on screens, on a phone, dark, on paper.

They are not kept: ``make pictures`` writes them to ``build/pictures``.
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path
from typing import Any, Final

from docs.figures.browser import A4_IN, LETTER_IN, page
from docs.figures.view import CLOSE, shown_in_browser, time_is
from pandion.report import write_report

DESKTOP_PX: Final = (1200, 900)
PHONE_PX: Final = (390, 844)
_LOOKS: Final[dict[str, tuple[tuple[int, int], dict[str, Any]]]] = {
    "desktop": (DESKTOP_PX, {}),
    "dark": (DESKTOP_PX, {"dark": True}),
    "phone": (PHONE_PX, {"phone": True}),
    "phone-dark": (PHONE_PX, {"phone": True, "dark": True}),
}
_PAPERS: Final = {"a4": A4_IN, "letter": LETTER_IN}
_DRAWN: Final = (
    "document.readyState === 'complete'"
    " && (!document.getElementById('plotly') || document.body.dataset.drawn)"
)
# Winds up to one that the vehicle cannot hold, so that the page has violations to show.
_CAMPAIGN: Final = """flights = 24
duration_s = 6.0
scenarios = ["walls"]
suites = ["mocap"]

[vary]
vehicle_scale.mass = { uniform = [0.95, 1.05] }
wind_m_s2 = { uniform = [0.0, 2.5] }
"""


def fly_campaign(directory: Path) -> Path:
    """Fly a campaign of 24 short flights, unless it has been; return its page."""
    out = directory / "campaign"
    if not (out / "campaign.html").exists():
        plan = directory / "gusts.toml"
        plan.write_text(_CAMPAIGN, encoding="utf-8")
        program = Path(sys.executable).parent / "pandion"
        line = [program, "campaign", plan, "--out", out]
        subprocess.run(line, check=True, stdout=subprocess.DEVNULL)
    return out / "campaign.html"


def draw_pages(flights: list[Path], campaign: Path, folder: Path) -> None:
    """Draw the report of the first flight, of all, the page of the first and that of a campaign.

    Raises:
        NoBrowser: There is no browser.
    """
    folder.mkdir(parents=True, exist_ok=True)
    draw_file(write_report(flights[:1], folder / "report.html"), folder)
    draw_file(write_report(flights, folder / "compared.html"), folder)
    draw_file(campaign, folder)
    for look, (size, how) in _LOOKS.items():
        with shown_in_browser(flights[0], *size, **how) as (browser, flight, shown):
            browser.value(CLOSE)
            assert flight.worst is not None
            shown.go_to(flight.worst.t)
            browser.wait_for(time_is(flight.worst.t - flight.begin), 60.0)
            time.sleep(5.0)  # until all is drawn
            browser.screenshot(folder / f"view-{look}.png")


def draw_file(file: Path, folder: Path) -> None:
    """Draw a page that is a file with every look and on every paper."""
    for look, (size, how) in _LOOKS.items():
        with page(*size, **how) as opened:
            opened.open(file.absolute().as_uri())
            opened.wait_for(_DRAWN, 120.0)
            opened.screenshot_whole(folder / f"{file.stem}-{look}.png")
            if look == "desktop":
                for name, paper in _PAPERS.items():
                    opened.print_to(folder / f"{file.stem}-{name}.pdf", paper)
