"""Boxes and arrows: the processes and what goes round in them."""

from __future__ import annotations

from pathlib import Path

from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch

from docs.figures.save import save

INK, FAINT, BLUE, GREEN, ORANGE, PALE = (
    "#24292f", "#6e7781", "#0969da", "#1a7f37", "#bc4c00", "#f6f8fa",
)  # fmt: skip

XY = tuple[float, float]


def canvas(width: float, height: float) -> Axes:
    """An empty drawing, in inches, y up."""
    axes = plt.figure(figsize=(width, height)).add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(0.0, width)
    axes.set_ylim(0.0, height)
    axes.axis("off")
    return axes


def box(
    axes: Axes, corner: XY, size: XY, lines: str, colour: str = INK, fill: str = "white"
) -> None:
    """A box with centred text; corner is the lower left one."""
    axes.add_patch(
        FancyBboxPatch(
            corner, *size, boxstyle="round,pad=0,rounding_size=0.06", ec=colour, fc=fill, lw=1.1
        )
    )
    middle = (corner[0] + size[0] / 2.0, corner[1] + size[1] / 2.0)
    axes.text(*middle, lines, ha="center", va="center", color=INK, linespacing=1.35)


def process(axes: Axes, corner: XY, size: XY, name: str) -> None:
    """A box for a process, with its name above."""
    box(axes, corner, size, "", fill=PALE)
    top = (corner[0] + size[0] / 2.0, corner[1] + size[1] + 0.1)
    axes.text(*top, name, ha="center", va="bottom", color=INK, weight="bold")


def arrow(
    axes: Axes, start: XY, end: XY, words: str = "", colour: str = INK, lift: float = 0.07
) -> None:
    """An arrow with words above its middle."""
    axes.annotate(
        "", xy=end, xytext=start, arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.2,
                                               "shrinkA": 0.0, "shrinkB": 0.0},
    )  # fmt: skip
    if words:
        middle = ((start[0] + end[0]) / 2.0, (start[1] + end[1]) / 2.0 + lift)
        axes.text(*middle, words, ha="center", va="bottom", color=colour, fontsize=8.0)


def stack(axes: Axes, corner: XY, width: float, steps: tuple[str, ...], colour: str) -> None:
    """Steps from top to bottom, joined by arrows; corner is the upper left one."""
    x, y = corner
    for k, step in enumerate(steps):
        low = y - 0.5 * (k + 1) - 0.2 * k
        box(axes, (x, low), (width, 0.5), step, colour)
        if k:
            arrow(axes, (x + width / 2.0, low + 0.7), (x + width / 2.0, low + 0.5), colour=colour)


def draw_architecture(target: Path) -> None:
    """Simulator, flight software, ground station, and the command line."""
    axes = canvas(10.6, 6.1)
    process(axes, (0.2, 1.5), (2.5, 4.2), "process sitl (simulator)")
    box(axes, (0.4, 4.95), (2.1, 0.55), "pilot\nof the scenario", ORANGE)
    box(axes, (0.4, 4.1), (2.1, 0.55), "sensors\nnoise, latency")
    box(axes, (0.4, 3.25), (2.1, 0.55), "plant\nRK4 at 1 kHz")
    box(axes, (0.4, 2.4), (2.1, 0.55), "disturbances")
    box(axes, (0.4, 1.65), (2.1, 0.5), "evaluation of true margins")
    arrow(axes, (1.45, 3.8), (1.45, 4.1))
    arrow(axes, (1.45, 2.95), (1.45, 3.25))
    process(axes, (5.1, 1.5), (5.3, 4.2), "process fsw (flight software)")
    axes.text(6.4, 5.48, "tick, 500 Hz", ha="center", color=BLUE)
    axes.text(9.1, 5.48, "planning cycle, 10 Hz", ha="center", color=GREEN)
    tick = ("estimate", "commands, failsafes, modes", "take the plan, control laws",
            "safety gate: send", "fuse, watch, ask for a plan")  # fmt: skip
    stack(axes, (5.25, 5.35), 2.3, tick, BLUE)
    cycle = ("predict the start", "linearise the horizon", "costs, barriers, limits",
             "solve (twice)", "Plan or PlanFailure")  # fmt: skip
    stack(axes, (8.1, 5.35), 2.1, cycle, GREEN)
    arrow(axes, (7.55, 2.4), (8.1, 5.1), colour=GREEN)
    arrow(axes, (8.1, 2.3), (7.55, 3.6), colour=GREEN)
    arrow(axes, (2.7, 5.22), (5.1, 5.22), "targets, safe set, arm, mode", ORANGE)
    arrow(axes, (2.7, 4.38), (5.1, 4.38), "ODOMETRY, ARM_JOINT_STATE,\nHIL_SENSOR (last)")
    arrow(axes, (5.1, 3.5), (2.7, 3.5), "HIL_ACTUATOR_CONTROLS")
    axes.text(3.9, 2.75, "UDP, one datagram each way\nper step of 2 ms", ha="center", color=FAINT,
              fontsize=8.0)  # fmt: skip
    box(axes, (5.1, 0.2), (5.3, 0.6), "ground station (UDP 14550), programs (UDP 14540)", fill=PALE)
    arrow(axes, (6.4, 1.5), (6.4, 0.8))
    axes.text(6.5, 1.1, "telemetry", fontsize=8.0)
    arrow(axes, (9.1, 0.8), (9.1, 1.5))
    axes.text(9.0, 1.1, "commands, setpoints", fontsize=8.0, ha="right")
    box(axes, (0.2, 0.2), (2.5, 0.6), "pandion fly\nstarts both, reports the result", fill=PALE)
    arrow(axes, (1.45, 0.8), (1.45, 1.5), colour=FAINT)
    axes.plot([2.7, 4.2, 4.2], [0.5, 0.5, 1.8], color=FAINT, lw=1.2)
    arrow(axes, (4.2, 1.8), (5.1, 1.8), colour=FAINT)
    save(axes.figure, target)


def draw_timing(target: Path) -> None:
    """Processes and threads, and what each may wait for."""
    axes = canvas(10.6, 5.4)
    process(axes, (0.2, 3.1), (2.2, 1.7), "process sitl")
    box(axes, (0.3, 3.25), (2.0, 1.4),
        "main thread, FIFO 50\nstep k on an absolute grid\nwaits for: its grid")  # fmt: skip
    process(axes, (4.0, 0.3), (3.0, 4.5), "process fsw")
    box(
        axes, (4.12, 1.75), (2.76, 2.9),
        "main thread, FIFO 50: the tick\n1 read frames, ground, plan\n2 tick: up to the command\n"
        "3 send actuators\n4 conclude: the rest of the tick\n5 ask the planner\n"
        "6 telemetry, records to the log\n7 once a second: summarise\n"
        "waits for: its grid; reads the\nground links meanwhile",
        BLUE,
    )  # fmt: skip
    box(axes, (4.12, 0.42), (2.76, 0.95),
        "log threads, FIFO 49\nwrite blocks in order\nwait for: the disk", ORANGE)  # fmt: skip
    arrow(axes, (5.5, 1.75), (5.5, 1.37), colour=ORANGE)
    process(axes, (8.2, 3.1), (2.2, 1.7), "planner process")
    box(axes, (8.3, 3.25), (2.0, 1.4),
        "main thread, FIFO 40\nnewest request → answer\nwaits for: a request\nthe solve is bounded",
        GREEN)  # fmt: skip
    process(axes, (8.2, 0.3), (2.2, 1.6), "fork server")
    box(axes, (8.3, 0.42), (2.0, 1.35),
        "main thread, FIFO 40\nforks the planner process,\nagain if it dies\nwaits for: its end",
        GREEN)  # fmt: skip
    arrow(axes, (2.4, 4.3), (4.0, 4.3), "sensor frame")
    arrow(axes, (4.0, 3.6), (2.4, 3.6), "actuators")
    arrow(axes, (7.0, 4.3), (8.2, 4.3), "request", GREEN)
    arrow(axes, (8.2, 3.6), (7.0, 3.6), "plan", GREEN)
    arrow(axes, (8.5, 1.9), (8.5, 3.1), colour=FAINT)
    axes.text(8.6, 2.5, "forks", color=FAINT, fontsize=8.0)
    arrow(axes, (7.0, 1.1), (8.2, 1.1), "forks, warm", FAINT)
    box(axes, (0.2, 1.0), (2.2, 0.9), "ground stations,\nprograms", fill=PALE)
    arrow(axes, (2.4, 1.7), (4.0, 1.7), "commands")
    arrow(axes, (4.0, 1.2), (2.4, 1.2), "telemetry")
    axes.text(1.3, 2.5, "no sender waits for a receiver", color=FAINT, ha="center", fontsize=8.0)
    save(axes.figure, target)
