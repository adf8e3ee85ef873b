"""Settings and results of a study."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from fsw.autopilot.control.cascade import Inner
from sitl.scenario import Scenario
from studies.flight.job import PlantName
from studies.paper.cases import REPORTING_FROM, TUNING_SEEDS, Case, Family, scenario


class NoCellError(ValueError):
    """Nothing of a study has the suite and the name that were asked for."""


@dataclass(frozen=True, slots=True)
class Settings:
    """Which flights a study consists of."""

    plant: PlantName = "full"
    seeds: range = range(REPORTING_FROM, REPORTING_FROM + 20)
    duration_s: float | None = None  # None: as long as the scenario
    inner: Inner = "tracking"
    family: Family = "walls"  # of scenarios; of Table IV and of the rivals
    # Cells of the study of robustness; None: all.
    suite: str | None = None  # flown with this one
    only: str | None = None  # with this in their name
    # module:Name of the user's, flown as one more controller of Table IV; empty: none.
    own_planner: str = ""
    own_controller: str = ""

    def flown(self, case: Case, *, disturbed: bool) -> Scenario:
        """A case of the paper in the family of scenarios, for as long as is asked for."""
        return scenario(case, disturbed=disturbed, duration_s=self.duration_s, family=self.family)

    @property
    def tuned_on(self) -> tuple[int, ...]:
        """Seeds asked for that were used for tuning, and therefore show nothing."""
        return tuple(seed for seed in self.seeds if seed in TUNING_SEEDS)


@dataclass(frozen=True, slots=True)
class Table:
    """A table of the page and of the terminal."""

    caption: str
    headers: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True)
class Figure:
    """A drawing and the numbers in it."""

    name: str  # of its files, without suffix
    caption: str
    svg: str
    arrays: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Report:
    """Everything that one study found."""

    title: str
    rows: list[dict[str, Any]]  # for machines
    tables: tuple[Table, ...] = ()
    figures: tuple[Figure, ...] = ()
    deviations: tuple[str, ...] = ()  # from the paper, each with its reason
    errors: tuple[str, ...] = field(default=())  # flights that could not be flown
