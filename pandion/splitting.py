"""``pandion splitting``: the probability of a margin that plain flights never fall below."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from command_line.options import group, json_file, option, read
from command_line.output import json_text
from command_line.values import number, whole
from pandion.campaign_run import begin, exit_code
from pandion.cluster_options import ClusterOptions

if TYPE_CHECKING:
    from studies.statistics.rare_flights import FlightScore
    from studies.statistics.splitting import Estimate

FOUND, NOT_FOUND = 0, 1  # exit codes


@dataclass(frozen=True, slots=True, kw_only=True)
class SplittingOptions:
    """One probability."""

    file: Path = option("FILE.toml", "a campaign file with one configuration", Path, required=True)
    threshold_mm: float = option(
        "--threshold MM",
        "the event is a minimum margin below this, in millimetres",
        number(-1e5, 1e5, "mm"),
        default=0.0,
    )
    particles: int = option(
        "--particles N", "flights a level, in each run", whole(50, 1_000_000), default=600
    )
    runs: int = option("--runs N", "independent runs", whole(2, 1000), default=5)
    levels: int = option("--levels N", "at most, each a factor of ten", whole(1, 100), default=12)
    confidence: float = option(
        "--confidence P", "of the interval", number(0.5, 0.999, ""), default=0.95
    )
    seed: int = option("--seed N", "root of all randomness", whole(), default=0)
    cluster: ClusterOptions = group(ClusterOptions)
    out: Path | None = option(
        "--out DIR",
        "where journal and the flight with the minimum margin go; the same command goes on with a "
        "journal that is there (default a new one in runs/)",
        Path,
    )
    json: str | None = json_file("probability, runs and levels")


def main(argv: list[str]) -> int:
    """Estimate; returns the exit code."""
    what = "Estimate how rare a small margin is, by splitting the way to it into levels."
    options = read(SplittingOptions, "pandion splitting", what, argv)

    return exit_code("splitting", lambda: _estimate(options))


def _estimate(options: SplittingOptions) -> int:
    from studies.campaign.plan import load_plan
    from studies.statistics.rare_flights import FlightScore, as_json, only_case, sentences
    from studies.statistics.splitting import Effort, estimate

    plan = load_plan(options.file)
    effort = Effort(particles=options.particles, runs=options.runs, levels=options.levels)
    flights = only_case(plan)
    work = f"{effort.runs} runs of {effort.particles} flights a level"
    run = begin("splitting", plan, work, options.cluster, options.out, options.json)
    score = FlightScore(flights, run.campaign, 1e-3 * options.threshold_mm)
    # About: each level refills nine tenths.
    most = effort.runs * effort.particles * (1.0 + 0.9 * effort.levels)

    def report(done: int, middle: float) -> None:
        margin = 1e3 * (middle + score.threshold_m)
        state = f"{done} flights, middle of the last {margin:+.1f} mm"
        run.display.report("flown", done, most, state)

    with run.flying():
        found = estimate(score, score.space, 0.0, effort, options.confidence, options.seed, report)
    for sentence in sentences(found, score):
        run.display.say(sentence)
    run.display.say(_kept(score, found, run.folder))
    written = run.written(json_text(as_json(found, score), 1) + "\n")
    return FOUND if written and found.reached == len(found.runs) else NOT_FOUND


def _kept(score: FlightScore, found: Estimate, folder: Path) -> str:
    """Write the flight with the minimum margin; the sentence that says how to see it."""
    from studies.flight.fly_again import keep

    run = min(found.runs, key=lambda one: one.least)
    margin = 1e3 * (run.least + score.threshold_m)
    command = keep(
        score.job(run.point),
        score.flights.case.controller,
        folder / "least",
        f"{score.flights.case}: minimum margin {margin:+.1f} mm, found by pandion splitting",
    )
    return f"minimum margin {margin:+.1f} mm: {command}"
