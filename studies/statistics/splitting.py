"""Probabilities too small to be counted: adaptive multilevel splitting, as subset simulation.

A flight's random numbers are a point of a space of independent standard normal numbers. The score
of a point falls towards the event, which is a score of ``target`` or less. Levels are put between
where flights usually are and the event, so that a tenth of the points of one level reach the next;
the points that did are the start of Markov chains that refill the level. The probability is the
product of the shares. Whole runs are repeated, and only their scatter makes the interval.

Moves are preconditioned Crank-Nicolson steps, which leave the normal distribution as it is in any
dimension. Their size is adapted to an acceptance of 0.44.

Source: Au, Beck: Estimation of small failure probabilities in high dimensions by subset
simulation, Probabilistic Engineering Mechanics 16, 2001; Papaioannou et al., the same 41, 2015;
Cotter et al.: MCMC methods for functions, Statistical Science 28, 2013.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np
from scipy.special import stdtrit

from studies.statistics import binomial

Array: TypeAlias = np.ndarray[Any, np.dtype[np.float64]]
Flags: TypeAlias = np.ndarray[Any, np.dtype[np.bool_]]
Score: TypeAlias = Callable[[Array], Array]
"""Scores (n,) of points (n, dimension); all points of a call may be evaluated at once."""

Report: TypeAlias = Callable[[int, float], None]
"""Called with the evaluations so far and the level [score] of the slowest run."""

_ACCEPTED: Final = 0.44  # of the moves
_FIRST: Final = 0.8  # step
_LARGEST: Final = 0.999  # step; at 1 a move is a draw of its own
_REDRAWS: Final = 0.2  # of the moves, where there are numbers that cannot be moved a little


@dataclass(frozen=True, slots=True, kw_only=True)
class Space:
    """What a point consists of."""

    dimension: int
    redrawn: int = 0  # the last so many have no neighbourhood, such as seeds: kept or drawn anew

    def __post_init__(self) -> None:
        if not 0 <= self.redrawn <= self.dimension or self.dimension < 1:
            raise ValueError(f"{self.redrawn} of {self.dimension} numbers cannot be redrawn")


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How much is evaluated: about ``runs * particles * (1 + 0.9 * levels)``."""

    particles: int = 600  # a level, in each run
    runs: int = 5
    share: float = 0.1  # of the particles that reach the next level
    levels: int = 12  # at most: at a share of 0.1 probabilities down to 1e-12

    def __post_init__(self) -> None:
        if not (self.runs >= 2 and 0.0 < self.share <= 0.5 and self.levels >= 1):
            raise ValueError(f"{self}: needs 2 runs, a share of at most 0.5, and a level")
        if not self.particles * self.share >= 5.0:
            raise ValueError(
                f"{self.particles} particles: must be at least {5.0 / self.share:g}, so that five "
                "or more begin each level"
            )


@dataclass(frozen=True, slots=True)
class Level:
    """One level of a run."""

    score: float  # that its particles have reached
    share: float  # of the particles that reach what comes next
    accepted: float  # of the moves that made them; nan of the first, which is drawn
    step: float  # of the moves after them, 0 to 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One independent run."""

    probability: float  # 0 if the event was not reached
    levels: tuple[Level, ...]
    evaluations: int
    least: float  # score
    point: Array  # that has it
    stuck: str  # why the event was not reached; empty if it was


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """What all runs say."""

    probability: float  # mean of the runs
    interval: tuple[float, float]
    confidence: float
    runs: tuple[Run, ...]
    exact: bool  # every run saw the event without a level: plain counting, an exact interval
    as_if_independent: float  # deviation of ln p of a run if its particles were independent
    deviation: float  # the same as it is, from the scatter of the runs

    @property
    def evaluations(self) -> int:
        """Flights in all."""
        return sum(run.evaluations for run in self.runs)

    @property
    def reached(self) -> int:
        """Runs that reached the event."""
        return sum(not run.stuck for run in self.runs)


def estimate(
    score: Score,
    space: Space,
    target: float,
    effort: Effort,
    confidence: float,
    seed: int,
    report: Report = lambda _, __: None,
) -> Estimate:
    """The probability of a score of ``target`` [score] or less, at a ``confidence`` [1].

    The runs go side by side, so that the points of a call of ``score`` are those of all of them.
    """
    roots = np.random.SeedSequence(seed).spawn(effort.runs)
    going = {
        k: _run(space, target, effort, np.random.default_rng(root)) for k, root in enumerate(roots)
    }
    asked = {k: next(run) for k, run in going.items()}
    done: dict[int, Run] = {}
    evaluations = 0
    while asked:
        order = sorted(asked)
        points = np.concatenate([asked[k] for k in order])
        scores = np.asarray(score(points), dtype=np.float64)
        evaluations += len(points)
        report(evaluations, float(np.median(scores)))
        ends = np.cumsum([len(asked[k]) for k in order])[:-1]
        for k, part in zip(order, np.split(scores, ends), strict=True):
            try:
                asked[k] = going[k].send(part)
            except StopIteration as stop:
                done[k] = stop.value
                del asked[k]
    return summary(tuple(done[k] for k in sorted(done)), effort, confidence)


def summary(runs: tuple[Run, ...], effort: Effort, confidence: float) -> Estimate:
    """What finished runs say together, at a ``confidence`` [1]."""
    shares = np.array([run.probability for run in runs])
    naive = [
        sum((1.0 - level.share) / (level.share * effort.particles) for level in run.levels)
        for run in runs
        if not run.stuck
    ]
    exact = all(not run.stuck and len(run.levels) == 1 for run in runs)
    if exact:
        total = effort.particles * len(runs)
        seen = round(float(shares.mean()) * total)
        interval = binomial.bounds(seen, total, confidence).interval
        spread = float(np.log(shares).std(ddof=1))
    elif any(run.stuck for run in runs):
        interval, spread = (0.0, 1.0), math.nan
    else:
        interval, spread = mean_of_lognormal(shares, confidence)
    return Estimate(
        probability=float(shares.mean()),
        interval=interval,
        confidence=confidence,
        runs=runs,
        exact=exact,
        as_if_independent=math.sqrt(float(np.mean(naive))) if naive else math.nan,
        deviation=spread,
    )


def mean_of_lognormal(values: Array, confidence: float) -> tuple[tuple[float, float], float]:
    """Interval of the mean of lognormal ``values`` (n,) [1] at a ``confidence`` [1].

    Also the deviation of their logarithms. The product of many shares is nearly lognormal. Its
    mean is what is asked for, and the mean of the logarithms is not it.

    Source: Cox's method, with Student's distribution: Olsson: Confidence intervals for the mean
    of a log-normal distribution, Journal of Statistics Education 13, 2005.
    """
    logs, count = np.log(values), len(values)
    mean, variance = float(logs.mean()), float(logs.var(ddof=1))
    middle = mean + 0.5 * variance
    student = float(stdtrit(count - 1, 0.5 + 0.5 * confidence))
    half = student * math.sqrt(variance / count + variance**2 / (2.0 * (count - 1)))
    # Cut before exp: few runs that differ much have ends whose exponential is no float.
    low, high = (math.exp(min(middle + side * half, 0.0)) for side in (-1.0, 1.0))
    return (low, high), math.sqrt(variance)


def _run(
    space: Space, target: float, effort: Effort, random: np.random.Generator
) -> Generator[Array, Array, Run]:
    """One run: yields points that need a score, is sent the scores, returns the result."""
    count = effort.particles
    points = random.standard_normal((count, space.dimension))
    scores = yield points
    evaluations, probability, reached = count, 1.0, math.inf
    levels = list[Level]()
    accepted, step, stuck = math.nan, _FIRST, ""
    while True:
        level = float(np.sort(scores)[round(effort.share * count) - 1])
        kept = scores <= max(level, target)
        share = float(kept.mean())
        if not level <= target:
            stuck = _stuck(level, reached, share, len(levels), effort)
        levels.append(Level(reached, 0.0 if stuck else share, accepted, step))
        probability *= levels[-1].share
        if level <= target or stuck:
            break
        reached = level
        points, scores, accepted, step, flown = yield from _refill(
            space, (points[kept], scores[kept]), count, level, step, random
        )
        evaluations += flown
    best = int(np.argmin(scores))
    return Run(
        probability=probability,
        levels=tuple(levels),
        evaluations=evaluations,
        least=float(scores[best]),
        point=points[best],
        stuck=stuck,
    )


def _stuck(level: float, before: float, share: float, done: int, effort: Effort) -> str:
    if share == 1.0 or not level < before:
        return f"the score stays at {level:.4g}, whatever the random numbers are"
    if done >= effort.levels:
        return f"after {done} levels the score is still {level:.4g}"
    return ""


def _refill(
    space: Space,
    seeds: tuple[Array, Array],
    count: int,
    level: float,
    step: float,
    random: np.random.Generator,
) -> Generator[Array, Array, tuple[Array, Array, float, float, int]]:
    """Chains from the seeds until there are ``count`` points; acceptance, next step, evaluations.

    All chains move at once; if fewer moves are missing than there are chains, some drawn by lot.
    """
    points, scores = seeds
    kept = [seeds]
    moved = taken = batch = 0
    flown = missing = count - len(points)
    while missing > 0:
        if missing < len(points):
            lot = random.permutation(len(points))[:missing]
            points, scores = points[lot], scores[lot]
        candidates, small = _moved(space, points, step, random)
        found = yield candidates
        missing -= len(candidates)
        ok = found <= level
        points = np.where(ok[:, None], candidates, points)
        scores = np.where(ok, found, scores)
        kept.append((points, scores))
        if small.any():
            batch += 1
            moved, taken = moved + int(small.sum()), taken + int((ok & small).sum())
            change = (float((ok & small).sum() / small.sum()) - _ACCEPTED) / math.sqrt(batch)
            step = min(step * math.exp(change), _LARGEST)
    accepted = taken / moved if moved else math.nan
    points, scores = (np.concatenate(parts) for parts in zip(*kept, strict=True))
    return points, scores, accepted, step, flown


def _moved(
    space: Space, points: Array, step: float, random: np.random.Generator
) -> tuple[Array, Flags]:
    """Candidates, and which of them were moved a little instead of drawn anew in part."""
    fresh: Array = random.standard_normal((len(points), space.dimension))
    near = math.sqrt(1.0 - step * step) * points + step * fresh
    first = space.dimension - space.redrawn
    if not space.redrawn:
        return near, np.ones(len(points), dtype=bool)
    share = 1.0 if first == 0 else _REDRAWS
    anew: Flags = np.asarray(random.random(len(points)) < share)
    candidates = points.copy()
    candidates[~anew, :first] = near[~anew, :first]
    candidates[anew, first:] = fresh[anew, first:]
    return candidates, ~anew
