"""The same four flights from above, moving, past the moment when the last of them hits the wall."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

from docs.figures.animation import save_moving
from docs.figures.dash import (
    BASE,
    END_EFFECTOR,
    FORBIDDEN,
    NAMES,
    NO_PLAN,
    PLAN_S,
    REFERENCE,
    Dash,
)
from sitl.scenario import Scenario

_BEFORE_S: Final = 2.0  # of the last contact
_AFTER_S: Final = 0.8
_LASTS_MS: Final = 100  # a picture; the points of a trace are 40 ms apart
_STANDS_MS: Final = 2000  # the last one
_TRAIL: Final = 30  # points
_AHEAD_S: Final = 0.5  # what the horizon sees
_BRAKING: Final = 0.5  # m/s^2, from which it is said
_SIDE: Final = 0.5  # m, beside the middle
_TOP: Final = 1.6  # m from the wall


def draw_dash_animation(flown: Scenario, flights: dict[str, Dash], target: Path) -> None:
    """Draw the four side by side as WebP."""
    contact = max(float(one.t[-1]) for one in flights.values() if "hit" in one.reason)
    t = flights["blf"].t
    shown = np.flatnonzero((t >= contact - _BEFORE_S) & (t <= contact + _AFTER_S))
    clearance = flown.walls[0].clearance_m
    pictures = [_picture(flights, int(k), clearance) for k in shown]
    save_moving(pictures, [_LASTS_MS] * (len(pictures) - 1) + [_STANDS_MS], target)


def _picture(flights: dict[str, Dash], k: int, clearance: float) -> Image.Image:
    figure, axes = plt.subplots(
        1, 4, figsize=(8.8, 3.9), dpi=100, sharey=True, layout="constrained"
    )
    t = float(flights["blf"].t[k])
    figure.suptitle(
        f"dash-calm from above, {t:.1f} s; arrow: what the base moves in 0.5 s, as far as the "
        "horizon sees",
        fontsize=8.5,
    )
    middle = float(np.mean(flights["blf"].along["reference"]))
    for panel, (name, flight) in zip(axes, flights.items(), strict=True):
        _draw(panel, flight, min(k, len(flight.t) - 1), middle, clearance)
        panel.set_title(NAMES[name], fontsize=9.0, loc="left")
        _say(panel, flight, k)
    axes[0].set_ylabel("distance to the wall, m", fontsize=8.0)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    picture = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
    plt.close(figure)
    return picture


def _draw(axes: Axes, flight: Dash, k: int, middle: float, clearance: float) -> None:
    axes.axhspan(-1.0, 0.0, color=FORBIDDEN, alpha=0.35, linewidth=0.0)
    axes.axhspan(0.0, clearance, color="#ffebe9", linewidth=0.0)
    begin = max(0, k - _TRAIL)
    for key, colour in (("reference", REFERENCE), ("base", BASE), ("end-effector", END_EFFECTOR)):
        x, y = flight.along[key] - middle, flight.distance[key]
        axes.plot(x[begin : k + 1], y[begin : k + 1], color=colour, linewidth=0.9, alpha=0.5)
        axes.plot(x[k], y[k], "o", color=colour, ms=7.0 if key == "base" else 4.0)
    x, y = flight.along["base"] - middle, flight.distance["base"]
    arm = flight.along["end-effector"][k] - middle, flight.distance["end-effector"][k]
    axes.plot((x[k], arm[0]), (y[k], arm[1]), color="#57606a", linewidth=1.5)
    ahead = _AHEAD_S * np.gradient(x, flight.t)[k], -_AHEAD_S * flight.speed[k]
    axes.quiver(
        x[k], y[k], *ahead, color=BASE, angles="xy", scale_units="xy", scale=1.0, width=0.012
    )
    axes.set_xlim(-_SIDE, _SIDE)
    axes.set_ylim(-0.08, _TOP)
    axes.set_aspect("equal")
    axes.set_xticks(())
    axes.tick_params(labelsize=7.0)


def _say(axes: Axes, flight: Dash, k: int) -> None:
    """What happens now."""
    over = k >= len(flight.t) - 1 and "hit" in flight.reason
    t, said, colour = flight.t[min(k, len(flight.t) - 1)], "", FORBIDDEN
    slowing = -np.gradient(flight.speed, flight.t)[min(k, len(flight.t) - 1)]
    if over:
        said = f"contact at {flight.t[-1]:.1f} s"
    elif any(begin <= t < begin + PLAN_S for begin in flight.failed_s):
        said, colour = "no plan: infeasible", NO_PLAN
    elif flight.speed[k] > 0.0 and slowing > _BRAKING:
        said, colour = "brakes", BASE
    axes.text(
        0.5, 0.96, said, color=colour, fontsize=9.0, weight="bold", ha="center", va="top",
        transform=axes.transAxes,
    )  # fmt: skip
