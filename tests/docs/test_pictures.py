"""The pictures and tables of flights show what flies; ``make pictures`` renews them."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from docs.figures.__main__ import FLOWN, PICTURED
from docs.figures.dash import NAMES, Dash, shown
from docs.figures.dash_animation import draw_dash_animation
from docs.figures.diagrams import draw_architecture, draw_timing
from docs.figures.flight import draw_flight, recorded
from docs.figures.frames import draw_frames
from tests.docs.fences import DOCS, ROOT

IMAGES = DOCS / "images"
NUMBERS: dict[tuple[str, str], dict[str, Any]] = {
    (flown["scenario"], flown["sensors"]): flown
    for flown in json.loads((IMAGES / "flights.json").read_text("utf-8"))
}


@pytest.fixture(scope="module", autouse=True)
def _text_stays_text() -> None:
    import matplotlib as mpl

    mpl.rcParams["svg.fonttype"] = "none"


def words(picture: Path) -> list[str]:
    """Every text of a drawing, in its order."""
    found = ET.parse(picture).getroot().iter("{http://www.w3.org/2000/svg}text")
    return ["".join(text.itertext()) for text in found]


@pytest.mark.parametrize(("flown", "picture"), PICTURED.items())
def test_a_picture_prints_the_recorded_numbers_of_its_flight(
    flown: tuple[str, str], picture: str
) -> None:
    numbers = NUMBERS[flown]
    title = next(text for text in words(IMAGES / picture) if "--seed" in text)
    assert "pandion fly {} --sensors {} ".format(*flown) in title
    assert f"{numbers['tracking_error_rms_mm']:.1f} mm RMS" in title
    assert f"minimum margin {numbers['min_margin_mm']:.1f} mm" in title


def test_the_picture_of_a_flight_that_touches_is_of_one_within_its_bound() -> None:
    title = next(text for text in words(IMAGES / "probe.svg") if "--seed" in text)
    found = re.fullmatch(
        r"pandion fly probe --sensors mocap --seed 0: at most ([\d.]+) N of 10 N", title
    )
    assert found
    assert 5.0 < float(found[1]) < 10.0


def test_the_table_of_the_readme_has_the_recorded_numbers() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    name, length = r"`([\w-]+)`", r"([\d.]+) mm"
    row = rf"^\| {name} \| {name} \| {length} \| {length} \| (\w+) \|$"
    assert {found[:2]: found[2:] for found in re.findall(row, text, re.M)} == {
        flown: (
            f"{numbers['tracking_error_rms_mm']:.1f}",
            f"{numbers['min_margin_mm']:.1f}",
            "yes" if numbers["completed"] else "no",
        )
        for flown, numbers in NUMBERS.items()
    }
    assert set(NUMBERS) == set(FLOWN)


def test_the_first_picture_is_of_the_flight_of_make_run() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    scenario, suite = next(iter(PICTURED))
    assert f"$(BIN)/pandion fly {scenario} --sensors {suite}\n" in makefile


def test_the_picture_of_four_controllers_says_who_hits_the_wall_and_who_brakes() -> None:
    said = words(IMAGES / "dash.svg")
    verdicts = {
        name: next(text for text in said if text.startswith(f"{name}:")) for name in NAMES.values()
    }
    assert "hits the wall" in verdicts[NAMES["naive"]]
    assert "hits the wall" in verdicts[NAMES["hc"]]
    assert any(text.startswith("infeasible from") for text in said)
    assert "of 100" not in verdicts[NAMES["blf"]]
    assert any(text.startswith("brakes from") for text in said)


@pytest.mark.parametrize("name", ["dash.webp", "flight.webp"])
def test_what_moves_is_small_enough_for_a_page_and_is_on_one(name: str) -> None:
    assert (IMAGES / name).stat().st_size < 400_000
    with Image.open(IMAGES / name) as moving:
        assert getattr(moving, "n_frames", 1) > 30
    assert f"docs/images/{name}" in (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.mark.long
def test_the_four_move_past_the_contact(tmp_path: Path) -> None:
    t = np.arange(0.0, 6.0, 0.4)
    paths = {key: np.maximum(1.0 - 0.2 * t, 0.0) for key in ("base", "end-effector", "reference")}
    whole = Dash(t, paths, paths, 0.2 - 0.0 * t, [], "flew")
    cut = {key: path[:14] for key, path in paths.items()}
    hit = Dash(t[:14], cut, cut, whole.speed[:14], [4.8], "hit the wall")
    flights = {"naive": hit, "hc": hit, "sc": whole, "blf": whole}
    draw_dash_animation(shown(), flights, tmp_path / "moving.webp")
    with Image.open(tmp_path / "moving.webp") as moving:
        assert getattr(moving, "n_frames", 1) == 7  # from 2 s before 5.2 s to 0.6 s after


@pytest.mark.parametrize(
    ("draw", "name"),
    [
        (draw_architecture, "architecture"),
        (draw_timing, "timing"),
        (draw_frames, "frames"),
    ],
)
def test_a_diagram_says_what_its_script_draws(draw: Any, name: str, tmp_path: Path) -> None:
    draw(tmp_path / "drawn.svg")
    stale = f"docs/images/{name}.svg is older than its script: run make pictures"
    assert words(tmp_path / "drawn.svg") == words(IMAGES / f"{name}.svg"), stale


@pytest.mark.long
@pytest.mark.parametrize("flown", PICTURED, ids="-".join)
def test_today_s_flight_has_the_recorded_numbers(flown: tuple[str, str], tmp_path: Path) -> None:
    program, out = Path(sys.executable).parent / "pandion", tmp_path / "flown"
    line = [
        "fly",
        flown[0],
        "--sensors",
        flown[1],
        "--gcs",
        "udp:127.0.0.1:9",
        "--api",
        "none",
        "--out",
        out,
    ]
    subprocess.run([program, *line], check=True, capture_output=True, timeout=300.0)
    assert recorded(out) == NUMBERS[flown], "run make pictures"
    draw_flight(out, tmp_path / "drawn.svg")
    assert any("minimum margin" in text for text in words(tmp_path / "drawn.svg"))
