"""Figures as Plotly takes them: JSON of traces and a layout, made without Plotly's Python."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Trace = dict[str, Any]

COLOURS: Final = ("#0969da", "#bc4c00", "#1a7f37", "#8250df", "#bf3989", "#9a6700", "#57606a")
LIMIT: Final = "#cf222e"
TRUTH, ESTIMATE, REFERENCE = "#0969da", "#8c959f", "#1a7f37"
_DIGITS: Final = 5  # of a number in the page
_ROW_PX: Final = 200  # of one pair of axes
_LEGEND_PX: Final = 40  # above each row
_EVENTS_PX: Final = 18  # above the first row, below its legend
_MARGIN: Final = {"l": 70, "r": 34, "t": _LEGEND_PX + _EVENTS_PX + 6, "b": 44}
_OF_EVENTS: Final = {"color": "#afb8c1", "width": 1}
_BAND = "rgba(87,96,106,0.25)"


@dataclass(frozen=True, slots=True)
class Chart:
    """One figure of the page."""

    name: str  # of the numbers, and of the element
    title: str
    note: str  # what is seen, in a sentence or two
    data: list[Trace]
    layout: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Row:
    """One pair of axes of a figure over time."""

    unit: str  # title of the axis
    traces: list[Trace]
    limits: tuple[float, ...] = ()  # drawn across, in the axis' unit
    span: tuple[float, float] | None = None  # shown at first


def rounded(values: Array) -> list[float | None]:
    """``values`` (n,) [any unit] with five digits; what is not finite is null, a gap in a line."""
    return [float(f"{v:.{_DIGITS}g}") if np.isfinite(v) else None for v in np.asarray(values, "f8")]


def thinned(t: Array, y: Array, most: int) -> tuple[Array, Array]:
    """At most ``most`` samples that keep every extreme: the least and the most of each piece.

    ``t`` (n,) [s], ``y`` (n,) [any unit].
    """
    if len(t) <= most:
        return t, y
    kept = []
    for piece in np.array_split(np.arange(len(t)), most // 2):
        values = y[piece]
        if np.isfinite(values).any():
            kept += sorted((piece[np.nanargmin(values)], piece[np.nanargmax(values)]))
        else:
            kept.append(piece[0])
    places = np.unique(kept)
    return t[places], y[places]


def line(
    name: str, t: Array, y: Array, colour: str, *, most: int = 2000, width: float = 1.2, **more: Any
) -> Trace:
    """A line over time ``t`` (n,) [s] of ``y`` (n,) [the axis' unit], ``width`` [px]."""
    t, y = thinned(np.asarray(t, "f8"), np.asarray(y, "f8"), most)
    times = [round(float(one), 3) for one in t]
    look = {"color": colour, "width": width, **more.pop("line", {})}
    return {
        "type": "scatter", "mode": "lines", "name": name, "x": times, "y": rounded(y),
        "line": look, **more,
    }  # fmt: skip


def mark(name: str, x: float, y: float, colour: str, text: str) -> Trace:
    """A point at ``x`` and ``y`` [units of the axes], exactly, with what is said at it."""
    return {
        "type": "scatter", "mode": "markers", "name": name, "x": [x], "y": [y],
        "marker": {"color": colour, "size": 9, "symbol": "circle-open", "line": {"width": 2}},
        "hovertext": [text],
    }  # fmt: skip


def spread(
    name: str, t: Array, y: Array, parts: Sequence[tuple[str, str]], pieces: int = 600
) -> list[Trace]:
    """Several quantities ``y`` (n, k) [the axis' unit] as one band and a mean line each.

    The band holds every sample at ``t`` (n,) [s]: from the least to the most of all of them in each
    of ``pieces`` of equal length. Each line is hidden at first, with its extremes, as it is.
    """
    t, y = np.asarray(t, "f8"), np.asarray(y, "f8")
    cuts = np.unique(np.linspace(0, len(t), min(pieces, len(t)) + 1).astype(int))
    if len(cuts) < 2:
        return []
    begins = cuts[:-1]
    middle = 0.5 * (t[begins] + t[cuts[1:] - 1])
    low = np.minimum.reduceat(y.min(axis=1), begins)
    high = np.maximum.reduceat(y.max(axis=1), begins)
    means = np.add.reduceat(y, begins, axis=0) / np.diff(cuts)[:, None]
    edge = {"width": 0}
    traces = [
        line(f"{name}, least", middle, low, _BAND, most=pieces, line=edge, showlegend=False),
        line(f"{name}, least to most", middle, high, _BAND, most=pieces, line=edge,
             fill="tonexty", fillcolor=_BAND),
    ]  # fmt: skip
    for k, (part, colour) in enumerate(parts):
        traces.append(line(f"{part}, mean", middle, means[:, k], colour, most=pieces, width=1.4))
    for k, (part, colour) in enumerate(parts):
        traces.append(line(part, t, y[:, k], colour, width=0.8, visible="legendonly"))
    return traces


def over_time(
    name: str,
    title: str,
    note: str,
    rows: Sequence[Row],
    marks: Iterable[tuple[float, str]] = (),
    span: tuple[float, float] | None = None,
) -> Chart:
    """Rows over one axis of time, with a line at each of ``marks`` (time [s], its number).

    Each row has a legend of its own above it; the numbers stand above the first row, where no line
    and no legend is.
    """
    drawn_px = _ROW_PX * len(rows) + _LEGEND_PX * (len(rows) - 1)
    layout: dict[str, Any] = {
        "height": drawn_px + _MARGIN["t"] + _MARGIN["b"],
        "margin": dict(_MARGIN),
        "xaxis": {"title": {"text": "time since the start [s]"}, "anchor": f"y{_n(len(rows))}"},
        "shapes": [],
        "annotations": [],
        "hovermode": "x unified" if len(rows) == 1 else "x",
    }
    if span is not None:
        layout["xaxis"]["range"] = list(span)
    data = []
    for k, row in enumerate(rows, start=1):
        top = 1.0 - (k - 1) * (_ROW_PX + _LEGEND_PX) / drawn_px
        bottom = top - _ROW_PX / drawn_px
        axis: dict[str, Any] = {"title": {"text": row.unit}, "domain": [max(bottom, 0.0), top]}
        if row.span is not None:
            axis["range"] = list(row.span)
        layout[f"yaxis{_n(k)}"] = axis
        above = top + (_EVENTS_PX / drawn_px if k == 1 else 0.0)
        layout[f"legend{_n(k)}"] = {"y": above, **_LEGEND}
        data += [{**one, "yaxis": f"y{_n(k)}", "legend": f"legend{_n(k)}"} for one in row.traces]
        layout["shapes"] += [_across(limit, f"y{_n(k)}") for limit in row.limits]
    for t, number in marks:
        layout["shapes"].append({**_upright(t, _OF_EVENTS), "layer": "below"})
        layout["annotations"].append(_number(t, number))
    return Chart(name, title, note, data, layout)


def _n(k: int) -> str:
    return "" if k == 1 else str(k)


_OF_LIMITS: Final = {"color": LIMIT, "width": 1, "dash": "dash"}


def _across(value: float, axis: str) -> dict[str, Any]:
    return {
        "type": "line", "xref": "paper", "x0": 0, "x1": 1, "yref": axis, "y0": value, "y1": value,
        "line": _OF_LIMITS,
    }  # fmt: skip


def _upright(x: float, look: dict[str, Any]) -> dict[str, Any]:
    return {
        "type": "line", "yref": "paper", "y0": 0, "y1": 1, "x0": x, "x1": x, "line": look,
    }  # fmt: skip


def upright_limit(x: float) -> dict[str, Any]:
    """A limit at ``x`` [the axis' unit], from the bottom to the top."""
    return _upright(x, _OF_LIMITS)


_LEGEND: Final = {
    "orientation": "h", "yanchor": "bottom", "x": 0, "xanchor": "left", "font": {"size": 11},
}  # fmt: skip


def _number(t: float, text: str) -> dict[str, Any]:
    return {
        "x": t, "yref": "paper", "y": 1, "yanchor": "bottom", "text": text, "showarrow": False,
        "font": {"size": 9, "color": "#57606a"},
    }  # fmt: skip
