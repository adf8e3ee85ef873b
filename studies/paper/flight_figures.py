"""Figs. 6 to 8: one flight of each of the paper's controllers, drawn from the plant's truth."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from sitl.scenario import Scenario
from studies.campaign.campaign import Campaign
from studies.drawing import BASE, BOUND, END_EFFECTOR, TARGET, WALL, Sheet, sheet
from studies.flight.job import Job, Outcome, fly_job
from studies.flight.result import FlightResult
from studies.paper.cases import Case, Entrant, entrants, scenario
from studies.paper.deviations import deviations
from studies.paper.settings import Figure, Report, Settings, Table
from studies.table_text import metres, millimetres

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TITLES = {"naive": "Naive MPC", "hc": "MPC-HC", "sc": "MPC-SC", "blf": "MPC-BLF"}
_AXES = ("x", "y", "z")

Flights = dict[str, FlightResult]  # by controller
Arrays = dict[str, dict[str, list[float]]]  # controller -> quantity -> values
Draw = Callable[[Arrays, Scenario], Sheet]


def fig6(settings: Settings, campaign: Campaign[Outcome]) -> Report:
    """Position against time in Case II."""
    caption = "Case II with disturbance: desired (green), UAV (blue), end-effector (orange)"
    return _report("fig6", caption, "II", settings, campaign, _over_time)


def fig7(settings: Settings, campaign: Campaign[Outcome]) -> Report:
    """The base relative to the workspace sphere in Case II."""
    caption = "Case II with disturbance: UAV relative to the workspace sphere, in mm"
    return _report("fig7", caption, "II", settings, campaign, _in_sphere)


def fig8(settings: Settings, campaign: Campaign[Outcome]) -> Report:
    """Position towards the front wall in Case I."""
    caption = "Case I with disturbance: x of the desired path (green), UAV (blue) and "
    caption += "end-effector (orange); wall (red), its safety zone (dashed), collision (dot)"
    return _report("fig8", caption, "I", settings, campaign, _towards_wall)


def _report(
    name: str, caption: str, case: Case, settings: Settings, campaign: Campaign[Outcome], draw: Draw
) -> Report:
    flown = scenario(case, disturbed=True, duration_s=settings.duration_s)
    flights, took_s = _fly(case, flown, settings, campaign)
    arrays = {controller: _arrays(flight) for controller, flight in flights.items()}
    return Report(
        title=f"{name.capitalize()}, {settings.plant} plant, seed {settings.seeds[0]}",
        rows=[
            {**_row(name, settings, controller, flight), "took_s": took_s[controller]}
            for controller, flight in flights.items()
        ],
        tables=(_table(flights),),
        figures=(Figure(name, caption, draw(arrays, flown).svg(), dict(arrays)),),
        deviations=deviations("flight-figures", settings.plant),
    )


def _fly(
    case: Case, flown: Scenario, settings: Settings, campaign: Campaign[Outcome]
) -> tuple[Flights, dict[str, float]]:
    """The flight of each controller, and its processor time [s]."""
    chosen: list[Entrant] = [
        entrant
        for entrant in entrants(case, settings.plant, settings.inner)
        if entrant.comparison == "paper" and entrant.name in TITLES
    ]
    flights: Flights = {}
    took_s = {}
    for entrant in chosen:
        campaign.report(len(flights), len(chosen))
        job = Job(settings.plant, flown, entrant.config, settings.seeds[0])
        began_s = time.thread_time()
        flights[entrant.name] = fly_job(job, traced=True)
        took_s[entrant.name] = time.thread_time() - began_s
    campaign.report(len(chosen), len(chosen))
    return flights, took_s


def _arrays(flight: FlightResult) -> dict[str, list[float]]:
    points = flight.planner.trace
    arrays = {"t_s": [round(point.t_s, 3) for point in points]}
    for k, axis in enumerate(_AXES):
        arrays[f"target_{axis}_m"] = [round(point.p_target[k], 6) for point in points]
        arrays[f"base_{axis}_m"] = [round(point.p_WB[k], 6) for point in points]
        arrays[f"end_effector_{axis}_m"] = [round(point.p_WE[k], 6) for point in points]
    arrays["margin_m"] = [round(point.margin_m, 6) for point in points]
    return arrays


def _row(name: str, settings: Settings, controller: str, flight: FlightResult) -> dict[str, Any]:
    truth = flight.truth
    return {
        "figure": name,
        "plant": settings.plant,
        "seed": settings.seeds[0],
        "controller": controller,
        "completed": truth.completed,
        "end_reason": truth.end_reason,
        "te_m": truth.tracking_error_rms_m,
        "worst_margin_m": truth.min_margin_m,
    }


def _table(flights: Flights) -> Table:
    return Table(
        "How each flight went",
        ("controller", "completed", "worst margin mm", "TE m", "end"),
        tuple(
            (
                TITLES[name],
                "yes" if flight.truth.completed else "no",
                millimetres(flight.truth.min_margin_m),
                metres(flight.truth.tracking_error_rms_m),
                flight.truth.end_reason,
            )
            for name, flight in flights.items()
        ),
    )


def _over_time(arrays: Arrays, flown: Scenario) -> Sheet:
    drawn = sheet(len(arrays), 3, 12.0, 2.2 * len(arrays), sharex=True)
    for row, (name, values) in zip(drawn.axes, arrays.items(), strict=True):
        for ax, axis in zip(row, _AXES, strict=True):
            _lines(ax, values, axis)
            ax.set_ylabel(f"{axis} m", fontsize=8)
        row[0].set_title(TITLES[name], fontsize=9, loc="left")
    for ax in drawn.axes[-1]:
        ax.set_xlabel("t s", fontsize=8)
    return drawn


def _towards_wall(arrays: Arrays, flown: Scenario) -> Sheet:
    drawn = sheet(len(arrays), 1, 9.0, 2.2 * len(arrays), sharex=True)
    front = flown.walls[0]
    wall_x = front.offset_m / front.normal[0]
    for row, (name, values) in zip(drawn.axes, arrays.items(), strict=True):
        ax = row[0]
        _lines(ax, values, "x")
        ax.axhline(wall_x, color=WALL)
        safe_x = (front.offset_m + front.clearance_m) / front.normal[0]
        ax.axhline(safe_x, color=WALL, linestyle="--", linewidth=0.8)
        if values["t_s"][-1] < flown.duration_s - 1.0:
            ax.plot(values["t_s"][-1], values["end_effector_x_m"][-1], "o", color=WALL)
        ax.set_title(TITLES[name], fontsize=9, loc="left")
        ax.set_ylabel("x m", fontsize=8)
    drawn.axes[-1][0].set_xlabel("t s", fontsize=8)
    return drawn


def _lines(ax: Axes, values: dict[str, list[float]], axis: str) -> None:
    t = values["t_s"]
    ax.plot(t, values[f"target_{axis}_m"], color=TARGET, linewidth=1.0)
    ax.plot(t, values[f"base_{axis}_m"], color=BASE, linewidth=0.8)
    ax.plot(t, values[f"end_effector_{axis}_m"], color=END_EFFECTOR, linewidth=0.8)


def _in_sphere(arrays: Arrays, flown: Scenario) -> Sheet:
    workspace = flown.workspace
    assert workspace is not None
    drawn = sheet(2, len(arrays), 3.0 * len(arrays), 6.2)
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    circle = 1e3 * workspace.radius_m * np.stack([np.cos(angle), np.sin(angle)])
    for column, (name, values) in enumerate(arrays.items()):
        x = _relative(values, "x", 0.0)
        for row, up in (
            (0, _relative(values, "y", 0.0)),
            (1, -_relative(values, "z", -workspace.d_iw_m)),
        ):
            ax = drawn.axes[row][column]
            ax.plot(x, up, color=BASE, linewidth=0.6)
            ax.plot(*circle, color=TARGET, linewidth=1.2)
            ax.plot(0.0, 0.0, "+", color=BOUND)
            ax.set_aspect("equal", adjustable="datalim")
            ax.set_xlabel("x mm", fontsize=8)
            ax.set_ylabel(("y mm", "up mm")[row], fontsize=8)
        drawn.axes[0][column].set_title(TITLES[name], fontsize=9)
    return drawn


def _relative(values: dict[str, list[float]], axis: str, offset_m: float) -> np.ndarray:
    """Base from the sphere's centre along an axis [mm]."""
    centre = np.array(values[f"target_{axis}_m"]) + offset_m
    return np.asarray(1e3 * (np.array(values[f"base_{axis}_m"]) - centre))
