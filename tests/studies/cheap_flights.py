"""A campaign whose flights are a formula, for what searches over flights."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from studies.flight.job import Job, Outcome


@dataclass
class CheapCampaign:
    """Stands for a campaign: the least margin [m] of a job is a function."""

    margin: Callable[[Job], float | None]
    broken: Callable[[Job], bool] = lambda _: False
    flown: list[Job] = field(default_factory=list)

    def run(self, jobs: Sequence[Job]) -> list[Outcome]:
        """Rows in the order of the jobs."""
        self.flown += jobs
        return [self._row(job) for job in jobs]

    def _row(self, job: Job) -> Outcome:
        if self.broken(job):
            return job.broken("ScenarioError: it starts outside its safe set")
        margin = self.margin(job)
        touched = margin is not None and margin < -0.1
        return Outcome(job.seed, completed=not touched, reason="", margin_m=margin, contact=touched)
