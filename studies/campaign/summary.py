"""A campaign in numbers: as it goes on, and of each configuration when it is over."""

from __future__ import annotations

import heapq
import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from studies.campaign.flight import CampaignRow

WORST: Final = 10  # flights that are named
_SHARES: Final = (0.0, 0.01, 0.05, 0.5, 0.95, 0.99, 1.0)


@dataclass
class Progress:
    """What is known while flights come in."""

    total: int
    done: int = 0
    violated: int = 0  # the safe set was left, or something was touched
    unflown: int = 0  # broken, or refused by the vehicle
    worst_m: float = math.inf
    _fresh: int = 0  # flown by this run
    _began_s: float = field(default_factory=time.monotonic)

    def add(self, row: CampaignRow, *, fresh: bool) -> None:
        """Take in a row that was flown now, or one of the journal."""
        self.done += 1
        self.unflown += row.error or row.refused
        self.violated += row.violated
        if row.margin_m is not None:
            self.worst_m = min(self.worst_m, row.margin_m)
        if fresh:
            if self._fresh == 0:
                self._began_s = time.monotonic()  # after the workers have started
            self._fresh += 1

    @property
    def flights_a_second(self) -> float:
        """Since the first of this run; 0 before the second."""
        took_s = time.monotonic() - self._began_s
        return (self._fresh - 1) / took_s if self._fresh > 1 and took_s > 0.0 else 0.0

    def __str__(self) -> str:
        parts = [f"{self.done} of {self.total}"]
        rate = self.flights_a_second
        if rate > 0.0:
            left_s = round((self.total - self.done) / rate)
            parts += [f"{rate:.2g} flights/s", f"{_clock(left_s)} left"]
        parts.append(f"{self.violated} violations")
        if self.unflown:
            parts.append(f"{self.unflown} not flown")
        if math.isfinite(self.worst_m):
            parts.append(f"worst margin {1e3 * self.worst_m:+.1f} mm")
        return ", ".join(parts)


@dataclass(frozen=True, slots=True)
class CaseSummary:
    """The flights of one configuration."""

    scenario: str
    suite: str
    controller: str
    fault: str
    flights: int
    completed: int
    violated: int
    contacts: int
    refused: int
    errors: int
    margin_m: dict[str, float]  # by share of the flights
    te_m: dict[str, float]


def summaries(rows: Sequence[CampaignRow]) -> list[CaseSummary]:
    """One a configuration, in the order in which they are flown first."""
    found: dict[tuple[str, str, str, str], list[CampaignRow]] = {}
    for row in rows:
        found.setdefault((row.scenario, row.suite, row.controller, row.fault), []).append(row)
    return [_case(*names, of) for names, of in found.items()]


def _case(
    scenario: str, suite: str, controller: str, fault: str, rows: list[CampaignRow]
) -> CaseSummary:
    return CaseSummary(
        scenario=scenario,
        suite=suite,
        controller=controller,
        fault=fault,
        flights=len(rows),
        completed=sum(row.completed for row in rows),
        violated=sum(row.violated for row in rows),
        contacts=sum(row.contact for row in rows),
        refused=sum(row.refused for row in rows),
        errors=sum(row.error for row in rows),
        margin_m=_quantiles(row.margin_m for row in rows),
        te_m=_quantiles(row.te_m for row in rows),
    )


def _quantiles(values: Iterable[float | None]) -> dict[str, float]:
    there = [value for value in values if value is not None]
    if not there:
        return {}
    return {
        f"{share:g}": float(value)
        for share, value in zip(_SHARES, np.quantile(there, _SHARES), strict=True)
    }


def verdict(rows: Sequence[CampaignRow], asked: int) -> tuple[bool, str]:
    """Whether all flights that were asked for were flown and completed, and a sentence."""
    counts = (
        (asked - len(rows), "missing"),
        (sum(row.error for row in rows), "broke"),
        (sum(row.refused for row in rows), "refused by the vehicle"),
        (sum(row.violated for row in rows), "with a violation"),
        (
            sum(not (row.completed or row.violated or row.error or row.refused) for row in rows),
            "not completed",
        ),
    )
    wrong = [f"{count} {what}" for count, what in counts if count]
    if not wrong:
        return True, f"{len(rows)} of {asked} flights completed without a violation"
    first = worst([row for row in rows if not row.completed], 1)
    named = f"; worst: flight {first[0].flight}, {first[0].reason}" if first else ""
    return False, f"of {asked} flights {', '.join(wrong)}{named}"


def worst(rows: Sequence[CampaignRow], count: int = WORST) -> list[CampaignRow]:
    """Flights that broke, those that touched something, then the least margins."""

    def rank(row: CampaignRow) -> tuple[int, float, int]:
        first = 0 if row.error else 1 if row.contact else 2
        return first, math.inf if row.margin_m is None else row.margin_m, row.flight

    return heapq.nsmallest(count, rows, key=rank)


def _clock(seconds: int) -> str:
    minutes, seconds = divmod(seconds, 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{seconds:02}"
