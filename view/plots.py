"""Curves over time, by uPlot."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
import viser
from numpy.typing import NDArray

from view.colours import BLUE, CYAN, GREEN, GREY, ORANGE, RED, VIOLET, css
from view.flight import Curve

Array = NDArray[Any]

_INKS: Final = (BLUE, ORANGE, GREEN, VIOLET, CYAN, GREY, RED)
_WIDEST_MARGIN: Final = 0.6  # m; what is larger is no concern


class Plot:
    """One curve with its limits, and with what is over shaded."""

    def __init__(
        self, gui: viser.GuiApi, curve: Curve, begin: float, height: int, *, legend: bool = True
    ) -> None:
        """Draw a ``curve`` ``height`` pixels high; its times count from ``begin`` [s]."""
        self._curve, self._begin = curve, begin
        self._low, self._high = _range(curve)
        series: list[Any] = [{"label": "s"}]
        for name, ink in zip(curve.names, _INKS * 3, strict=False):
            series.append({"label": name, "stroke": css(ink), "width": 1.3, "points": _NO_POINTS})
        for limit in curve.limits:
            label = f"limit {limit:.3g}"
            line = {"label": label, "stroke": css(RED), "width": 1.0, "dash": (5, 4)}
            series.append({**line, "points": _NO_POINTS})
        shade = {"label": "now", "stroke": "rgba(9,105,218,0.55)", "fill": "rgba(9,105,218,0.07)"}
        series.append({**shade, "width": 1.0, "points": _NO_POINTS})
        self._plot = gui.add_uplot(
            self._data(curve, begin),
            series=tuple(series),
            title=curve.title,
            scales={
                "x": {"time": False},
                "y": {"auto": False, "range": (self._low, self._high)},
            },
            axes=({"size": 26}, {"size": 46}),
            legend={"show": legend},
            height=height,
        )

    def point_to(self, t: float) -> None:
        """Shade what lies before ``t`` [s, sensor time]."""
        self._plot.data = self._data(self._curve, t)

    def replace(self, curve: Curve) -> None:
        """Draw other values of the same curves."""
        self._curve = curve
        self._plot.data = self._data(curve, math.inf)

    def _data(self, curve: Curve, t: float) -> tuple[Array, ...]:
        limits = [np.full(len(curve.t), limit) for limit in curve.limits]
        shade = np.where(curve.t <= t, self._high, self._low)
        return (curve.t - self._begin, *curve.rows, *limits, shade)


_NO_POINTS: Final = {"show": False}


def _range(curve: Curve) -> tuple[float, float]:
    """Of the axis: all values and limits, unless they are far off."""
    known = np.concatenate([np.ravel(row) for row in (*curve.rows, np.array(curve.limits))])
    known = known[np.isfinite(known)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    if curve.title.startswith("margin"):
        low, high = min(low, 0.0), min(max(high, 0.1), _WIDEST_MARGIN)
    room = 0.06 * max(high - low, 1e-6)
    return low - room, high + room
