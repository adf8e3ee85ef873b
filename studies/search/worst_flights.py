"""The search for the flight with the minimum margin, within the bounds of a campaign file.

CMA-ES moves the values that the file varies and the tables of its uniform disturbances, all within
their bounds, generation by generation through a campaign. A search that no longer moves begins
again elsewhere; the best flight of each beginning is a find.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np
from cmaes import CMA, SepCMA

from studies.campaign.campaign import Campaign
from studies.campaign.flight_space import FlightSpace
from studies.campaign.keys import CampaignError
from studies.flight.job import Job, Outcome

Array: TypeAlias = np.ndarray[Any, np.dtype[np.float64]]
Report: TypeAlias = Callable[[int, float], None]  # flights so far, minimum margin [m]

_MAX_CORRELATED: Final = 60  # numbers; above, their correlations would cost more than they tell
_FIRST_STEP: Final = 0.5  # of half a range
_TOUCHED_M: Final = 1.0  # a contact counts so much more: where it ended says little of how bad
_UNFLOWN: Final = 1e3
_SWINGS_HZ: Final = (0.3, 1.2)  # of the disturbances that a search begins with
_STALLED: Final = 25  # generations without a better flight


@dataclass(frozen=True, slots=True, kw_only=True)
class Find:
    """The worst flight of one search."""

    flights: FlightSpace
    job: Job
    outcome: Outcome
    values: dict[str, float]  # by key
    searched: int  # flights of this search

    @property
    def margin_m(self) -> float:
        """Its minimum margin."""
        return math.inf if self.outcome.margin_m is None else self.outcome.margin_m

    @property
    def violates(self) -> bool:
        """Whether the safe set was left or something was touched."""
        return self.outcome.contact or not self.margin_m >= 0.0


@dataclass(frozen=True, slots=True)
class Searched:
    """What all searches found, worst first."""

    finds: tuple[Find, ...]
    flights: int
    broken: int  # that could not be flown, such as one that starts outside the safe set
    why: str  # of one of these


def search(
    cases: Sequence[FlightSpace],
    campaign: Campaign[Outcome],
    evaluations: int,
    seed: int,
    *,
    together: int = 1,
    report: Report = lambda _, __: None,
) -> Searched:
    """Fly about ``evaluations`` flights, as many of each case; at least ``together`` at a time.

    Raises:
        CampaignError: Nothing can be searched, a case would get no flight, or the flights have no
            margin.
    """
    for case in cases:
        if not case.values + case.entries:
            raise CampaignError(
                f"{case.case}: nothing to search; vary something, or take a scenario with a "
                "uniform disturbance"
            )
    if evaluations < len(cases):
        raise CampaignError(
            f"{evaluations} flights are fewer than the {len(cases)} combinations of scenario, "
            "suite, controller and fault that are named: each is searched; fly more or name fewer"
        )
    hunt = _Hunt(campaign, report)
    for k, case in enumerate(cases):
        budget = evaluations // len(cases) + (k < evaluations % len(cases))
        roots = np.random.SeedSequence(seed, spawn_key=(k,))
        left = budget
        while left == budget or left >= _generation(case, together):
            random = np.random.default_rng(roots.spawn(1)[0])
            left -= hunt.once(case, left, random, together)
    finds = sorted(hunt.finds, key=lambda find: _badness(find.outcome))
    return Searched(tuple(finds), hunt.flown, hunt.broken, hunt.why)


class _Hunt:
    """What is kept from one search to the next."""

    def __init__(self, campaign: Campaign[Outcome], report: Report) -> None:
        self.finds: list[Find] = []
        self.flown = self.broken = 0
        self.why = ""
        self._campaign = campaign
        self._report = report
        self._least = math.inf

    def once(
        self, flights: FlightSpace, budget: int, random: np.random.Generator, together: int
    ) -> int:
        """One search; how many flights it took."""
        optimiser = _optimiser(flights, random, together)
        size, spent, stalled = optimiser.population_size, 0, 0
        best: tuple[float, Array, Job, Outcome] | None = None
        while spent < budget and stalled < _STALLED and not optimiser.should_stop():
            points = [optimiser.ask() for _ in range(size)]
            jobs = [_job(flights, point) for point in points]
            rows = self._campaign.run(jobs)
            costs = [self._cost(row) for row in rows]
            optimiser.tell(list(zip(points, costs, strict=True)))
            spent += size
            k = int(np.argmin(costs))
            stalled += 1
            if best is None or costs[k] < best[0]:
                best, stalled = (costs[k], points[k], jobs[k], rows[k]), 0
            self._report(self.flown, self._least)
        if best is not None and best[0] < _UNFLOWN:
            _, point, job, row = best
            values = flights.named(_shares(flights, point))
            self.finds.append(
                Find(flights=flights, job=job, outcome=row, values=values, searched=spent)
            )
        return spent

    def _cost(self, row: Outcome) -> float:
        self.flown += 1
        if row.error:
            self.broken += 1
            self.why = row.reason
        elif row.margin_m is None:
            raise CampaignError("the flights have no zones, so they have no margin to search for")
        else:
            self._least = min(self._least, row.margin_m)
        return _badness(row)


def _badness(row: Outcome) -> float:
    """What is minimised [m]; a flight that could not be flown is no find."""
    if row.error or row.margin_m is None:
        return _UNFLOWN
    margin = row.margin_m if math.isfinite(row.margin_m) else -_TOUCHED_M
    return margin - (_TOUCHED_M if row.contact else 0.0)


def _optimiser(flights: FlightSpace, random: np.random.Generator, together: int) -> CMA | SepCMA:
    """At a random place of the values, with swings as disturbances."""
    mean = np.concatenate([random.uniform(-0.8, 0.8, flights.values), *(_swing(flights, random))])
    seed = int(random.integers(2**31))
    more: dict[str, Any] = {"seed": seed, "population_size": _generation(flights, together)}
    if len(mean) > _MAX_CORRELATED:
        return SepCMA(mean, _FIRST_STEP, **more)
    if not flights.entries:
        more["bounds"] = np.tile((-1.0, 1.0), (len(mean), 1))
    return CMA(mean, _FIRST_STEP, **more)  # tables are cut off: the worst pushes are full ones


def _generation(flights: FlightSpace, together: int) -> int:
    """Flights of a generation: as CMA-ES has them, or more if more can be flown at once."""
    return max(4 + int(3.0 * math.log(flights.values + flights.entries)), together)


def _swing(flights: FlightSpace, random: np.random.Generator) -> list[Array]:
    """Full pushes that change sides, on each axis of each disturbance."""
    found = []
    for one in flights.pushes:
        times = one.period_s * np.arange(one.rows)
        phase = 2.0 * np.pi * (random.uniform(*_SWINGS_HZ) * times + random.random())
        sides = np.where(np.sin(phase) >= 0.0, 1.0, -1.0)
        found.append((sides[:, None] * random.choice((-1.0, 1.0), 3)).ravel())
    return found


def _job(flights: FlightSpace, point: Array) -> Job:
    return flights.job(_shares(flights, point), np.clip(point[flights.values :], -1.0, 1.0))


def _shares(flights: FlightSpace, point: Array) -> Array:
    shares: Array = np.clip(0.5 + 0.5 * point[: flights.values], 0.0, 1.0)
    return shares
