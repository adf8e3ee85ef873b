"""Drawings as SVG text. The only importer of matplotlib, which is loaded when first needed."""

from __future__ import annotations

import io
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

TARGET, BASE, END_EFFECTOR, BOUND = "#2da44e", "#0969da", "#e36209", "#8c959f"
WALL = "#cf222e"

_MAX_DRAWN: Final = 1e12  # of a number: bins of a range up to the largest double overflow

_METADATA = re.compile(r"\s*<metadata>.*?</metadata>", re.DOTALL)


class NoMatplotlibError(RuntimeError):
    """Figures were requested and matplotlib is not installed."""


@dataclass(frozen=True, slots=True)
class Sheet:
    """A canvas and its axes, row by row."""

    canvas: Canvas
    axes: list[list[Axes]]

    def svg(self) -> str:
        """The drawing; equal drawings give equal text."""
        import matplotlib as mpl

        text = io.StringIO()
        # Without a salt and with a date, two equal runs would differ.
        with mpl.rc_context({"svg.hashsalt": "pandion", "svg.fonttype": "none"}):
            self.canvas.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
        return _METADATA.sub("", text.getvalue())


def drawable(values: Iterable[float]) -> list[float]:
    """The values that a histogram can show: a flight that diverged leaves NaN, or any size."""
    return [value for value in values if abs(value) <= _MAX_DRAWN]


def sheet(rows: int, columns: int, width: float, height: float, **options: Any) -> Sheet:
    """An empty sheet of axes, ``width`` [inch] by ``height`` [inch].

    The options are those of ``Figure.subplots``, such as ``sharex``.

    Raises:
        NoMatplotlibError: With the sentence that says how to get it.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise NoMatplotlibError(
            "figures need matplotlib: pip install matplotlib, or ask for a table"
        ) from error
    canvas = Figure(figsize=(width, height), layout="constrained")
    axes = canvas.subplots(rows, columns, squeeze=False, **options)
    for ax in axes.flat:
        ax.grid(visible=True, linewidth=0.4, alpha=0.5)
        ax.tick_params(labelsize=8)
    return Sheet(canvas, [list(row) for row in axes])
