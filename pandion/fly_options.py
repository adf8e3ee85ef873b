"""Command line of ``pandion fly``, checked as far as that goes before a process is started."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

from fsw.arguments import (
    add_control_arguments,
    add_link_arguments,
    add_params_argument,
    control_choice,
    link_choice,
)
from fsw.link.link_choice import LinkChoice, addresses
from fsw.log.run_directory import new_run_directory
from fsw.parameters.control_choice import ControlChoice, check
from sitl.arguments import add_run_arguments
from sitl.scenario_file import ScenarioError, load_scenario, scenario_digest


@dataclass(frozen=True, slots=True)
class FlyOptions:
    """One flight."""

    scenario: str
    scenario_name: str
    scenario_digest: str
    seed: int
    duration_s: float
    realtime: bool
    speed: float | None  # None: as fast as possible
    control: ControlChoice
    params: Path | None
    links: LinkChoice
    out: Path
    json: str | None


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare every option."""
    add_run_arguments(parser)
    add_control_arguments(parser)
    add_params_argument(parser)
    add_link_arguments(parser)
    parser.add_argument(
        "--out", metavar="DIR", type=Path, help="where logs go (default a new one in runs/)"
    )
    parser.add_argument("--json", metavar="FILE", help="write the result; - for standard output")


def options(arguments: argparse.Namespace) -> FlyOptions:
    """Check everything that can be checked before a process is started.

    Raises:
        ValueError: There is no such controller, inner loop, lambda or solver.
        ScenarioError: There is no such scenario.
        LinkError: An address of a link is none.
        OSError: The directory for the logs cannot be made.
    """
    control = control_choice(arguments)
    check(control)
    scenario = load_scenario(arguments.scenario)
    links = link_choice(arguments)
    addresses(links)
    if arguments.json not in (None, "-") and Path(arguments.json).is_dir():
        raise IsADirectoryError(f"cannot write {arguments.json}: it is a directory")
    if arguments.json not in (None, "-") and not Path(arguments.json).parent.is_dir():
        raise NotADirectoryError(f"cannot write {arguments.json}: its directory does not exist")
    if arguments.realtime and arguments.speed not in (None, 1.0):
        raise ScenarioError("--realtime flies at speed 1; --speed needs --lockstep")
    return FlyOptions(
        scenario=arguments.scenario,
        scenario_name=scenario.name,
        scenario_digest=scenario_digest(arguments.scenario),
        seed=arguments.seed,
        duration_s=scenario.duration_s if arguments.duration is None else arguments.duration,
        realtime=arguments.realtime,
        speed=arguments.speed,
        control=control,
        params=arguments.params,
        links=links,
        out=_directory(arguments.out, f"{scenario.name}-seed{arguments.seed}"),
        json=arguments.json,
    )


def _directory(wanted: Path | None, stem: str) -> Path:
    if wanted is None:
        return new_run_directory(Path("runs"), stem)
    wanted.mkdir(parents=True, exist_ok=True)
    if any((wanted / name).exists() for name in ("result.json", "flight.tlog", "flight.ulg")):
        raise FileExistsError(f"{wanted} already holds a flight; name another --out")
    return wanted
