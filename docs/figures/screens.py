"""What programs show: the report in a browser, the inspector on a terminal."""

from __future__ import annotations

import asyncio
import tempfile
from collections import deque
from pathlib import Path
from typing import Final

from PIL import Image

from docs.figures.browser import page
from fsw.autopilot.model.airframe import AIRFRAME
from messages.frames import Frame
from messages.tlog_reader import tlog_frames
from pandion.report import write_report
from view.top.app import TopApp

REPORT_PX: Final = (1200, 1640)
INSPECTOR_PX: Final = (1300, 826)
_CELLS: Final = (132, 40)  # columns and rows of the terminal
_SHOWN_S: Final = 60.0  # of the flight
_COLOURS: Final = 128


def draw_report(directory: Path, target: Path) -> None:
    """The top of the report of a flight's directory, as PNG.

    Raises:
        NoBrowser: There is no browser.
    """
    with tempfile.TemporaryDirectory() as made, page(*REPORT_PX) as opened:
        written = write_report([directory], Path(made) / "report.html")
        opened.open(written.as_uri())
        opened.wait_for("document.body && document.body.dataset.drawn", 60.0)
        opened.screenshot(target)
    _shrink(target)


def draw_inspector(directory: Path, target: Path) -> None:
    """The inspector, fed with the telemetry log of a flight's directory, as PNG.

    Raises:
        NoBrowser: There is no browser.
    """
    drawn = asyncio.run(_inspected(directory / "flight.tlog"))
    with tempfile.TemporaryDirectory() as made, page(*INSPECTOR_PX) as opened:
        file = Path(made) / "inspector.html"
        # The drawing asks a host for its font; none is asked here.
        policy = "default-src 'none'; style-src 'unsafe-inline'"
        head = (
            f'<meta charset="utf-8"><meta http-equiv="Content-Security-Policy" content="{policy}">'
        )
        body = '<body style="margin:0"><style>svg{width:100vw;height:auto}</style>'
        file.write_text(f"<!DOCTYPE html>{head}{body}{drawn}", encoding="utf-8")
        opened.open(file.as_uri())
        opened.wait_for("!!document.querySelector('svg')")
        opened.screenshot(target)
    _shrink(target)


async def _inspected(tlog: Path) -> str:
    """The inspector as SVG, a minute into a flight."""
    flight = _Recorded(tlog)
    app = TopApp(flight, AIRFRAME, lambda: flight.now)
    async with app.run_test(size=_CELLS) as pilot:
        while flight.now < _SHOWN_S:
            flight.now += 0.02
            app.take()
        app.refresh_all()
        for _ in range(4):
            await pilot.press("down")
        await pilot.pause()
        return app.export_screenshot()


class _Recorded:
    """Hears what a telemetry log says until now."""

    def __init__(self, tlog: Path) -> None:
        self.now = 0.0
        self._coming = deque(tlog_frames(tlog.read_bytes()))
        self._begin = self._coming[0][0]

    def poll(self, now: float) -> list[Frame]:
        """What the vehicle sent until ``now`` [s since the start]."""
        found: list[Frame] = []
        while self._coming and self._coming[0][0] - self._begin <= now:
            _, frame = self._coming.popleft()
            if frame.system_id == 1:
                found.append(frame)
        return found

    def close(self) -> None:
        """Nothing is open."""


def _shrink(picture: Path) -> None:
    """Few colours: a third of the bytes."""
    with Image.open(picture) as image:
        image.convert("RGB").quantize(_COLOURS).save(picture, optimize=True)
