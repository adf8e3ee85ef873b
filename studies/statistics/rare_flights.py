"""How rare it is that a flight's minimum margin falls below a threshold, by splitting.

The space of :mod:`studies.statistics.splitting` drives the flights of one case of a campaign file:
a value that the file varies is where a normal number lies in its distribution, an entry of a
disturbance's table likewise. The seed of what is left, such as the noise of sensors, has no
neighbourhood: it is kept or drawn anew.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from scipy.special import ndtr

from studies.campaign.campaign import Campaign
from studies.campaign.flight_space import FlightSpace, spaces
from studies.campaign.keys import CampaignError
from studies.campaign.plan import CampaignPlan
from studies.flight.job import Job, Outcome
from studies.statistics.splitting import Estimate, Space

Array: TypeAlias = np.ndarray[Any, np.dtype[np.float64]]

_SEEDS = float(1 << 53)
# Of a row that could not be flown, or of a flight that diverged: nothing clears it.
_BELOW_ALL = -1e3  # m


@dataclass
class FlightScore:
    """The minimum margin [m] above the threshold of each flight that points stand for."""

    flights: FlightSpace
    campaign: Campaign[Outcome]
    threshold_m: float
    broken: list[str] = field(default_factory=list)  # why flights could not be flown
    _seeded: bool = field(init=False)

    def __post_init__(self) -> None:
        self._seeded = self.flights.seeded

    @property
    def space(self) -> Space:
        """What a point consists of.

        Raises:
            CampaignError: Nothing is random.
        """
        own = self.flights.values + self.flights.entries
        if not own and not self._seeded:
            raise CampaignError("nothing is random in these flights, so nothing can be rare")
        return Space(dimension=own + self._seeded, redrawn=int(self._seeded))

    def job(self, point: Array) -> Job:
        """The flight of a ``point`` (dimension,) [standard normal]."""
        values, entries = self.flights.values, self.flights.entries
        shares = ndtr(point)
        seed = int(shares[-1] * _SEEDS) if self._seeded else None
        return self.flights.job(
            shares[:values], 2.0 * shares[values : values + entries] - 1.0, seed
        )

    def __call__(self, points: Array) -> Array:
        """Scores (n,) [m] of ``points`` (n, dimension) [standard normal]."""
        rows = self.campaign.run([self.job(point) for point in points])
        return np.array([self._score(row) for row in rows])

    def _score(self, row: Outcome) -> float:
        if row.error:
            self.broken.append(row.reason)
            return _BELOW_ALL
        if row.margin_m is None:
            raise CampaignError("the flights have no zones, so they have no margin to fall below")
        return row.margin_m - self.threshold_m if row.margin_m == row.margin_m else _BELOW_ALL


def only_case(plan: CampaignPlan) -> FlightSpace:
    """The flights of a plan that has one case.

    Raises:
        CampaignError: It has several.
    """
    if len(plan.cases) > 1:
        raise CampaignError(
            f"{len(plan.cases)} combinations of scenario, suite, controller and fault are named: "
            "one probability is of one; name one of each"
        )
    return spaces(plan)[0]


def sentences(found: Estimate, score: FlightScore) -> Iterator[str]:
    """What was found, line by line."""
    count, threshold = len(found.runs), f"{1e3 * score.threshold_m:g} mm"
    low, high = found.interval
    share = f"{100.0 * found.confidence:.6g} %"
    if found.reached < count:
        runs = "no run" if not found.reached else f"only {found.reached} of {count} runs"
        yield (
            f"{runs} reached a minimum margin below {threshold}, so there is no interval; smallest "
            f"{1e3 * (min(run.least for run in found.runs) + score.threshold_m):+.1f} mm "
            f"after {found.evaluations} flights"
        )
        yield from sorted({run.stuck for run in found.runs if run.stuck})
    else:
        yield (
            f"probability of a minimum margin below {threshold} in a flight: "
            f"{found.probability:.3g}, {share} interval {low:.3g} to {high:.3g} (two-sided), from "
            f"{count} runs, {found.evaluations} flights"
        )
    runs = ", ".join(f"{run.probability:.2g}" for run in found.runs)
    yield f"runs: {runs}"
    if found.exact:
        yield "it is not rare: these are counted flights and the interval is exact"
    elif found.reached == count:
        yield (
            f"ln p of a run scatters by {found.deviation:.2f}; were its flights independent it "
            f"would be {found.as_if_independent:.2f}: they are chains, and only the scatter of the "
            "runs makes the interval"
        )
        yield (
            "the interval takes the runs as lognormal and cannot know of an event that no run came "
            "near; the proof of an upper bound is counted flights (pandion certify)"
        )
    if score.broken:
        yield (
            f"{len(score.broken)} flights could not be flown and count as below: {score.broken[0]}"
        )


def as_json(found: Estimate, score: FlightScore) -> dict[str, Any]:
    """The same for programs."""
    return {
        "threshold_m": score.threshold_m,
        "probability": found.probability if found.reached == len(found.runs) else None,
        "interval": list(found.interval),
        "confidence": found.confidence,
        "exact": found.exact,
        "flights": found.evaluations,
        "not_flown": len(score.broken),
        "deviation": found.deviation,
        "deviation_if_independent": found.as_if_independent,
        "runs": [
            {
                "probability": run.probability,
                "flights": run.evaluations,
                "min_margin_m": run.least + score.threshold_m,
                "stuck": run.stuck,
                "levels": [
                    {
                        "margin_m": level.score + score.threshold_m,
                        "share": level.share,
                        "accepted": level.accepted,
                        "step": level.step,
                    }
                    for level in run.levels
                ],
            }
            for run in found.runs
        ],
    }
