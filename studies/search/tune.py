"""Parameters that cost less and keep a chance constraint: found on some flights, judged on others.

A candidate flies the first flights of a campaign file, all candidates the same ones. It is feasible
if the count of its violations shows, at the stated confidence, that a flight violates with no more
than the stated probability. CMA-ES gets ranks: feasible ones by cost, before the others by how far
they are from feasible. The best one then flies against today's values on flights that no candidate
has flown.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final, TypeAlias

import numpy as np
from cmaes import CMA
from scipy.special import bdtrc

from command_line.ranges import Range
from command_line.toml_tables import nearest
from fsw.autopilot.parameters.registry import BY_NAME, Parameter
from fsw.autopilot.tuning import tuned
from sitl.scenario_file import ScenarioError, build_table
from studies.campaign.campaign import Campaign
from studies.campaign.flight import CampaignFlight, CampaignRow
from studies.campaign.keys import PARAMETERS, CampaignError, Flown
from studies.campaign.plan import OURS, CampaignPlan, OwnNames, load_tables
from studies.campaign.randomness import seeded, spread
from studies.statistics.binomial import bounds, flights_for
from studies.statistics.comparison import mean_interval

Array: TypeAlias = np.ndarray[Any, np.dtype[np.float64]]
Report: TypeAlias = Callable[[int, float], None]  # candidates so far, least cost

EXAMPLE: Final = Path(__file__).parent / "tune_example.toml"
TABLE: Final = "tune"
_WEIGHT: Final = Range(0.0, 1e9)
_FIRST_STEP: Final = 0.25  # of half a range
_MIN_PAIRS: Final = 10
_REFUSED: Final = (2.0,)  # rank of values that the flight software does not take
_NOTHING: Final = "nothing better than today's values was found: "


@dataclass(frozen=True, slots=True)
class _Cost:
    """Weights of fields of a row."""

    te_m: Annotated[float, _WEIGHT] = 0.0
    te_max_m: Annotated[float, _WEIGHT] = 0.0
    cs_mean: Annotated[float, _WEIGHT] = 0.0
    ce_mean: Annotated[float, _WEIGHT] = 0.0


@dataclass(frozen=True, slots=True)
class _Keys:
    """The table ``tune``, but for the parameters."""

    cost: _Cost = _Cost(te_m=1.0)
    candidates: Annotated[float, Range(2.0, 1e6, step=1.0)] = 60.0
    judge_flights: Annotated[float, Range(float(_MIN_PAIRS), 1e6, step=1.0)] = 60.0
    margin_m: Annotated[float, Range(-1.0, 10.0)] = 0.0
    probability: Annotated[float, Range(1e-6, 0.999)] = 0.1
    confidence: Annotated[float, Range(0.5, 0.999999)] = 0.95


@dataclass(frozen=True, slots=True)
class Tuned:
    """A parameter and the range it is looked for in."""

    parameter: Parameter
    low: float
    high: float

    def at(self, place: float) -> float:
        """The value at a ``place`` of the range [1], from -1 to 1, as a vehicle keeps it."""
        share = 0.5 + 0.5 * min(max(place, -1.0), 1.0)
        value = self.parameter.kept(self.low + share * (self.high - self.low))
        return min(max(value, self.parameter.least), self.parameter.most)

    def place(self, value: float) -> float:
        """The opposite of ``at`` for a ``value`` [its unit], within the range."""
        share = (value - self.low) / (self.high - self.low)
        return 2.0 * min(max(share, 0.0), 1.0) - 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """What is to be improved, on which flights, under which constraint."""

    plan: CampaignPlan
    parameters: tuple[Tuned, ...]
    cost: tuple[tuple[str, float], ...]  # field of a row, weight
    candidates: int
    judge_flights: int
    margin_m: float
    probability: float
    confidence: float

    @property
    def today(self) -> tuple[float, ...]:
        """The values of the parameters as the file flies them otherwise."""
        config = self.plan.bases[0].config
        return tuple(one.parameter.read(config) for one in self.parameters)

    def with_values(self, values: Sequence[float]) -> CampaignPlan:
        """The plan flown with ``values`` of the parameters.

        Raises:
            ValueError: The flight software does not take them together.
        """
        numbers = tuple(
            (one.parameter.path, one.parameter.scale * value)
            for one, value in zip(self.parameters, values, strict=True)
        )
        bases = tuple(Flown(one.scenario, tuned(one.config, numbers)) for one in self.plan.bases)
        return replace(self.plan, bases=bases)

    def violates(self, row: CampaignRow) -> bool:
        """Whether a flight counts against the constraint; one that was not flown does."""
        short = row.margin_m is not None and not row.margin_m >= self.margin_m
        return row.error or row.contact or short or not row.limits_kept or not row.completed


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """What the flights of one candidate come to."""

    flights: int
    violations: int
    at_most: float  # probability of a violation, at the task's confidence
    feasible: bool
    cost: float  # infinite if no flight has one
    min_margin_m: float | None


@dataclass(frozen=True, slots=True)
class Candidate:
    """Values and what they come to."""

    values: tuple[float, ...]
    score: Score


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """The best candidate against today's values, on the same flights, new to both."""

    today: Score
    found: Score
    difference: float  # of the costs, mean over flights that both completed; below 0: cheaper
    interval: tuple[float, float]  # of it, at the task's confidence
    pairs: int
    only_today: int  # flights that violate with today's values and not with the candidate's
    only_found: int  # the other way round
    safer: bool  # beyond doubt, by these two, at the task's confidence

    @property
    def cheaper(self) -> bool:
        """Beyond doubt."""
        return self.interval[1] < 0.0

    @property
    def better(self) -> bool:
        """Feasible, and cheaper; or safer than today's values that are not shown to be feasible."""
        return self.found.feasible and (self.cheaper or (self.safer and not self.today.feasible))


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What a tuning found."""

    task: Task
    today: Score  # on the tuning flights
    best: Candidate | None  # None: no candidate was feasible
    judged: Judged | None
    candidates: int
    refused: int  # that the flight software does not take

    @property
    def better(self) -> bool:
        """Whether there is something to change."""
        return self.judged is not None and self.judged.better


def load_task(path: Path, parts: OwnNames = OURS) -> Task:
    """Read a campaign file with a table ``tune``, flown with ``parts`` of the user's.

    Raises:
        CampaignError: As a campaign file, or what is to be tuned makes no sense.
    """
    plan, own = load_tables(path, (TABLE,), parts)
    try:
        return _task(plan, own.get(TABLE))
    except (CampaignError, ScenarioError) as error:
        raise CampaignError(f"{path}: {error}") from None


def _task(plan: CampaignPlan, table: Any) -> Task:
    if not isinstance(table, dict):
        raise CampaignError(f"missing table [{TABLE}]; `pandion tune --example` prints a file")
    own = dict(table)
    parameters = own.pop(PARAMETERS, None)
    keys: _Keys = build_table(_Keys, own, TABLE)
    cost = tuple((name, weight) for name, weight in asdict(keys.cost).items() if weight)
    if not cost:
        raise CampaignError(f"{TABLE}.cost: must have a weight above 0, such as te_m = 1.0")
    task = Task(
        plan=plan,
        parameters=tuple(_parameters(parameters, plan)),
        cost=cost,
        candidates=int(keys.candidates),
        judge_flights=int(keys.judge_flights),
        margin_m=keys.margin_m,
        probability=keys.probability,
        confidence=keys.confidence,
    )
    needed = flights_for(task.probability, task.confidence)
    for key, count in (("flights", plan.count), (f"{TABLE}.judge_flights", task.judge_flights)):
        if count < needed:
            raise CampaignError(
                f"{key} = {count}: even without a violation that does not show a probability of "
                f"{task.probability:g} at a confidence of {task.confidence:g}; must be at least "
                f"{needed}"
            )
    if plan.design != "random":
        raise CampaignError(
            f'design = "{plan.design}": the bounds that candidates are held to are of independent '
            'flights; must be "random"'
        )
    for case, base in zip(plan.cases, plan.bases, strict=True):
        if not seeded(base) and not spread(plan.varied, base):
            raise CampaignError(
                f"{case}: nothing is random, so all its flights are one flight, and their number "
                "shows nothing; add [vary], or sensors or air that draw numbers"
            )
    plan.check(plan.count + task.judge_flights)
    return task


def _parameters(table: Any, plan: CampaignPlan) -> Iterator[Tuned]:
    key = f"{TABLE}.{PARAMETERS}"
    if not isinstance(table, dict) or not table:
        raise CampaignError(f"missing table [{key}]: names of parameters and their ranges")
    for name, ends in table.items():
        if name not in BY_NAME:
            raise CampaignError(f'unknown parameter "{name}"{nearest(name, BY_NAME)}')
        parameter = BY_NAME[name]
        if parameter.choices:
            raise CampaignError(f"{key}.{name}: one of several words cannot be tuned")
        if any(one.key == f"{PARAMETERS}.{name}" for one in plan.varied):
            raise CampaignError(f"{key}.{name}: it is varied as well; leave it out of [vary]")
        numbers = (
            isinstance(ends, list)
            and len(ends) == 2
            and all(isinstance(x, int | float) and not isinstance(x, bool) for x in ends)
        )
        if not numbers or not parameter.least <= ends[0] < ends[1] <= parameter.most:
            raise CampaignError(
                f"{key}.{name} = {ends!r}: must be two numbers of {parameter.least:g} to "
                f"{parameter.most:g}, rising"
            )
        yield Tuned(parameter, float(ends[0]), float(ends[1]))


def tune(
    task: Task,
    campaign: Campaign[CampaignRow],
    seed: int,
    report: Report = lambda _, __: None,
) -> Outcome:
    """Look for better values, and judge the best of them.

    Raises:
        CampaignError: Today's values fly no flight whose cost is known.
    """
    flights = range(task.plan.count)
    rows = campaign.run([CampaignFlight(task.plan, k) for k in flights])
    units = _units(task, rows)
    today = _score(task, rows, units)
    flown, refused = _search(task, campaign, seed, units, report)
    best = min(
        (one for one in flown if one.score.feasible), key=lambda one: one.score.cost, default=None
    )
    judged = None
    if best is not None and _rank(best.score) < _rank(today):
        judged = _judged(task, campaign, best, units)
    return Outcome(
        task=task,
        today=today,
        best=best,
        judged=judged,
        candidates=len(flown) + refused,
        refused=refused,
    )


def _search(
    task: Task, campaign: Campaign[CampaignRow], seed: int, units: dict[str, float], report: Report
) -> tuple[list[Candidate], int]:
    """All candidates that were flown, and how many could not be."""
    mean = np.array([one.place(x) for one, x in zip(task.parameters, task.today, strict=True)])
    optimiser = CMA(
        mean=np.clip(mean, -0.9, 0.9),
        sigma=_FIRST_STEP,
        bounds=np.tile((-1.0, 1.0), (len(mean), 1)),
        seed=seed % 2**31,
    )
    flown: list[Candidate] = []
    refused = 0
    while len(flown) + refused < task.candidates:
        points = [optimiser.ask() for _ in range(optimiser.population_size)]
        values = [_values(task, point) for point in points]
        scores = _scores(task, campaign, values, units)
        found = [
            Candidate(one, score)
            for one, score in zip(values, scores, strict=True)
            if score is not None
        ]
        flown += found
        refused += len(points) - len(found)
        ranks = [_REFUSED if one is None else _rank(one) for one in scores]
        order = sorted(range(len(points)), key=lambda k: ranks[k])
        places = {k: float(place) for place, k in enumerate(order)}
        optimiser.tell([(point, places[k]) for k, point in enumerate(points)])
        least = min((one.score.cost for one in flown if one.score.feasible), default=math.inf)
        report(len(flown) + refused, least)
    return flown, refused


def _values(task: Task, point: Array) -> tuple[float, ...]:
    return tuple(one.at(float(x)) for one, x in zip(task.parameters, point, strict=True))


def _scores(
    task: Task,
    campaign: Campaign[CampaignRow],
    values: Sequence[tuple[float, ...]],
    units: dict[str, float],
) -> list[Score | None]:
    """Of each candidate; None of one that the flight software does not take. All fly at once."""
    plans = [_taken(task, one) for one in values]
    count = task.plan.count
    flights = [CampaignFlight(plan, k) for plan in plans if plan is not None for k in range(count)]
    rows = iter(campaign.run(flights))
    return [
        None if plan is None else _score(task, [next(rows) for _ in range(count)], units)
        for plan in plans
    ]


def _taken(task: Task, values: tuple[float, ...]) -> CampaignPlan | None:
    try:
        return task.with_values(values)
    except ValueError:
        return None


def _units(task: Task, rows: Sequence[CampaignRow]) -> dict[str, float]:
    """The mean of each cost as it is today, of flights that were completed."""
    found = {}
    for name, _ in task.cost:
        values = [getattr(row, name) for row in rows if _whole(row)]
        known = [value for value in values if value is not None and math.isfinite(value)]
        mean = float(np.mean(known)) if known else 0.0
        if not (0.0 < mean < math.inf):
            reasons = {row.reason for row in rows}
            raise CampaignError(
                f"today's values complete no flight with a {name}, so nothing can be compared: "
                f"{sorted(reasons)[0]}"
            )
        found[name] = mean
    return found


def _whole(row: CampaignRow) -> bool:
    """Whether a flight has a cost: one that ended early has a smaller one, or none, for nothing."""
    return row.completed and not row.error and not row.refused


def _cost_of(task: Task, row: CampaignRow, units: dict[str, float]) -> float | None:
    """The cost of one flight, in today's; None if it has none, or was not completed."""
    values = [getattr(row, name) for name, _ in task.cost]
    if not _whole(row) or any(value is None or not math.isfinite(value) for value in values):
        return None
    parts = zip(task.cost, values, strict=True)
    return math.fsum(weight * value / units[name] for (name, weight), value in parts)


def _score(task: Task, rows: Sequence[CampaignRow], units: dict[str, float]) -> Score:
    violations = sum(map(task.violates, rows))
    at_most = bounds(violations, len(rows), task.confidence).upper
    costs = [cost for row in rows if (cost := _cost_of(task, row, units)) is not None]
    margins = [row.margin_m for row in rows if row.margin_m is not None]
    return Score(
        flights=len(rows),
        violations=violations,
        at_most=at_most,
        feasible=at_most <= task.probability and bool(costs),
        cost=float(np.mean(costs)) if costs else math.inf,
        min_margin_m=min(margins) if margins else None,
    )


def _rank(score: Score) -> tuple[float, ...]:
    if score.feasible:
        return (0.0, score.cost)
    least = -math.inf if score.min_margin_m is None else score.min_margin_m
    return (1.0, float(score.violations), -least)


def _judged(
    task: Task, campaign: Campaign[CampaignRow], best: Candidate, units: dict[str, float]
) -> Judged:
    numbers = range(task.plan.count, task.plan.count + task.judge_flights)
    plans = (task.plan, task.with_values(best.values))
    rows = campaign.run([CampaignFlight(plan, k) for plan in plans for k in numbers])
    today, found = rows[: len(numbers)], rows[len(numbers) :]
    pairs = [
        (mine - theirs)
        for one, other in zip(found, today, strict=True)
        if (mine := _cost_of(task, one, units)) is not None
        and (theirs := _cost_of(task, other, units)) is not None
    ]
    difference, interval = _paired(pairs, task.confidence)
    violations = [
        (task.violates(one), task.violates(other)) for one, other in zip(today, found, strict=True)
    ]
    only_today, only_found = violations.count((True, False)), violations.count((False, True))
    return Judged(
        today=_score(task, today, units),
        found=_score(task, found, units),
        difference=difference,
        interval=interval,
        pairs=len(pairs),
        only_today=only_today,
        only_found=only_found,
        safer=_by_chance(only_today, only_found) <= 0.5 * (1.0 - task.confidence),
    )


def _by_chance(fewer: int, more: int) -> float:
    """How likely so many flights for one side, and so few for the other, are of equal vehicles [1].

    Source: McNemar: Note on the sampling error of the difference between correlated proportions or
    percentages, Psychometrika 12, 1947; exact, one-sided.
    """
    return float(bdtrc(fewer - 1, fewer + more, 0.5)) if fewer else 1.0


def _paired(pairs: Sequence[float], confidence: float) -> tuple[float, tuple[float, float]]:
    """Mean and Student's interval of differences; of too few, an interval that shows nothing."""
    if len(pairs) < _MIN_PAIRS:
        return math.nan, (-math.inf, math.inf)
    return mean_interval(np.array(pairs), confidence)


def sentences(found: Outcome) -> Iterator[str]:
    """What was found, line by line."""
    task = found.task
    yield (
        f"{found.candidates} candidates, {task.plan.count} flights each"
        + (f"; {found.refused} refused by the flight software" if found.refused else "")
    )
    yield f"today, on the tuning flights: {_said(found.today)}"
    if found.best is None:
        yield f"{_NOTHING}no candidate is shown to keep the constraint on the tuning flights"
        return
    for one, value, before in zip(task.parameters, found.best.values, task.today, strict=True):
        yield f"  {one.parameter.name} = {value:g} {one.parameter.unit} (today {before:g})"
    yield f"best candidate, on the tuning flights: {_said(found.best.score)}"
    judged = found.judged
    if judged is None:
        yield f"{_NOTHING}no candidate costs less than today's values on the tuning flights"
        return
    yield f"today, on {task.judge_flights} other flights: {_said(judged.today)}"
    yield f"best candidate, on the same: {_said(judged.found)}"
    low, high = judged.interval
    yield (
        f"the cost changes by {judged.difference:+.4f}, {100 * task.confidence:g} % interval "
        f"{low:+.4f} to {high:+.4f} ({judged.pairs} pairs of flights)"
    )
    if judged.only_today or judged.only_found:
        yield (
            f"{judged.only_today} flights violate with today's values only, {judged.only_found} "
            f"with the candidate's only: fewer beyond doubt: {'yes' if judged.safer else 'no'}"
        )
    shown = "" if judged.today.feasible else "; today's values are not shown to keep the constraint"
    if judged.better:
        why = "costs less" if judged.cheaper else "violates less often"
        yield (
            f"better than today's values on flights that no candidate had flown: {why} beyond "
            f"doubt{shown}"
        )
    elif not judged.found.feasible:
        yield f"{_NOTHING}the best candidate is not shown to keep the constraint on other flights"
    else:
        also = "" if judged.today.feasible else ", nor violates less often"
        why = "on other flights the best candidate does not cost less beyond doubt"
        yield f"{_NOTHING}{why}{also}{shown}"


def _said(score: Score) -> str:
    verdict = "kept" if score.feasible else "not shown to be kept"
    least = score.min_margin_m
    margin = "" if least is None else f", minimum margin {1e3 * least:+.1f} mm"
    return (
        f"cost {score.cost:.4f}, {score.violations} of {score.flights} violations (at most "
        f"{score.at_most:.3g}: constraint {verdict}){margin}"
    )


def as_json(found: Outcome) -> dict[str, Any]:
    """The same for programs."""
    names = [one.parameter.name for one in found.task.parameters]
    best, judged = found.best, found.judged
    return {
        "better": found.better,
        "candidates": found.candidates,
        "refused": found.refused,
        "today": dict(zip(names, found.task.today, strict=True)),
        "found": None if best is None else dict(zip(names, best.values, strict=True)),
        "tuning": {
            "today": asdict(found.today),
            "found": None if best is None else asdict(best.score),
        },
        "judged": None if judged is None else asdict(judged),
    }
