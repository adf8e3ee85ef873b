"""``python -m benchmarks mpc``: the optimiser against others, in one process, interleaved.

Every instance is given to every method before the next one comes, in an order that rotates, so
that a busy moment of the machine falls on all alike. Slow methods get as many instances as
their time budget allows, spread over both cases.
"""

from __future__ import annotations

import gc
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from benchmarks.optimiser.converged import ConvergedOcp
from benchmarks.optimiser.instances import Instance, planner_of, record
from benchmarks.optimiser.methods import Entry, Method, entries, guess_for
from benchmarks.optimiser.solved import Solved, stopwatch_us
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.mpc.planner import Planner
from studies.paper.cases import Case

HORIZONS = (1, 5, 10, 20)

Report = Callable[[str, int, int], None]  # what is being done, steps done, steps in all


@dataclass(frozen=True, slots=True)
class Effort:
    """How much is measured."""

    instances: int = 100  # of each case and horizon
    duration_s: float = 60.0  # of each recorded flight
    budget_us: float = 25e6  # for one method at one horizon


QUICK = Effort(instances=8, duration_s=10.0, budget_us=2e6)


@dataclass
class Samples:
    """Everything one method did at one horizon."""

    horizon: int
    entry: Entry
    answers: list[Solved] = field(default_factory=list)
    suboptimality: list[float] = field(default_factory=list)  # against the best known cost
    spent_us: float = 0.0

    @property
    def failed(self) -> int:
        """Instances without an answer."""
        return sum(answer.inputs is None for answer in self.answers)

    def row(self) -> dict[str, float | int | str | None]:
        """For the JSON list; null where the package is not installed or nothing was solved."""
        times = [answer.spent.wall_us for answer in self.answers]
        return {
            "n": self.horizon,
            "method": self.entry.name,
            "sqp_iterations": self._iterations(),
            "median_us": _rounded(np.median(times)) if times else None,
            "p99_us": _rounded(np.percentile(times, 99.0)) if times else None,
            "max_us": _rounded(max(times)) if times else None,
            "suboptimality_p50": float(np.median(self.suboptimality))
            if self.suboptimality
            else None,
        }

    def cpu_median_us(self) -> float | None:
        """Processor time, null like the row's times."""
        times = [answer.spent.cpu_us for answer in self.answers]
        return _rounded(np.median(times)) if times else None

    def stages(self) -> tuple[float, float, float] | None:
        """Median linearise and fill, update and solve, rest [us], where the method says."""
        timed = [answer for answer in self.answers if answer.solve_us > 0.0]
        if not timed:
            return None
        linearise = float(np.median([answer.linearise_us for answer in timed]))
        solve = float(np.median([answer.solve_us for answer in timed]))
        total = [answer.spent.wall_us - answer.linearise_us - answer.solve_us for answer in timed]
        return linearise, solve, float(np.median(total))

    def _iterations(self) -> int | None:
        """As configured; for SLSQP, whose iterations are quadratic programs too, the median."""
        counts = [a.sqp_iterations for a in self.answers if a.sqp_iterations is not None]
        if self.entry.sqp_iterations is not None or not counts:
            return self.entry.sqp_iterations
        return round(float(np.median(counts)))


def run(horizons: tuple[int, ...], effort: Effort, report: Report) -> list[Samples]:
    """Measure; rows come by horizon, then in the order of ``entries``."""
    return [samples for horizon in horizons for samples in _at_horizon(horizon, effort, report)]


def _at_horizon(horizon: int, effort: Effort, report: Report) -> list[Samples]:
    report(f"n = {horizon}: recording", 0, 1)
    instances = record(horizon, effort.instances, effort.duration_s)
    rivals = _Rivals(horizon, effort)
    rivals.warm_up(instances[:2])
    gc.collect()
    gc.disable()  # a collection would fall on the method that happens to run
    try:
        for k, instance in enumerate(instances):
            report(f"n = {horizon}: timing", k, len(instances))
            rivals.compare(instance, k)
    finally:
        gc.enable()
    report(f"n = {horizon}: timing", len(instances), len(instances))
    return rivals.samples


@dataclass(frozen=True, slots=True)
class _Lane:
    """What belongs to one case: programs are built for one safe set."""

    planner: Planner
    converged: ConvergedOcp
    methods: list[Method | None]


class _Rivals:
    def __init__(self, horizon: int, effort: Effort) -> None:
        self._config = planner_of(horizon)
        self._effort = effort
        self.samples = [Samples(horizon, entry) for entry in entries()]
        self._lanes: dict[Case, _Lane] = {}

    def warm_up(self, instances: list[Instance]) -> None:
        """Build and load everything; the slow ones not twice."""
        for instance in instances:
            lane = self._lane(instance)
            guess, optimum, _ = self._truth(lane, instance)
            for samples, method in zip(self.samples, lane.methods, strict=True):
                if method is not None and samples.spent_us < 0.1 * self._effort.budget_us:
                    samples.spent_us += method.solve(instance, guess, optimum).spent.wall_us
        for samples in self.samples:
            samples.spent_us = 0.0

    def compare(self, instance: Instance, turn: int) -> None:
        """Give one instance to everyone who has time left."""
        lane = self._lane(instance)
        guess, optimum, best = self._truth(lane, instance)
        order = np.roll(np.arange(len(self.samples)), turn)
        costs: list[tuple[Samples, float]] = []
        for at in order:
            samples, method = self.samples[at], lane.methods[at]
            if method is None or samples.spent_us > self._effort.budget_us:
                continue
            answer = method.solve(instance, guess, optimum)
            samples.spent_us += answer.spent.wall_us
            samples.answers.append(answer)
            if answer.inputs is not None:
                costs.append((samples, lane.converged.cost(instance.request, answer.inputs)))
        # Where directions turn (eq 23), programs may settle above what another optimiser finds.
        best = min([best, *(cost for _, cost in costs)])
        for samples, cost in costs:
            samples.suboptimality.append(cost / best - 1.0)

    def _truth(self, lane: _Lane, instance: Instance) -> tuple[Array, Array, float]:
        guess = guess_for(lane.planner, instance)
        return guess, *lane.converged.solve(instance.request, guess)

    def _lane(self, instance: Instance) -> _Lane:
        found = self._lanes.get(instance.case)
        if found is None:
            config, airframe = self._config.planner, self._config.airframe
            problem = config, airframe, instance.request.safe_set
            built = [
                None if samples.entry.build is None else samples.entry.build(*problem)
                for samples in self.samples
            ]
            planner = Planner(config, airframe, stopwatch_us)
            found = _Lane(planner, ConvergedOcp(*problem), built)
            self._lanes[instance.case] = found
        return found


def _rounded(value: float) -> float:
    return round(float(value), 1)
