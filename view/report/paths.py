"""The path in three dimensions: east, north and up, between the zones."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.signals import Vec3, Zone
from view.flight_data import UlogError
from view.report.chart import COLOURS, LIMIT, REFERENCE, Chart, Trace
from view.report.reported import Reported
from view.scene import vec3
from view.zone_meshes import Mesh, zone_mesh

Array = NDArray[Any]

_MOST: Final = 1500  # points of a path
_AROUND_M: Final = 0.35  # of the paths that a wall is drawn
_BODY_OPACITY, _CLEARANCE_OPACITY = 0.3, 0.1
_AXIS: Final = "#6e7781"  # seen on white and on a dark screen: a scene is not recoloured for paper
_MAX_TRIANGLES: Final = 30_000  # of all zones: half a megabyte of the page


def paths(flights: Sequence[Reported]) -> Chart:
    """Base, end-effector and reference of each flight, and the zones of the first."""
    traces: list[Trace] = []
    seen = []
    for k, flight in enumerate(flights):
        alone = len(flights) == 1
        for name, places, colour, width in _lines(flight):
            seen.append(places)
            if alone or name != "base":
                shade = colour if alone else COLOURS[k % len(COLOURS)]
                shown = name if alone else f"{flight.label}: {name}"
                if alone or name != "reference" or k == 0:
                    ours = name == "reference" and not alone
                    traces.append(_path("reference" if ours else shown, places,
                                        REFERENCE if ours else shade, width))  # fmt: skip
        traces += _worst(flight, "smallest margin" if alone else f"{flight.label}: smallest margin")
    if seen:
        every = np.concatenate(seen)
        low, high = np.nanmin(every, axis=0) - _AROUND_M, np.nanmax(every, axis=0) + _AROUND_M
        traces += _zones(flights[0], (vec3(low), vec3(high)))
    layout = {
        "height": 560,
        "scene": {
            "aspectmode": "data",
            "xaxis": {"title": {"text": "east [m]"}, "color": _AXIS},
            "yaxis": {"title": {"text": "north [m]"}, "color": _AXIS},
            "zaxis": {"title": {"text": "up [m]"}, "color": _AXIS},
            "camera": {
                "eye": {"x": -1.0, "y": -1.3, "z": 0.9},
                "center": {"x": 0, "y": 0, "z": -0.1},
            },
        },
        "margin": {"l": 0, "r": 0, "t": 8, "b": 0},
    }
    note = (
        "Turn it with the mouse. Red: what must not be touched, where it was announced first; pale "
        "red: with its clearance."
    )
    return Chart("path", "Path", note, traces, layout)


def _lines(flight: Reported) -> list[tuple[str, Array, str, float]]:
    """Name, places (n, 3) [m, NED], colour and width of each line."""
    found = []
    own, tracked = flight.table("vehicle_local_position"), flight.table("sim_tracking")
    effector = flight.table("end_effector")
    if flight.margins is not None:
        found.append(("base", flight.margins.places[:, 0], COLOURS[0], 3.0))
        found.append(
            ("end-effector", flight.margins.places[:, flight.margins.tip], COLOURS[1], 3.0)
        )
    elif own is not None:
        estimated = np.stack([own[name] for name in ("x", "y", "z")], axis=1)
        found.append(("base", estimated, COLOURS[0], 3.0))
        if effector is not None:
            found.append(("end-effector", effector["p"], COLOURS[1], 3.0))
    if tracked is not None:
        found.append(("reference", tracked["target"], REFERENCE, 4.0))
    elif effector is not None:
        found.append(("reference", effector["p_ref"], REFERENCE, 4.0))
    return [(name, np.asarray(p, "f8"), colour, width) for name, p, colour, width in found]


def _path(name: str, places: Array, colour: str, width: float) -> Trace:
    step = max(1, -(-len(places) // _MOST))
    return {
        "type": "scatter3d", "mode": "lines", "name": name, **_enu(places[::step]),
        "line": {"color": colour, "width": width},
    }  # fmt: skip


def _worst(flight: Reported, name: str) -> list[Trace]:
    """Where the part was that came nearest to anything."""
    worst = flight.worst
    if worst is None or flight.margins is None:
        return []
    k = int(np.abs(flight.since(flight.margins.t) - worst.t).argmin())
    row = flight.margins.near.get(worst.key.partition("/")[2], 0)
    return [{
        "type": "scatter3d", "mode": "markers", "name": name,
        **_enu(flight.margins.places[k, row][None]),
        "marker": {"color": LIMIT, "size": 5, "symbol": "diamond"},
        "hovertext": [f"{worst.key}: {1e3 * worst.margin:.1f} mm at {worst.t:.2f} s"],
    }]  # fmt: skip


def _zones(flight: Reported, region: tuple[Vec3, Vec3]) -> list[Trace]:
    """Each zone that was announced first, and where its clearance ends."""
    traces, triangles = [], 0
    target = _target_at_worst(flight)
    for k, zone in enumerate(announced_zones(flight), start=1):
        shown = zone_mesh(zone, region, target)
        if shown is None:
            continue
        meshes = [(shown.surface, _CLEARANCE_OPACITY if zone.keep_in else _BODY_OPACITY, "")]
        if shown.shell is not None:
            meshes.append((shown.shell, _CLEARANCE_OPACITY, " with its clearance"))
        triangles += sum(len(part.faces) for part, _, _ in meshes)
        if triangles > _MAX_TRIANGLES:
            break
        traces += [_surface(part, opacity, f"zone {k}{more}") for part, opacity, more in meshes]
    return traces


def announced_zones(flight: Reported) -> tuple[Zone, ...]:
    """The zones of the first safe set that was announced; none in a log of another build."""
    with contextlib.suppress(UlogError):
        for _, announced in flight.data.decoded("announced"):
            if announced and announced[0].safe_set.zones:
                zones: tuple[Zone, ...] = announced[0].safe_set.zones
                return zones
    return ()


def _target_at_worst(flight: Reported) -> Vec3 | None:
    tracked, worst = flight.table("sim_tracking"), flight.worst
    if tracked is None or worst is None:
        return None
    return vec3(tracked["target"][int(np.abs(flight.since(tracked.t) - worst.t).argmin())])


def _surface(shown: Mesh, opacity: float, name: str) -> Trace:
    i, j, k = shown.faces.T.tolist()
    return {
        "type": "mesh3d", **_enu(shown.vertices), "i": i, "j": j, "k": k, "color": LIMIT,
        "opacity": opacity, "name": name, "hoverinfo": "name", "flatshading": True,
    }  # fmt: skip


def _enu(places: Array) -> dict[str, list[float | None]]:
    """East, north and up of places (n, 3) [m, NED], to a tenth of a millimetre."""

    def listed(values: Array) -> list[float | None]:
        return [round(float(v), 4) if np.isfinite(v) else None for v in values]

    return {"x": listed(places[:, 1]), "y": listed(places[:, 0]), "z": listed(-places[:, 2])}
