"""Fig. 2: the inverse workspace and the spheres that fit into it."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from studies.campaign.campaign import Campaign
from studies.drawing import BASE, BOUND, END_EFFECTOR, TARGET, Sheet, sheet
from studies.flight.job import Outcome
from studies.paper.deviations import deviations
from studies.paper.inverse_workspace import BOTH_ELBOWS, Array, Inscribed, InverseWorkspace
from studies.paper.settings import Figure, Report, Settings, Table

PAPER = Inscribed(0.0, 0.225, 0.075)  # d_iw of Table II; r from the same set

_ELBOWS: dict[str, tuple[int, ...]] = {"both elbows": BOTH_ELBOWS, "one elbow": (1,)}
_GRID_M = 0.002


def run(settings: Settings, campaign: Campaign[Outcome]) -> Report:
    """Compute and draw the set, which depends on no setting."""
    sets = {name: InverseWorkspace(elbows=elbows) for name, elbows in _ELBOWS.items()}
    took_s: dict[tuple[str, str], float] = {}  # processor time of each sphere
    spheres: dict[str, dict[str, Inscribed]] = {name: {} for name in sets}
    for name, workspace in sets.items():
        for what, find in _SPHERES.items():
            began_s = time.thread_time()
            spheres[name][what] = find(workspace)
            took_s[name, what] = time.thread_time() - began_s
    rows = [
        {
            "elbows": name,
            "sphere": what,
            "x_m": sphere.x_m,
            "d_iw_m": sphere.up_m,
            "radius_m": sphere.radius_m,
            "took_s": took_s[name, what],
        }
        for name, found in spheres.items()
        for what, sphere in found.items()
    ]
    arrays = {
        name: {
            "boundary_x_m": workspace.boundary[::50, 0].round(6).tolist(),
            "boundary_up_m": workspace.boundary[::50, 1].round(6).tolist(),
        }
        for name, workspace in sets.items()
    }
    caption = (
        "Base positions (shaded) from which the end-effector at (0, 0) is reached; largest sphere "
        "(orange), the paper's at d_iw = 0.225 m (green), the largest with its centre straight "
        "above (blue, dashed). Turned about x = 0 in space."
    )
    return Report(
        title="Fig. 2, inverse workspace",
        rows=rows,
        tables=(
            Table(
                "Inscribed spheres",
                ("elbows", "sphere", "x mm", "d_iw mm", "r mm"),
                tuple(
                    (
                        str(row["elbows"]),
                        str(row["sphere"]),
                        *(f"{1000.0 * sphere:.1f}" for sphere in _numbers(row)),
                    )
                    for row in rows
                ),
            ),
        ),
        figures=(Figure("fig2", caption, _draw(sets, spheres).svg(), arrays),),
        deviations=deviations("fig2"),
    )


def _numbers(row: dict[str, object]) -> list[float]:
    return [float(str(row[key])) for key in ("x_m", "d_iw_m", "radius_m")]


def _at_the_papers_centre(workspace: InverseWorkspace) -> Inscribed:
    radius = workspace.inscribed_radius(PAPER.x_m, PAPER.up_m)
    return Inscribed(PAPER.x_m, PAPER.up_m, radius)


_SPHERES: dict[str, Callable[[InverseWorkspace], Inscribed]] = {
    "at the paper's centre": _at_the_papers_centre,
    "straight above": lambda workspace: workspace.largest(on_axis=True),
    "anywhere": InverseWorkspace.largest,
}


def _draw(sets: dict[str, InverseWorkspace], spheres: dict[str, dict[str, Inscribed]]) -> Sheet:
    drawn = sheet(1, len(sets), 5.0 * len(sets), 5.0)
    x, up = np.meshgrid(np.arange(-0.32, 0.32, _GRID_M), np.arange(-0.1, 0.32, _GRID_M))
    for ax, (name, workspace) in zip(drawn.axes[0], sets.items(), strict=True):
        inside = workspace.contains(x, up).astype(float)
        ax.contourf(x, up, inside, levels=[0.5, 1.5], colors=["#d8e7fb"])
        ax.contour(x, up, inside, levels=[0.5], colors=[BOUND], linewidths=0.8)
        found = spheres[name]
        for what, colour, line in (
            ("at the paper's centre", TARGET, "-"),
            ("straight above", BASE, "--"),
            ("anywhere", END_EFFECTOR, "-"),
        ):
            ax.plot(*_circle(found[what]), color=colour, linestyle=line, linewidth=1.2)
        ax.plot(0.0, 0.0, "k+")
        ax.set_aspect("equal")
        ax.set_title(name, fontsize=9)
        ax.set_xlabel("x m", fontsize=8)
        ax.set_ylabel("above the end-effector m", fontsize=8)
    return drawn


def _circle(sphere: Inscribed) -> Array:
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    centre = np.array([[sphere.x_m], [sphere.up_m]])
    return np.asarray(centre + sphere.radius_m * np.stack([np.cos(angle), np.sin(angle)]))
