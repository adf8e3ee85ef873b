"""What programs show: the report in a browser, the inspector on a terminal."""

from __future__ import annotations

import asyncio
import tempfile
from pathlib import Path
from typing import Final

from PIL import Image

from docs.figures.browser import page
from messages.frames import split
from pandion.report import write_report
from view.top.app import TopApp
from view.top.peer import Message, messages

REPORT_PX: Final = (1200, 1640)
INSPECTOR_PX: Final = (1300, 800)
_CELLS: Final = (132, 40)  # columns and rows of the terminal
_SHOWN_S: Final = 60.0  # of the flight
_COLOURS: Final = 128
_STAMP: Final = 8  # bytes before each frame of a telemetry log


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
    app = TopApp(flight, lambda: flight.now)
    async with app.run_test(size=_CELLS) as pilot:
        while flight.now < _SHOWN_S:
            flight.now += 0.5
            app.refresh_all()
        for _ in range(4):
            await pilot.press("down")
        await pilot.pause()
        return app.export_screenshot()


class _Recorded:
    """Hears what a telemetry log says until now."""

    def __init__(self, tlog: Path) -> None:
        self.now = 0.0
        self._frames = iter(_recorded(tlog))
        self._waiting: list[Message] = []

    def poll(self, now: float) -> list[Message]:
        """What was sent until ``now`` [s since the start]."""
        for message in self._frames:
            self._waiting.append(message)
            if message.t > now:
                break
        ready = [message for message in self._waiting if message.t <= now]
        self._waiting = self._waiting[len(ready) :]
        return ready

    def close(self) -> None:
        """Nothing is open."""


def _recorded(tlog: Path) -> list[Message]:
    """Every message of the vehicle in a telemetry log, at its time since the start [s]."""
    data, at, begin = tlog.read_bytes(), 0, 0
    found: list[Message] = []
    while at + _STAMP < len(data):
        stamp = int.from_bytes(data[at : at + _STAMP], "big")
        begin = begin or stamp
        end = at + _STAMP + _length(data, at + _STAMP)
        frame = data[at + _STAMP : end]
        if any(one.system_id == 1 for one in split(frame)):
            found += messages(frame, 1e-6 * (stamp - begin))
        at = end
    return found


def _length(data: bytes, at: int) -> int:
    """Bytes of the frame that begins at ``at``."""
    signed = data[at] == 0xFD and data[at + 2] & 1
    return data[at + 1] + (12 + 13 * bool(signed) if data[at] == 0xFD else 8)


def _shrink(picture: Path) -> None:
    """Few colours: a third of the bytes."""
    with Image.open(picture) as image:
        image.convert("RGB").quantize(_COLOURS).save(picture, optimize=True)
