"""How every figure is written."""

from __future__ import annotations

from pathlib import Path

from matplotlib import pyplot as plt
from matplotlib.figure import Figure


def save(figure: Figure, target: Path) -> None:
    """Write SVG without a date, so that an unchanged drawing is an unchanged file."""
    figure.savefig(target, metadata={"Date": None, "Creator": None}, facecolor="white")
    plt.close(figure)
