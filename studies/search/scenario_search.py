"""The search for a scenario that decides between controllers, judged on other seeds.

A file says which controllers are to complete a scenario, calm and disturbed, and which are not to.
CMA-ES moves what the file varies of the scenario. What is minimised is how much, in metres, all
flights together fall short of what is wanted; 0 is a scenario that decides as wanted. The best
scenario then flies for its whole duration with seeds that the search has not used.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeAlias

import numpy as np
from cmaes import CMA

from command_line.ranges import Range
from fsw.autopilot.parameters.flight_config import FlightConfig, flight_config
from sitl.scenario import Scenario, vehicle_of
from sitl.scenario_file import ScenarioError, build_table
from studies.campaign.campaign import Campaign
from studies.campaign.keys import CampaignError, applied, range_of, rounded
from studies.campaign.plan import CampaignPlan, Controller, Varied, load_tables
from studies.flight.job import Job, Outcome

Report: TypeAlias = Callable[[int, float], None]  # candidates so far, least shortfall [m]

EXAMPLE: Final = Path(__file__).parent / "dash_search.toml"
TABLE: Final = "search"
JUDGED_FROM: Final = 1000  # the first seed of the judge; the search uses those from 0 on
_FIRST_STEP: Final = 0.5  # of half a range
_UNFLOWN_M: Final = 1.0  # of a flight that could not be flown, such as one that starts outside
_UNFINISHED_M: Final = 0.05  # at least, where a flight that is to be completed was not


@dataclass(frozen=True, slots=True)
class Mark:
    """What one controller is to do."""

    controller: Controller
    fails: Literal["none", "calm", "disturbed", "both", "either"]
    tightening_m: Annotated[float, Range(0.0, 0.5)] = 0.0  # of hc
    softened: bool = False  # hc with the slack of blf, and its first node left out
    centred: bool = False  # naive with a cost on the distance from the sphere's centre
    te_calm_m: Annotated[float, Range(0.0, 10.0)] = math.inf  # at most
    te_disturbed_m: Annotated[float, Range(0.0, 10.0)] = math.inf

    def __str__(self) -> str:
        words = ["centred" * self.centred, "softened" * self.softened, self.controller]
        words.append(f"+ {1e3 * self.tightening_m:.0f} mm" if self.tightening_m else "")
        return " ".join(word for word in words if word)


@dataclass(frozen=True, slots=True)
class _Keys:
    """The table ``search``."""

    marks: tuple[Mark, ...]
    candidates: Annotated[float, Range(2.0, 1e6, step=1.0)] = 100.0
    train_seeds: Annotated[float, Range(1.0, 1000.0, step=1.0)] = 2.0
    judge_seeds: Annotated[float, Range(1.0, 1000.0, step=1.0)] = 20.0
    search_s: Annotated[float, Range(0.1, 86400.0)] = math.inf  # of a flight of the search
    margin_m: Annotated[float, Range(0.0, 10.0)] = 0.02  # that completing flights keep
    beyond_m: Annotated[float, Range(0.0, 10.0)] = 0.005  # by which the others leave the safe set


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """What a scenario is to decide."""

    plan: CampaignPlan
    marks: tuple[Mark, ...]
    candidates: int
    train: range  # seeds
    judge: range
    search_s: float  # of the flights of the search
    margin_m: float
    beyond_m: float

    def scenarios(self, shares: Sequence[float], *, whole: bool) -> tuple[Scenario, Scenario]:
        """Calm and disturbed, at ``shares`` of the distributions [1]."""
        flown = self.plan.bases[0]
        if not whole:
            flown = replace(flown, scenario=replace(flown.scenario, duration_s=self.search_s))
        values = [
            (one.key, rounded(one.key, one.distribution.at(share), range_of(one.key, flown)))
            for one, share in zip(self.plan.varied, shares, strict=True)
        ]
        disturbed = applied(flown, values).scenario
        return replace(disturbed, disturbances=()), disturbed

    def values(self, shares: Sequence[float]) -> dict[str, float]:
        """What is varied, at ``shares`` of the distributions [1]."""
        varied: tuple[Varied, ...] = self.plan.varied
        return {one.key: one.distribution.at(x) for one, x in zip(varied, shares, strict=True)}

    def config(self, mark: Mark) -> FlightConfig:
        """What flies for a mark; inconsistent configurations fly as well."""
        flown = self.plan.bases[0].scenario
        config = flight_config(
            mark.controller, body=flown.body, soft=True, vehicle=vehicle_of(flown)
        )
        planner = replace(config.planner, tightening=mark.tightening_m, centred=mark.centred)
        if mark.softened:
            planner = replace(
                planner,
                hard_slack=planner.barrier_slack,
                hard_skipped_nodes=planner.walls.skipped_nodes,
            )
        return replace(config, planner=planner)


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """One controller on the seeds of the judge."""

    mark: Mark
    completed: tuple[int, int]  # flights, calm and disturbed
    flights: tuple[int, int]
    margin_m: tuple[float, float]  # least
    te_m: tuple[float, float]  # mean
    shortfall_m: float

    @property
    def as_wanted(self) -> bool:
        """Whether every flight ended as the mark says."""
        calm, disturbed = self.completed
        whole = (calm == self.flights[0], disturbed == self.flights[1])
        none = (calm == 0, disturbed == 0)
        te = self.te_m[0] <= self.mark.te_calm_m and self.te_m[1] <= self.mark.te_disturbed_m
        return (
            te
            and self.shortfall_m < _UNFLOWN_M
            and {
                "none": all(whole),
                "calm": none[0] and whole[1],
                "disturbed": whole[0] and none[1],
                "both": all(none),
                "either": not all(whole),
            }[self.mark.fails]
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """The best scenario, and how it decides."""

    task: Task
    shares: tuple[float, ...]
    shortfall_m: float  # on the seeds of the search
    judged: tuple[Judged, ...]
    candidates: int

    @property
    def decides(self) -> bool:
        """Whether every controller did what is wanted, on the seeds of the judge."""
        return all(one.as_wanted for one in self.judged)


def load_task(path: Path) -> Task:
    """Read a campaign file with a table ``search``.

    Raises:
        CampaignError: As a campaign file, or what is to be decided makes no sense.
    """
    plan, own = load_tables(path, (TABLE,))
    if TABLE not in own:
        raise CampaignError(
            f"{path}: missing table [{TABLE}]; `pandion search --example` prints a file"
        )
    try:
        keys: _Keys = build_table(_Keys, own[TABLE], TABLE)
    except ScenarioError as error:
        raise CampaignError(f"{path}: {error}") from None
    scenario, config = plan.bases[0].scenario, plan.bases[0].config
    for wrong, why in (
        (
            config.own_planner or config.own_controller,
            "a search is between Pandion's controllers: leave out own_planner and own_controller",
        ),
        (len(plan.bases) > 1, "name one scenario and no suites: it is what is searched"),
        (not plan.varied, "nothing to search; add [vary]"),
        (not keys.marks, f"{TABLE}.marks = []: say of at least one controller what it is to do"),
        (not scenario.disturbances, f"{scenario.name} has no disturbances: it is flown with them"),
    ):
        if wrong:
            raise CampaignError(f"{path}: {why}")
    return Task(
        plan=plan,
        marks=keys.marks,
        candidates=int(keys.candidates),
        train=range(int(keys.train_seeds)),
        judge=range(JUDGED_FROM, JUDGED_FROM + int(keys.judge_seeds)),
        search_s=min(keys.search_s, scenario.duration_s),
        margin_m=keys.margin_m,
        beyond_m=keys.beyond_m,
    )


def search(
    task: Task,
    campaign: Campaign[Outcome],
    seed: int,
    report: Report = lambda _, __: None,
) -> Found:
    """Look for the scenario, and judge the best one."""
    count = len(task.plan.varied)
    optimiser = CMA(
        mean=np.zeros(count),
        sigma=_FIRST_STEP,
        bounds=np.tile((-1.0, 1.0), (count, 1)),
        seed=seed % 2**31,
    )
    best, least, done = (0.5,) * count, math.inf, 0
    while done < task.candidates and least > 0.0:
        points = [optimiser.ask() for _ in range(optimiser.population_size)]
        candidates = [tuple((0.5 + 0.5 * point).tolist()) for point in points]
        flown = _fly(task, campaign, candidates, task.train, whole=False)
        costs = [math.fsum(one.shortfall_m for one in marks) for marks in flown]
        optimiser.tell(list(zip(points, costs, strict=True)))
        done += len(points)
        k = int(np.argmin(costs))
        if costs[k] < least:
            best, least = candidates[k], costs[k]
        report(done, least)
    (judged,) = _fly(task, campaign, [best], task.judge, whole=True)
    return Found(task=task, shares=best, shortfall_m=least, judged=judged, candidates=done)


def _fly(
    task: Task,
    campaign: Campaign[Outcome],
    candidates: Sequence[tuple[float, ...]],
    seeds: range,
    *,
    whole: bool,
) -> list[tuple[Judged, ...]]:
    """Every mark of every candidate; all fly at once."""
    configs = [task.config(mark) for mark in task.marks]
    cells = [
        [Job("full", flown, config, seed) for seed in (seeds if flown.disturbances else seeds[:1])]
        for shares in candidates
        for scenarios in (task.scenarios(shares, whole=whole),)
        for config in configs
        for flown in scenarios
    ]
    rows = iter(campaign.run([job for cell in cells for job in cell]))
    found = iter([[next(rows) for _ in cell] for cell in cells])
    return [
        tuple(_judged(task, mark, next(found), next(found)) for mark in task.marks)
        for _ in candidates
    ]


def _judged(
    task: Task, mark: Mark, calm: Sequence[Outcome], disturbed: Sequence[Outcome]
) -> Judged:
    airs = (calm, disturbed)
    kept = tuple(_short_of_keeping(task, rows) for rows in airs)
    left = tuple(_short_of_leaving(task, rows) for rows in airs)
    short = {
        "none": kept[0] + kept[1],
        "calm": left[0] + kept[1],
        "disturbed": kept[0] + left[1],
        "both": left[0] + left[1],
        "either": _short_of_leaving(task, [*calm, *disturbed], min),
    }[mark.fails]
    te = tuple(float(np.mean([row.te_m or 0.0 for row in rows])) for rows in airs)
    short += max(te[0] - mark.te_calm_m, 0.0) + max(te[1] - mark.te_disturbed_m, 0.0)
    return Judged(
        mark=mark,
        completed=(sum(row.completed for row in calm), sum(row.completed for row in disturbed)),
        flights=(len(calm), len(disturbed)),
        margin_m=(min(map(_margin, calm)), min(map(_margin, disturbed))),
        te_m=(te[0], te[1]),
        shortfall_m=short,
    )


def _margin(row: Outcome) -> float:
    return -_UNFLOWN_M if row.error or row.margin_m is None else row.margin_m


def _short_of_keeping(task: Task, rows: Sequence[Outcome]) -> float:
    short = max(0.0, task.margin_m - min(map(_margin, rows)))
    return max(short, 0.0 if all(row.completed for row in rows) else _UNFINISHED_M)


def _short_of_leaving(
    task: Task, rows: Sequence[Outcome], of: Callable[[Iterator[float]], float] = max
) -> float:
    """By the flight that stays farthest inside, where all are to leave; ``min``: where one is."""
    if any(row.error for row in rows):
        return _UNFLOWN_M
    return max(0.0, task.beyond_m + of(map(_margin, rows)))


def sentences(found: Found) -> Iterator[str]:
    """What was found, line by line."""
    task = found.task
    yield (
        f"{found.candidates} candidates with seeds {task.train.start} to {task.train.stop - 1}: "
        f"the best falls short by {1e3 * found.shortfall_m:.1f} mm"
    )
    for key, value in task.values(found.shares).items():
        yield f"  {key} = {value:.4g}"
    yield f"judged with seeds {task.judge.start} to {task.judge.stop - 1}, margins and TE in mm:"
    for one in found.judged:
        airs = (
            f"{air} {passed}/{flights} ({1e3 * margin:+.1f}, {1e3 * te:.1f})"
            for air, passed, flights, margin, te in zip(
                ("calm", "disturbed"),
                one.completed,
                one.flights,
                one.margin_m,
                one.te_m,
                strict=True,
            )
        )
        verdict = "as wanted" if one.as_wanted else "NOT as wanted"
        yield f"  {one.mark}: {', '.join(airs)}, to fail: {one.mark.fails}: {verdict}"


def as_json(found: Found) -> dict[str, Any]:
    """The same for programs."""
    return {
        "decides": found.decides,
        "candidates": found.candidates,
        "shortfall_m": found.shortfall_m,
        "values": found.task.values(found.shares),
        "marks": [
            {
                **asdict(one.mark),
                "as_wanted": one.as_wanted,
                "completed": one.completed,
                "flights": one.flights,
                "margin_m": one.margin_m,
                "te_m": one.te_m,
            }
            for one in found.judged
        ],
    }
