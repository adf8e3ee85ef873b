"""Two campaigns beside each other: what differs between the plans, and between the margins.

Flights with the same configuration, number, seed and varied values are the same flight, flown by
other code or with other settings. Where every flight of a configuration has such a partner, the
differences within pairs are compared, which sees much smaller changes than two means.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
from scipy.special import stdtrit

from command_line.bounded_toml import TomlError, toml_table
from studies.campaign.flight import CampaignRow
from studies.campaign.store import KeptRows
from studies.statistics.violations import ANY, violates

_FEWEST: Final = 2  # values that have a spread
_MAX_LINES: Final = 40  # of what differs between the plans
_MAX_KEY: Final = 200  # characters of a key there


@dataclass(frozen=True, slots=True)
class Difference:
    """Of one configuration, the second campaign less the first."""

    name: str
    flights: tuple[int, int]
    paired: bool  # each flight of one is a flight of the other
    least_margin_m: tuple[float | None, float | None]
    margin_m: float | None  # of the mean margins
    margin_interval_m: tuple[float, float] | None
    violations: tuple[int, int]
    violation_interval: tuple[float, float]  # of the difference of the probabilities [1]
    took_s: float  # processor time of the flights of both

    @property
    def worse(self) -> str:
        """What is shown to have become worse, in a sentence; empty if nothing is."""
        found = []
        if self.margin_interval_m is not None and self.margin_interval_m[1] < 0.0:
            found.append("margins are smaller")
        if self.violation_interval[0] > 0.0:
            found.append("violations are more frequent")
        return " and ".join(found)

    @property
    def better(self) -> str:
        """The same for what has become better."""
        found = []
        if self.margin_interval_m is not None and self.margin_interval_m[0] > 0.0:
            found.append("margins are larger")
        if self.violation_interval[1] < 0.0:
            found.append("violations are rarer")
        return " and ".join(found)

    def as_json(self) -> dict[str, Any]:
        """For a file."""
        return {**asdict(self), "worse": self.worse, "better": self.better}


def differences(first: KeptRows, second: KeptRows, confidence: float) -> list[Difference]:
    """One for each configuration that both have, with intervals at a ``confidence`` [1]."""
    ours, theirs = _of_cases(first), _of_cases(second)
    return [
        _difference(name, ours[name], theirs[name], confidence) for name in ours if name in theirs
    ]


def changes(first: KeptRows, second: KeptRows) -> list[str]:
    """What differs between two campaigns before anything was flown, a sentence each."""
    lines = [
        f"{what}: {one} -> {other}"
        for what, one, other in (
            ("version", first.facts.get("version"), second.facts.get("version")),
            ("code", first.digests.code[:12], second.digests.code[:12]),
            ("packages", first.digests.packages[:12], second.digests.packages[:12]),
            ("flights", len(first.rows), len(second.rows)),
        )
        if one != other
    ]
    lines += _of_files(first.file, second.file)
    ours, theirs = _of_cases(first), _of_cases(second)
    lines += [f"configuration {name}: only in the first" for name in ours if name not in theirs]
    lines += [f"configuration {name}: only in the second" for name in theirs if name not in ours]
    more = len(lines) - _MAX_LINES
    return lines if more <= 0 else [*lines[:_MAX_LINES], f"and {more} more"]


def _of_files(one: str, other: str) -> Iterator[str]:
    """Keys of two campaign files whose values differ."""
    try:
        first, second = (dict(_keys(toml_table(text))) for text in (one, other))
    except TomlError:
        if one != other:
            yield "campaign.toml: the files differ, and one of them cannot be read"
        return
    for key in [*first, *(key for key in second if key not in first)]:
        before, after = first.get(key, "nothing"), second.get(key, "nothing")
        if before != after:
            yield f"{'.'.join(key)[:_MAX_KEY]}: {before} -> {after}"


def _keys(table: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], str]]:
    if isinstance(table, dict):
        for key, part in table.items():
            yield from _keys(part, (*path, key))
    else:
        yield path, repr(table)


def _of_cases(kept: KeptRows) -> dict[str, list[CampaignRow]]:
    found: dict[str, list[CampaignRow]] = {}
    for row in kept.rows:
        name = ", ".join(x for x in (row.scenario, row.suite, row.controller, row.fault) if x)
        found.setdefault(name, []).append(row)
    return found


def _difference(
    name: str, ours: Sequence[CampaignRow], theirs: Sequence[CampaignRow], confidence: float
) -> Difference:
    counts = tuple(sum(violates(row, ANY) for row in rows) for rows in (ours, theirs))
    partner = {_flight(row): row for row in theirs}
    paired = len(ours) == len(theirs) and all(_flight(row) in partner for row in ours)
    one, other = _margins(ours), _margins(theirs)
    mean = interval = None
    if paired:
        both = [(row.margin_m, partner[_flight(row)].margin_m) for row in ours]
        steps = [b - a for a, b in both if a is not None and b is not None]
        mean, interval = _mean(np.array([x for x in steps if math.isfinite(x)]), confidence)
    elif min(len(one), len(other)) >= _FEWEST:
        mean, interval = _welch(one, other, confidence)
    return Difference(
        name=name,
        flights=(len(ours), len(theirs)),
        paired=paired,
        least_margin_m=(_least(one), _least(other)),
        margin_m=mean,
        margin_interval_m=interval,
        violations=(counts[0], counts[1]),
        violation_interval=newcombe((counts[0], len(ours)), (counts[1], len(theirs)), confidence),
        took_s=sum(row.took_s for row in (*ours, *theirs)),
    )


def _flight(row: CampaignRow) -> tuple[Any, ...]:
    return row.flight, row.seed, tuple(sorted(row.values.items()))


def _margins(rows: Sequence[CampaignRow]) -> np.ndarray[Any, Any]:
    margins = (row.margin_m for row in rows if row.margin_m is not None)
    return np.array([one for one in margins if math.isfinite(one)])


def _least(margins: np.ndarray[Any, Any]) -> float | None:
    return float(margins.min()) if len(margins) else None


def _mean(
    steps: np.ndarray[Any, Any], confidence: float
) -> tuple[float | None, tuple[float, float] | None]:
    """Mean of differences [m] and its interval by Student's law."""
    if not len(steps):
        return None, None
    if len(steps) < _FEWEST:
        return float(steps.mean()), None
    return mean_interval(steps, confidence)


def mean_interval(
    values: np.ndarray[Any, Any], confidence: float
) -> tuple[float, tuple[float, float]]:
    """Mean of ``values`` (n,) [any unit] and Student's interval at a ``confidence`` [1]."""
    mean, deviation = float(values.mean()), float(values.std(ddof=1))
    half = float(stdtrit(len(values) - 1, 0.5 + 0.5 * confidence)) * deviation
    half /= math.sqrt(len(values))
    return mean, (mean - half, mean + half)


def _welch(
    one: np.ndarray[Any, Any], other: np.ndarray[Any, Any], confidence: float
) -> tuple[float, tuple[float, float]]:
    """Difference of two means [m] with Welch's interval.

    Source: Welch: The generalization of "Student's" problem when several different population
    variances are involved, Biometrika 34, 1947.
    """
    mean = float(other.mean() - one.mean())
    parts = [float(x.var(ddof=1)) / len(x) for x in (one, other)]
    total = sum(parts)
    if total == 0.0:
        return mean, (mean, mean)
    freedom = total**2 / sum(
        part**2 / (len(x) - 1) for part, x in zip(parts, (one, other), strict=True)
    )
    half = float(stdtrit(freedom, 0.5 + 0.5 * confidence)) * math.sqrt(total)
    return mean, (mean - half, mean + half)


def newcombe(
    one: tuple[int, int], other: tuple[int, int], confidence: float
) -> tuple[float, float]:
    """Interval of the difference of two probabilities [1], at a ``confidence`` [1].

    Each is given as ``(count, total)``.

    Source: Newcombe: Interval estimation for the difference between independent proportions:
    comparison of eleven methods, Statistics in Medicine 17, 1998, method 10.
    """
    from scipy.stats import binomtest  # here: it takes a second to load

    p1, p2 = (count / total for count, total in (one, other))
    (low1, high1), (low2, high2) = (
        binomtest(*pair).proportion_ci(confidence, "wilson") for pair in (one, other)
    )
    step = p2 - p1
    return (
        step - math.hypot(p2 - low2, high1 - p1),
        step + math.hypot(high2 - p2, p1 - low1),
    )
