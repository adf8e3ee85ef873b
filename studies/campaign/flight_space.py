"""The random numbers of a flight as the coordinates of a space, for those that search or split it.

What a campaign file lets the seed decide about a uniform disturbance becomes a table of numbers,
each of which can be changed a little; so do the values that the file varies. Noise of sensors,
gusts and pushes at random times stay the seed's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence as Several
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from command_line.ranges import Range
from sitl.scenario import Sequence, Uniform
from sitl.simulation import STEP_US
from studies.campaign.keys import CampaignError, Flown, applied, range_of, rounded
from studies.campaign.plan import CampaignPlan, Case, Varied
from studies.flight.job import Job

Array: TypeAlias = np.ndarray[Any, np.dtype[np.float64]]

_STEP_S = 1e-6 * STEP_US


@dataclass(frozen=True, slots=True)
class Pushes:
    """A uniform disturbance as a table."""

    item: Uniform
    rows: int  # of three accelerations

    @property
    def period_s(self) -> float:
        """How long a row holds: a whole number of the simulator's steps."""
        return round(self.item.period_s / _STEP_S) * _STEP_S

    def played(self, table: Array) -> Sequence:
        """The disturbance of a ``table`` (rows, 3) of shares of the amplitude [1], NED."""
        values = (self.item.amplitude_m_s2 * table.reshape(self.rows, 3)).tolist()
        pushes = tuple((float(x), float(y), float(z)) for x, y, z in values)
        return Sequence(pushes, period_s=self.period_s, name=self.item.name)


@dataclass(frozen=True, slots=True)
class FlightSpace:
    """The flights of one case of a campaign file."""

    case: Case
    flown: Flown
    varied: tuple[Varied, ...]
    ranges: tuple[Range, ...]  # of their keys
    pushes: tuple[Pushes, ...]
    seed: int  # of what is not in the coordinates, unless another is given

    @property
    def values(self) -> int:
        """How many values the file varies."""
        return len(self.varied)

    @property
    def entries(self) -> int:
        """How many numbers the tables of disturbances have."""
        return sum(3 * one.rows for one in self.pushes)

    @property
    def seeded(self) -> bool:
        """Whether the seed still decides something."""
        middle, still = np.full(self.values, 0.5), np.zeros(self.entries)
        return self.job(middle, still).random

    def job(self, shares: Array, table: Array, seed: int | None = None) -> Job:
        """The flight at ``shares`` (values,) [1] of distributions and a ``table`` (entries,) [1].

        The table has shares of the disturbances' amplitudes, from -1 to 1.
        """
        changed = applied(self.flown, self.named(shares).items())
        scenario = changed.scenario
        ends = np.cumsum([3 * one.rows for one in self.pushes])[:-1]
        parts = np.split(table, ends) if self.pushes else []
        played = {
            one.item.name: one.played(part) for one, part in zip(self.pushes, parts, strict=True)
        }
        items = tuple(played.get(item.name, item) for item in scenario.disturbances)
        scenario = replace(scenario, disturbances=items)
        return Job("full", scenario, changed.config, self.seed if seed is None else seed)

    def named(self, shares: Array) -> dict[str, float]:
        """The values at ``shares`` (values,) of the distributions [1], by key."""
        return {
            one.key: rounded(one.key, one.distribution.at(float(x)), allowed)
            for one, allowed, x in zip(self.varied, self.ranges, shares, strict=True)
        }


def spaces(plan: CampaignPlan) -> tuple[FlightSpace, ...]:
    """The space of each case of a plan.

    Raises:
        CampaignError: A disturbance that the file varies as well, or a flight without end.
    """
    return tuple(
        FlightSpace(
            case=case,
            flown=base,
            varied=plan.varied,
            ranges=tuple(range_of(one.key, base) for one in plan.varied),
            pushes=_pushes(base, plan.varied),
            seed=plan.draw(k).seed,
        )
        for k, (case, base) in enumerate(zip(plan.cases, plan.bases, strict=True))
    )


def _pushes(base: Flown, varied: Several[Varied]) -> tuple[Pushes, ...]:
    found = []
    for i, item in enumerate(base.scenario.disturbances):
        if not isinstance(item, Uniform):
            continue
        if any(one.key.startswith(f"disturbances.{i}.") for one in varied):
            raise CampaignError(
                f"vary.disturbances.{i}: the values of a uniform disturbance are searched one by "
                "one here; vary something else"
            )
        rows = math.ceil(base.scenario.duration_s / max(item.period_s, _STEP_S))
        found.append(Pushes(item, rows))
    return tuple(found)
