"""Single-precision numbers, which is what parameters are on the wire.

The decimal nearest to a REAL32 is the number everybody means: 0.1 is sent as
0.100000001490116, and comes back as 0.1, so that file, wire and flight agree.
"""

from __future__ import annotations

import numpy as np


def nearest_decimal(value: float) -> float:
    """The shortest decimal with the REAL32 of ``value`` [any unit]; NaN and infinity stay."""
    with np.errstate(over="ignore"):
        return float(str(np.float32(value)))


def as_text(value: float) -> str:
    """``value`` [any unit] as text, without an exponent where that is short."""
    if isinstance(value, int):
        return str(value)
    return f"{nearest_decimal(value):.9g}"
