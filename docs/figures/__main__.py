"""Draw ``docs/images`` again, and whole pages into ``build/pictures`` for somebody to look at.

``make pictures``, or ``python -m docs.figures [FLIGHTS]``.

Flies the pictured flights first, unless FLIGHTS is a directory that has them already.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib as mpl

from docs.figures.animation import draw_animation
from docs.figures.browser import NoBrowser
from docs.figures.contact import draw_contact
from docs.figures.dash import draw_dash, fly_four, shown
from docs.figures.dash_animation import draw_dash_animation
from docs.figures.diagrams import draw_architecture, draw_timing
from docs.figures.flight import draw_flight, recorded
from docs.figures.frames import draw_frames
from docs.figures.pages import draw_pages, fly_campaign
from docs.figures.screens import draw_inspector, draw_report
from docs.figures.view import draw_view

ROOT = Path(__file__).parents[2]
IMAGES = ROOT / "docs" / "images"
PAGES = ROOT / "build" / "pictures"
# Scenario and suite of sensors; the first is the flight of `make run`.
PICTURED = {("walls", "mocap"): "flight.svg", ("branches", "perfect"): "branches.svg"}
SHOWN = ("branches", "perfect")  # on the page of pandion view
# The flights of the table in README.md; of each, seed 0 and the whole duration.
FLOWN = (
    ("walls", "mocap"),
    ("workspace", "mocap"),
    *((name, "perfect") for name in ("walls", "walls-calm", "workspace", "workspace-calm")),
    ("branches", "perfect"),
)
STYLE = {
    "font.family": ["DejaVu Sans", "sans-serif"],
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.fonttype": "none",  # text stays text: it can be searched, and tests can read it
    "svg.hashsalt": "pandion",  # the same drawing gives the same file
}


def fly(scenario: str, suite: str, directory: Path) -> Path:
    """Fly a scenario with a suite, unless it has been; return the flight's directory."""
    out = directory / f"{scenario}-{suite}"
    if not (out / "result.json").exists():
        program = Path(sys.executable).parent / "pandion"
        print(f"flying {scenario}, {suite}", flush=True)
        line = [program, "fly", scenario, "--sensors", suite, "--out", out]
        subprocess.run(line, check=True, stdout=subprocess.DEVNULL)
    return out


def draw_all(flights: Path) -> None:
    """Fly what is missing, draw everything, record the numbers."""
    with mpl.rc_context(STYLE):
        draw_architecture(IMAGES / "architecture.svg")
        draw_timing(IMAGES / "timing.svg")
        draw_frames(IMAGES / "frames.svg")
        dash = shown()
        four = fly_four(dash)
        draw_dash(dash, four, IMAGES / "dash.svg")
        draw_dash_animation(dash, four, IMAGES / "dash.webp")
        for flown, name in PICTURED.items():
            draw_flight(fly(*flown, flights), IMAGES / name)
        draw_contact(fly("probe", "mocap", flights), IMAGES / "probe.svg")
    pictured, watched = (fly(*flown, flights) for flown in (next(iter(PICTURED)), SHOWN))
    try:
        draw_view(watched, IMAGES / "view.png")
        draw_animation(pictured, IMAGES / "flight.webp")
        draw_report(pictured, IMAGES / "report.png")
        draw_inspector(pictured, IMAGES / "top.png")
        draw_pages([pictured, watched], fly_campaign(flights), PAGES)
    except NoBrowser as missing:
        print(f"the pictures of pages stay as they are: {missing}")
    numbers = [recorded(fly(*flown, flights)) for flown in FLOWN]
    text = json.dumps(numbers, indent=2)
    (IMAGES / "flights.json").write_text(f"{text}\n", encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        draw_all(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as made:
            draw_all(Path(made))
    print(f"drew {IMAGES}, and to be looked at {PAGES}")
