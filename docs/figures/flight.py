"""One flight: paths seen from above, and the smallest margin over time."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import Circle
from pyulog import ULog

from docs.figures.save import save
from sitl.scenario import Scenario
from sitl.scenario_file import load_scenario

BASE, REFERENCE, END_EFFECTOR, FORBIDDEN = "#0969da", "#1a7f37", "#bc4c00", "#cf222e"
ZONE = "#ffebe9"
TOP_MM = 500.0  # of the margin's axis


def recorded(directory: Path) -> dict[str, Any]:
    """The numbers of a flight that pages and pictures print."""
    result = json.loads((directory / "result.json").read_text(encoding="utf-8"))
    return {
        "scenario": result["scenario"],
        "sensors": result["sensors"],
        "seed": result["seed"],
        "duration_s": result["duration_s"],
        "completed": result["completed"],
        "tracking_error_rms_mm": round(1e3 * result["tracking_error_rms_m"], 1),
        "min_margin_mm": round(1e3 * result["min_margin_m"], 1),
    }


def draw_flight(directory: Path, target: Path) -> None:
    """Draw the flight of a run directory."""
    numbers = recorded(directory)
    name = numbers["scenario"]
    log = ULog(str(directory / "flight.ulg"))
    figure, (above, over_time) = plt.subplots(
        1, 2, figsize=(10.0, 4.6), width_ratios=(1.0, 1.15), layout="constrained"
    )
    done = "completed" if numbers["completed"] else "not completed"
    figure.suptitle(
        f"pandion fly {name} --sensors {numbers['sensors']} --seed {numbers['seed']}: {done}, "
        f"{numbers['duration_s']:.0f} s, "
        f"tracking error {numbers['tracking_error_rms_mm']:.1f} mm RMS, "
        f"minimum margin {numbers['min_margin_mm']:.1f} mm",
        fontsize=10.0,
    )
    draw_obstacles(above, load_scenario(name))
    draw_paths(above, log)
    draw_margin(over_time, log)
    save(figure, target)


def draw_paths(axes: Axes, log: ULog) -> None:
    """Base, reference and end-effector, east to the right, north up."""
    base = log.get_dataset("vehicle_local_position").data
    tip = log.get_dataset("end_effector").data
    axes.plot(base["y"][::5], base["x"][::5], color=BASE, lw=0.6, label="base")
    axes.plot(tip["p_ref[1]"], tip["p_ref[0]"], color=REFERENCE, lw=1.8, label="reference")
    axes.plot(tip["p[1]"], tip["p[0]"], color=END_EFFECTOR, lw=0.8, label="end-effector")
    axes.set_aspect("equal")
    axes.set_xlabel("east [m]")
    axes.set_ylabel("north [m]")
    axes.set_title("seen from above; red: closer than the clearance", fontsize=9.0)
    axes.legend(
        loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=3, frameon=False, fontsize=8.0
    )


def draw_obstacles(axes: Axes, scenario: Scenario) -> None:
    """Walls and points, each with the zone of its clearance."""
    for wall in scenario.walls:
        north = abs(wall.normal[0]) > 0.5
        place = wall.offset_m * (wall.normal[0] if north else wall.normal[1])
        inwards = wall.clearance_m * (wall.normal[0] if north else wall.normal[1])
        line, span = (axes.axhline, axes.axhspan) if north else (axes.axvline, axes.axvspan)
        span(place, place + inwards, color=ZONE, lw=0.0)
        line(place, color=FORBIDDEN, lw=2.5)
    for point in scenario.obstacles:
        at = (point.position_m[1], point.position_m[0])
        axes.add_patch(Circle(at, point.clearance_m, color=ZONE, lw=0.0))
        axes.plot(*at, "o", color=FORBIDDEN, ms=4.0)
        axes.annotate(
            f"{point.name}, {-point.position_m[2]:.2f} m high", at, xytext=(5.0, 5.0),
            textcoords="offset points", color=FORBIDDEN, fontsize=8.0,
        )  # fmt: skip


def draw_margin(axes: Axes, log: ULog) -> None:
    """The smallest margin as the flight software saw it, once a planning cycle."""
    data = log.get_dataset("barrier_margin").data
    t = seconds(log, data)
    margin = np.minimum(1e3 * data["minimum"], TOP_MM)
    axes.plot(t, margin, color=BASE, lw=0.9)
    axes.axhline(0.0, color=FORBIDDEN, lw=1.0)
    axes.set_ylim(-10.0, TOP_MM)
    axes.set_xlim(0.0, float(t[-1]))
    axes.grid(axis="y", color="#d0d7de", lw=0.5)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("smallest margin [mm]")
    axes.set_title("distance of base, joint 2 or end-effector beyond the clearance", fontsize=9.0)


def seconds(log: ULog, data: dict[str, Any]) -> np.ndarray[Any, Any]:
    """Times (n,) [s] of a topic's rows since the log began."""
    times: np.ndarray[Any, Any] = 1e-6 * (data["timestamp"].astype(float) - log.start_timestamp)
    return times
