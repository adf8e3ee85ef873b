"""Exact bounds of a probability from counted flights (Clopper and Pearson, 1934).

They hold for any number of independent flights with one probability each, at least as often as the
confidence says; no approximation is in them, and nothing is assumed about what was not seen.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, log, log1p

from scipy.special import betaincinv


@dataclass(frozen=True, slots=True)
class Bounds:
    """What ``count`` of ``total`` says about a probability, at a confidence [1]."""

    count: int
    total: int
    confidence: float
    upper: float  # one-sided: the probability is at most this, at this confidence
    lower: float  # one-sided: at least this, at this confidence
    interval: tuple[float, float]  # two-sided: within, at this confidence


def bounds(count: int, total: int, confidence: float) -> Bounds:
    """The bounds of a probability after ``count`` of ``total``, at a ``confidence`` [1].

    Source: Clopper, Pearson: The use of confidence or fiducial limits illustrated in the case of
    the binomial, Biometrika 26, 1934; docs/equations.md.

    Raises:
        ValueError: No flight, more than all of them, or a confidence that is not within 0 to 1.
    """
    if not 0 <= count <= total or total < 1:
        raise ValueError(f"{count} of {total} is no count")
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence = {confidence:g}: must be between 0 and 1")
    beyond = 1.0 - confidence
    return Bounds(
        count=count,
        total=total,
        confidence=confidence,
        upper=upper(count, total, beyond),
        lower=lower(count, total, beyond),
        interval=(lower(count, total, 0.5 * beyond), upper(count, total, 0.5 * beyond)),
    )


def upper(count: int, total: int, beyond: float) -> float:
    """Probability [1] at which ``count`` or fewer of ``total`` have the share ``beyond`` [1]."""
    return 1.0 if count == total else float(betaincinv(count + 1, total - count, 1.0 - beyond))


def lower(count: int, total: int, beyond: float) -> float:
    """Probability [1] at which ``count`` or more of ``total`` have the share ``beyond`` [1]."""
    return 0.0 if count == 0 else float(betaincinv(count, total - count + 1, beyond))


def flights_for(probability: float, confidence: float) -> int:
    """How many flights without a violation show a ``probability`` [1] at a ``confidence`` [1]."""
    return ceil(log(1.0 - confidence) / log1p(-probability))
