"""Draw docs/images/timing.svg: ``python docs/figures/timing.py [FILE]``."""

from __future__ import annotations

import sys
from pathlib import Path

from drawing import BLUE, FAINT, GREEN, INK, ORANGE, XY, Drawing

PALE = "#f6f8fa"


def main(path: Path) -> None:
    """Draw processes and threads, and what each may wait for."""
    d = Drawing(1080, 560)
    process(d, (20.0, 50.0), (220.0, 190.0), "process sitl")
    thread(
        d, (36.0, 76.0), 190.0, INK, "main thread, FIFO 50",
        ("step k on an absolute grid", "waits: its own grid,", "never for the vehicle"),
    )  # fmt: skip
    process(d, (390.0, 50.0), (300.0, 470.0), "process fsw")
    thread(
        d, (406.0, 76.0), 268.0, BLUE, "main thread, FIFO 50: the tick",
        (
            "1  hear: frames, ground, plan",
            "2  tick: the pure function",
            "3  actuate",
            "4  ask the planner",
            "5  publish telemetry",
            "6  hand records to the log",
            "7  once a second: sum up, warn",
            "waits: its own grid (or the ground,",
            "until 0.2 ms before it), nothing else",
        ),
    )  # fmt: skip
    thread(
        d, (406.0, 382.0), 268.0, ORANGE, "log threads, FIFO 49",
        ("write blocks in order", "wait: the disk; what has no", "room meanwhile is dropped"),
    )  # fmt: skip
    process(d, (820.0, 50.0), (240.0, 190.0), "process worker")
    thread(
        d, (836.0, 76.0), 208.0, GREEN, "main thread, FIFO 40",
        ("newest request, answer", "waits: the next request;", "a solve is bounded"),
    )  # fmt: skip
    process(d, (820.0, 330.0), (240.0, 190.0), "process nursery")
    thread(
        d, (836.0, 356.0), 208.0, GREEN, "main thread, FIFO 40",
        ("forks the worker, and again", "when it has died", "waits: the worker's end"),
    )  # fmt: skip
    between(d)
    d.save(path)


def process(d: Drawing, corner: XY, size: XY, name: str) -> None:
    """A process."""
    d.box(corner, size, fill=PALE)
    d.text((corner[0], corner[1] - 12.0), name, bold=True)


def thread(
    d: Drawing, corner: XY, width: float, colour: str, name: str, lines: tuple[str, ...]
) -> None:
    """A thread, what it does and what it waits for."""
    d.box(corner, (width, 44.0 + 25.0 * len(lines)), colour, fill="#ffffff")
    x, y = corner[0] + 12.0, corner[1] + 24.0
    d.text((x, y), name, colour, 13, bold=True)
    for k, line in enumerate(lines):
        d.text((x, y + 25.0 * (k + 1)), line, INK, 13)


def between(d: Drawing) -> None:
    """What passes between them; no arrow is waited for by its sender."""
    d.arrow((240.0, 110.0), (390.0, 110.0))
    d.text((315.0, 100.0), "sensor frame", INK, 13, "middle")
    d.arrow((390.0, 170.0), (240.0, 170.0))
    d.text((315.0, 160.0), "actuators", INK, 13, "middle")
    d.text((315.0, 192.0), "UDP", FAINT, 12, "middle")
    d.arrow((690.0, 110.0), (820.0, 110.0), GREEN)
    d.text((755.0, 100.0), "request", GREEN, 13, "middle")
    d.arrow((820.0, 170.0), (690.0, 170.0), GREEN)
    d.text((755.0, 160.0), "answer", GREEN, 13, "middle")
    d.text((755.0, 192.0), "local sockets", FAINT, 12, "middle")
    d.arrow((940.0, 330.0), (940.0, 240.0), FAINT)
    d.text((950.0, 290.0), "forks", FAINT, 13)
    d.arrow((690.0, 440.0), (820.0, 440.0), FAINT)
    d.text((755.0, 430.0), "forks, warm", FAINT, 13, "middle")
    d.box((20.0, 330.0), (210.0, 60.0), fill=PALE)
    d.text((125.0, 365.0), "ground stations, programs", INK, 13, "middle")
    d.arrow((230.0, 350.0), (390.0, 350.0))
    d.text((310.0, 340.0), "commands", INK, 13, "middle")
    d.arrow((390.0, 372.0), (230.0, 372.0))
    d.text((310.0, 392.0), "telemetry, UDP", INK, 13, "middle")
    d.arrow((540.0, 345.0), (540.0, 382.0), ORANGE)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("docs/images/timing.svg"))
