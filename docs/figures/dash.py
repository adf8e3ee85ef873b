"""Four controllers on one page: where the horizon is too short, and where the barrier brakes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

from docs.figures.save import save
from sitl.scenario import Scenario
from studies.flight.job import Job, fly_job
from studies.paper.cases import entrants, scenario

BASE, REFERENCE, END_EFFECTOR, FORBIDDEN = "#0969da", "#1a7f37", "#bc4c00", "#cf222e"
NO_PLAN: Final = "#8250df"
NAMES: Final = {"naive": "Naive MPC", "hc": "MPC-HC", "sc": "MPC-SC", "blf": "MPC-BLF"}
_SHOWN_S: Final = (3.5, 17.0)
_ON_WHITE: Final = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0}
PLAN_S: Final = 0.1
_SLOWER: Final = 0.1  # m/s, less than without a safety term: it brakes


@dataclass(frozen=True)
class Dash:
    """One flight past the wall."""

    t: np.ndarray[Any, Any]  # (points,) s
    distance: dict[str, np.ndarray[Any, Any]]  # (points,) m to the wall, of base and others
    along: dict[str, np.ndarray[Any, Any]]  # (points,) m beside the wall, of the same
    speed: np.ndarray[Any, Any]  # (points,) m/s of the base towards the wall
    failed_s: list[float]  # planning steps without a plan
    reason: str


def fly_dash(flown: Scenario, name: str) -> Dash:
    """Fly a controller past the wall."""
    (config,) = [
        one.config
        for one in entrants("I", "full", "tracking", "dash")
        if (one.comparison, one.name) == ("paper", name)
    ]
    result = fly_job(Job("full", flown, config, 0), traced=True)
    wall = flown.walls[0]
    n, points = np.array(wall.normal) / np.linalg.norm(wall.normal), result.planner.trace
    t = np.array([point.t_s for point in points])
    paths = {
        "base": np.array([point.p_WB for point in points]),
        "end-effector": np.array([point.p_WE for point in points]),
        "reference": np.array([point.p_target for point in points]),
    }
    distance = {key: path @ n - wall.offset_m for key, path in paths.items()}
    along = np.cross(n, (0.0, 0.0, 1.0))  # level, like the normal
    return Dash(
        t=t,
        distance=distance,
        along={key: path @ along for key, path in paths.items()},
        speed=-np.gradient(distance["base"], t),
        failed_s=[PLAN_S * number for number in result.planner.failed_ids],
        reason=result.truth.end_reason,
    )


def shown() -> Scenario:
    """The scenario, as far as it is drawn."""
    return scenario("I", disturbed=False, duration_s=_SHOWN_S[1], family="dash")


def fly_four(flown: Scenario) -> dict[str, Dash]:
    """Fly every controller of ``NAMES``."""
    return {name: fly_dash(flown, name) for name in NAMES}


def draw_dash(flown: Scenario, flights: dict[str, Dash], target: Path) -> None:
    """Draw the four over time."""
    figure, axes = plt.subplots(
        2, 4, figsize=(11.0, 5.2), sharex=True, sharey="row", layout="constrained"
    )
    figure.suptitle(
        "dash-calm: at 1.5 m/s the path turns back in the safety zone of a wall",
        fontsize=10.0,
    )
    clearance = flown.walls[0].clearance_m
    for (name, flight), above, below in zip(flights.items(), axes[0], axes[1], strict=True):
        _draw_distance(above, flight, clearance)
        _draw_speed(below, flight, flights["naive"])
        above.set_title(f"{NAMES[name]}: {_verdict(flight, clearance)}", fontsize=9.0, loc="left")
        below.set_xlabel("time, s")
    axes[0][0].set_ylabel("distance to the wall, m")
    axes[1][0].set_ylabel("base towards the wall, m/s")
    axes[0][0].legend(frameon=False, fontsize=7.5, loc="upper right")
    axes[0][0].set_xlim(*_SHOWN_S)
    axes[0][0].set_ylim(-0.1, 1.4)
    save(figure, target)


def _verdict(flight: Dash, clearance: float) -> str:
    nearest = min(float(flight.distance[key].min()) for key in ("base", "end-effector"))
    if "hit" in flight.reason:
        return "hits the wall"
    return f"keeps {1e3 * nearest:.0f} mm" + (" of 100" if nearest < clearance else "")


def _draw_distance(axes: Axes, flight: Dash, clearance: float) -> None:
    axes.axhspan(-1.0, 0.0, color=FORBIDDEN, alpha=0.35, linewidth=0.0)
    axes.axhspan(0.0, clearance, color="#ffebe9", linewidth=0.0)
    for key, colour in (("reference", REFERENCE), ("base", BASE), ("end-effector", END_EFFECTOR)):
        axes.plot(flight.t, flight.distance[key], color=colour, linewidth=1.2, label=key)
    if "hit" in flight.reason:
        axes.plot(flight.t[-1], 0.0, "o", color=FORBIDDEN, ms=6.0)
        axes.annotate(
            "contact", (flight.t[-1], 0.0), (4, 6), textcoords="offset points", fontsize=8
        )
    for t in flight.failed_s:
        axes.axvspan(t, t + PLAN_S, color=NO_PLAN, alpha=0.3, linewidth=0.0)
    if flight.failed_s:
        first = flight.failed_s[0]
        axes.annotate(
            f"infeasible from {first:.1f} s",
            (first, 1.28),
            (-4, 0),
            textcoords="offset points",
            fontsize=8,
            color=NO_PLAN,
            ha="right",
            bbox=_ON_WHITE,
        )


def _draw_speed(axes: Axes, flight: Dash, free: Dash) -> None:
    axes.plot(free.t, free.speed, color="#8c959f", linewidth=0.8, linestyle="--")
    axes.plot(flight.t, flight.speed, color=BASE, linewidth=1.2)
    axes.axhline(0.0, color="#8c959f", linewidth=0.5)
    brakes = braking_from(flight, free)
    if brakes is not None:
        axes.axvline(brakes, color=FORBIDDEN, linewidth=0.9, linestyle=":")
        axes.annotate(
            f"brakes from {brakes:.1f} s",
            (brakes, -1.2),
            (3, 0),
            textcoords="offset points",
            fontsize=8,
            color=FORBIDDEN,
            bbox=_ON_WHITE,
        )


def braking_from(flight: Dash, free: Dash) -> float | None:
    """When a flight [s] first becomes slower towards the wall than one without a safety term."""
    if flight is free:
        return None
    both = min(len(flight.t), len(free.t))
    window = flight.t[:both] >= _SHOWN_S[0]
    slower = window & (free.speed[:both] - flight.speed[:both] > _SLOWER)
    return float(flight.t[np.argmax(slower)]) if slower.any() else None
