"""Options of ``pandion falsify``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from command_line.options import group, json_file, option
from command_line.values import known, number, whole
from pandion.cluster_options import ClusterOptions
from pandion.own_options import OwnOptions
from sitl.scenario_file import scenario_names


@dataclass(frozen=True, slots=True, kw_only=True)
class FalsifyOptions:
    """One search, or one disturbance of an earlier one."""

    scenario: str = option(
        "SCENARIO", "name or path of a .toml file", known(*scenario_names()), default="walls"
    )
    evaluations: int = option(
        "--evaluations N",
        "stretches of 5 s to fly, a tenth of them with the whole stack; with --over whole flights",
        whole(1, 1_000_000),
        default=2000,
    )
    seed: int = option("--seed N", "root of the search's random numbers", whole(), default=0)
    amplitude: float = option(
        "--amplitude A",
        "of the disturbance on each axis, in m/s^2",
        number(0.001, 50.0, "m/s^2"),
        default=0.8,
    )
    over: Path | None = option(
        "--over FILE.toml",
        "search for the smallest margin over what a campaign file varies, in whole flights and not "
        "along a recorded plan",
        Path,
    )
    keep: int = option("--keep N", "with --over: how many finds to keep", whole(1, 1000), default=5)
    generation: int = option(
        "--generation N",
        "with --over: flights of a generation, at least; as many can be flown at once, and the "
        "result depends on it (default by the numbers searched: 7 of three, 19 of two hundred)",
        whole(1, 100_000),
        default=1,
    )
    params: Path | None = option(
        "--params FILE", "parameters that differ from the defaults, without --over", Path
    )
    cluster: ClusterOptions = group(ClusterOptions)
    own: OwnOptions = group(OwnOptions)
    replay: Path | None = option(
        "--replay FILE", "fly a worst.json of an earlier search with planner and referee", Path
    )
    json: str | None = json_file("the result")
    out: Path | None = option(
        "--out DIR", "where what was found goes (default a new directory in runs/)", Path
    )
