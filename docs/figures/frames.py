"""Body frame, arm angles, rotor numbers and spin."""

from __future__ import annotations

import math
from pathlib import Path

from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import Arc, Circle

from docs.figures.diagrams import BLUE, FAINT, GREEN, INK, ORANGE, arrow
from docs.figures.save import save

RED = "#cf222e"
LINK = 0.15  # m
ROTOR_ARM, ROTOR_RADIUS = 0.3, 0.1  # m; the rotors are drawn smaller than they are
TH1, TH2 = math.radians(-41.4), math.radians(82.8)  # where flights in the air begin


def draw_frames(target: Path) -> None:
    """Draw both views."""
    figure, (side, top) = plt.subplots(1, 2, figsize=(10.0, 5.2))
    figure.subplots_adjust(left=0.01, right=0.99, bottom=0.02, top=0.92, wspace=0.04)
    for axes in (side, top):
        axes.set_aspect("equal")
        axes.axis("off")
    draw_side(side)
    draw_top(top)
    save(figure, target)


def draw_side(axes: Axes) -> None:
    """Seen from the right: x forward to the right, z down (plotted as −z up)."""
    axes.set_title("from the right (y points at you)")
    axes.set_xlim(-0.46, 0.44)
    axes.set_ylim(-0.44, 0.26)
    axes.plot([-ROTOR_ARM, ROTOR_ARM], [0.0, 0.0], color=INK, lw=3.0)
    for sign, name in ((-1.0, "1 rear"), (1.0, "3 front")):
        x = sign * ROTOR_ARM
        axes.plot([x, x], [0.0, 0.03], color=INK, lw=2.0)
        axes.plot([x - ROTOR_RADIUS, x + ROTOR_RADIUS], [0.03, 0.03], color=INK, lw=1.5)
        arrow(axes, (x, 0.04), (x, 0.13), colour=GREEN)
        axes.text(x, 0.15, f"{name}: thrust f{name[0]}", color=GREEN, ha="center")
    elbow = _along((0.0, 0.0), TH1)
    tip = _along(elbow, TH1 + TH2)
    axes.plot([0.0, 0.0], [0.0, -0.17], color=FAINT, lw=0.8, ls="--")
    beyond = _along(elbow, TH1, 0.8)
    axes.plot([elbow[0], beyond[0]], [elbow[1], beyond[1]], color=FAINT, lw=0.8, ls="--")
    axes.plot([0.0, elbow[0], tip[0]], [0.0, elbow[1], tip[1]], "-o", color=ORANGE, lw=4.0, ms=7.0,
              mfc="white")  # fmt: skip
    _angle(axes, (0.0, 0.0), 0.10, 0.0, TH1)
    axes.text(-0.045, -0.13, "θ₁", color=RED, ha="center", fontsize=12.0)
    _angle(axes, elbow, 0.08, TH1, TH1 + TH2)
    axes.text(elbow[0], elbow[1] - 0.115, "θ₂", color=RED, ha="center", fontsize=12.0)
    axes.text(elbow[0] - 0.02, elbow[1], "joint 2", color=ORANGE, ha="right", va="center")
    axes.text(tip[0] + 0.02, tip[1], "E end-effector", color=ORANGE, va="center")
    arrow(axes, (0.0, 0.0), (0.13, 0.0), colour=BLUE)
    arrow(axes, (0.0, 0.0), (0.0, -0.13), colour=BLUE)
    axes.text(0.14, -0.03, "x_B", color=BLUE)
    axes.text(0.015, -0.13, "z_B", color=BLUE)
    axes.text(0.015, 0.015, "B = joint 1", color=BLUE)
    corner = (-0.38, -0.24)
    arrow(axes, corner, (corner[0] + 0.1, corner[1]), colour=FAINT)
    arrow(axes, corner, (corner[0], corner[1] - 0.1), colour=FAINT)
    axes.text(corner[0] + 0.11, corner[1], "x north", color=FAINT, va="center")
    axes.text(corner[0], corner[1] - 0.13, "z down", color=FAINT, ha="center")
    axes.text(corner[0] - 0.02, corner[1] + 0.015, "W", color=FAINT, weight="bold")
    axes.text(
        -0.2, -0.40,
        "θ₁ from straight down, θ₂ from link 1; both about +y: a positive\n"
        "angle swings the link forward. Drawn: θ₁ = −41.4°, θ₂ = +82.8°.",
        color=RED, fontsize=8.0,
    )  # fmt: skip


def draw_top(axes: Axes) -> None:
    """Seen from above: x forward upwards, y to the right, z away from the reader."""
    axes.set_title("from above (z points away from you)")
    axes.set_xlim(-0.5, 0.5)
    axes.set_ylim(-0.6, 0.5)
    for name, x, y, clockwise in (
        ("3 front", 0.0, ROTOR_ARM, False),
        ("1 rear", 0.0, -ROTOR_ARM, False),
        ("2 left", -ROTOR_ARM, 0.0, True),
        ("4 right", ROTOR_ARM, 0.0, True),
    ):
        axes.plot([0.0, x], [0.0, y], color=INK, lw=3.0, zorder=1)
        axes.add_patch(Circle((x, y), ROTOR_RADIUS, fc="#f6f8fa", ec=INK, zorder=2))
        axes.text(x, y, name, ha="center", va="center", zorder=3)
        _spin(axes, (x, y), clockwise)
    arrow(axes, (0.0, 0.0), (0.0, 0.15), colour=BLUE)
    arrow(axes, (0.0, 0.0), (0.15, 0.0), colour=BLUE)
    axes.text(0.015, 0.14, "x_B", color=BLUE)
    axes.text(0.12, -0.04, "y_B", color=BLUE)
    axes.text(
        0.0, -0.58,
        "Green: spin of the rotors. 1 and 3 turn counter-clockwise, which pushes the\n"
        "nose to the right (positive yaw); 2 and 4 turn clockwise.",
        color=GREEN, fontsize=8.0, ha="center",
    )  # fmt: skip


def _along(start: tuple[float, float], angle: float, share: float = 1.0) -> tuple[float, float]:
    length = share * LINK
    return start[0] + length * math.sin(angle), start[1] - length * math.cos(angle)


def _angle(
    axes: Axes, centre: tuple[float, float], radius: float, start: float, end: float
) -> None:
    """An arc with an arrow; angles from straight down, forward positive."""
    low, high = (math.degrees(a) - 90.0 for a in sorted((start, end)))
    axes.add_patch(
        Arc(centre, 2.0 * radius, 2.0 * radius, theta1=low, theta2=high, color=RED, lw=1.2)
    )
    near = start + 0.8 * (end - start)
    tail = (centre[0] + radius * math.sin(near), centre[1] - radius * math.cos(near))
    head = (centre[0] + radius * math.sin(end), centre[1] - radius * math.cos(end))
    arrow(axes, tail, head, colour=RED)


def _spin(axes: Axes, centre: tuple[float, float], clockwise: bool) -> None:
    """An arc above a rotor with the head where it turns to."""
    radius = ROTOR_RADIUS + 0.025
    axes.add_patch(
        Arc(centre, 2.0 * radius, 2.0 * radius, theta1=30.0, theta2=150.0, color=GREEN, lw=1.2)
    )
    end, near = (30.0, 42.0) if clockwise else (150.0, 138.0)
    ends = [
        (centre[0] + radius * math.cos(math.radians(a)),
         centre[1] + radius * math.sin(math.radians(a)))
        for a in (near, end)
    ]  # fmt: skip
    arrow(axes, ends[0], ends[1], colour=GREEN)
