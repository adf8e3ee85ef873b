"""Which colour stands for what."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Rgb = tuple[int, int, int]

RED: Final[Rgb] = (207, 34, 46)
ORANGE: Final[Rgb] = (230, 126, 16)
YELLOW: Final[Rgb] = (222, 178, 24)
GREEN: Final[Rgb] = (26, 152, 80)
BLUE: Final[Rgb] = (9, 105, 218)
CYAN: Final[Rgb] = (0, 160, 190)
GREY: Final[Rgb] = (130, 138, 147)
DARK: Final[Rgb] = (52, 58, 66)
VIOLET: Final[Rgb] = (130, 80, 223)

# Margin [m] and the colour from there on; below the first it is red.
_SCALE: Final = ((0.0, RED), (0.05, ORANGE), (0.15, YELLOW), (0.4, GREEN))


def of_margin(margin: float) -> Rgb:
    """Red at a ``margin`` [m] of 0 and below, green from 0.4 m on, grey where it is unknown."""
    r, g, b = of_margins(np.array([margin]))[0].tolist()
    return r, g, b


def of_margins(margins: NDArray[Any]) -> NDArray[np.uint8]:
    """The same of ``margins`` (n,) [m]; (n, 3)."""
    places = [place for place, _ in _SCALE]
    known = np.where(np.isfinite(margins), margins, 0.0)
    mixed = [np.interp(known, places, [c[k] for _, c in _SCALE]) for k in range(3)]
    colours = np.stack(mixed, axis=1)
    colours[~np.isfinite(margins)] = GREY
    return colours.astype(np.uint8)


def css(colour: Rgb) -> str:
    """As a style sheet has it."""
    return "#{:02x}{:02x}{:02x}".format(*colour)


def millimetres(margin: float) -> str:
    """A ``margin`` [m] as it is read: one digit, as ``pandion fly`` prints it."""
    return f"{1e3 * margin:.1f} mm" if math.isfinite(margin) else "–"
