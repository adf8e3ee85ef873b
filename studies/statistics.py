"""How sure a count of passed flights makes one."""

from __future__ import annotations

import math

_Z95 = 1.959963984540054  # two-sided 95 %


def wilson(passed: int, total: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a probability of which a sample was seen.

    Unlike the normal approximation it says something sensible at 0 and at all of them: 20 of
    20 leave a lower bound of 0.84.

    Raises:
        ValueError: No trial, or more successes than trials.
    """
    if not 0 <= passed <= total or total == 0:
        raise ValueError(f"{passed} of {total} is not a valid count of successes")
    z2 = _Z95 * _Z95
    share = passed / total
    middle = (share + 0.5 * z2 / total) / (1.0 + z2 / total)
    spread = math.sqrt(share * (1.0 - share) / total + 0.25 * z2 / (total * total))
    half = _Z95 * spread / (1.0 + z2 / total)
    return max(middle - half, 0.0), min(middle + half, 1.0)
