"""Command line of the flight software."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

from fsw.link.link_choice import AUTOPILOTS, LinkChoice, parse_origin
from fsw.parameters.control_choice import ControlChoice
from fsw.signals import Origin


def add_control_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what flies."""
    parser.add_argument(
        "--controller",
        metavar="NAME",
        default="blf",
        help="predictive controller: blf, hc, sc or naive (default %(default)s)",
    )
    parser.add_argument(
        "--inner",
        metavar="NAME",
        default="tracking",
        help="fast loop, tracking or pid (default %(default)s)",
    )
    parser.add_argument(
        "--robustness",
        metavar="NAME",
        default="consistent",
        help="lambda of the barrier: consistent, or the paper's, paper-1 or paper-5, which "
        "need --soft (default %(default)s)",
    )
    parser.add_argument(
        "--solver",
        metavar="NAME",
        default="clarabel",
        help="optimiser: clarabel or the paper's slsqp (default %(default)s)",
    )
    parser.add_argument(
        "--soft",
        action="store_true",
        help="fly a configuration that cannot keep its safe set, with a warning",
    )


def control_choice(arguments: argparse.Namespace) -> ControlChoice:
    """What flies, as one value."""
    return ControlChoice(
        controller=arguments.controller,
        inner=arguments.inner,
        robustness=arguments.robustness,
        solver=arguments.solver,
        soft=arguments.soft,
    )


def add_params_argument(parser: argparse.ArgumentParser) -> None:
    """Declare where parameters are kept."""
    parser.add_argument(
        "--params",
        metavar="FILE",
        type=Path,
        help="start with the parameters in FILE and keep changes there (default: the defaults, "
        "and changes end with the flight)",
    )


def add_link_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the links to the ground."""
    default = LinkChoice()
    parser.add_argument(
        "--gcs",
        metavar="udp:HOST:PORT",
        default=default.gcs,
        help="ground station: where telemetry goes (default %(default)s)",
    )
    parser.add_argument(
        "--api",
        metavar="udp:HOST:PORT",
        default=default.api,
        help="program, such as one with MAVSDK, or none (default %(default)s)",
    )
    parser.add_argument(
        "--allow-remote",
        action="store_true",
        help="hear other machines even while telemetry goes to this one",
    )
    parser.add_argument(
        "--autopilot",
        choices=tuple(AUTOPILOTS),
        default=default.autopilot,
        help="what the vehicle says it is (default %(default)s)",
    )
    parser.add_argument(
        "--origin",
        metavar="LAT,LON,ALT",
        type=_origin,
        default=default.origin,
        help="where on Earth the local frame begins, degrees and metres above the sea "
        "(default 47.397742,8.545594,0); a negative latitude needs --origin=LAT,LON,ALT",
    )
    parser.add_argument(
        "--keys",
        metavar="DIR",
        type=Path,
        help="where signing keys are kept (default ~/.local/state/pandion)",
    )


def _origin(text: str) -> Origin:
    try:
        return parse_origin(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def link_choice(arguments: argparse.Namespace) -> LinkChoice:
    """The links to the ground, as one value."""
    return LinkChoice(
        gcs=arguments.gcs,
        api=arguments.api,
        allow_remote=arguments.allow_remote,
        autopilot=arguments.autopilot,
        origin=arguments.origin,
        keys=arguments.keys,
    )


@dataclass(frozen=True, slots=True)
class FswOptions:
    """What the flight software is started with."""

    sim: str  # udp:HOST:PORT of the simulator
    links: LinkChoice
    control: ControlChoice
    out: Path | None  # None: a new directory under runs/
    wait_s: float  # for the simulator
    params: Path | None  # file that keeps the parameters; None: they end with the flight
    events: str  # "text" for people, "json" for programs
    scenario: str = ""  # for the log only: what the simulator flies
    scenario_digest: str = ""  # for the log only: which of the scenarios of this name
    seed: int | None = None  # for the log only


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare every option of the flight software."""
    parser.add_argument(
        "--sim",
        metavar="udp:HOST:PORT",
        default="udp:127.0.0.1:4560",
        help="where the simulator listens (default %(default)s)",
    )
    add_link_arguments(parser)
    add_control_arguments(parser)
    add_params_argument(parser)
    parser.add_argument(
        "--out", metavar="DIR", type=Path, help="where logs go (default a new one in runs/)"
    )
    parser.add_argument(
        "--wait",
        metavar="S",
        type=float,
        default=30.0,
        help="how long to wait for the simulator (default %(default)g s)",
    )
    parser.add_argument(
        "--events",
        choices=("text", "json"),
        default="text",
        help="how to report on standard output (default %(default)s)",
    )
    parser.add_argument(
        "--scenario", metavar="NAME", default="", help="what is flown, noted in the flight log"
    )
    parser.add_argument(
        "--scenario-digest", metavar="HEX", default="", help="of its file, noted in the flight log"
    )
    parser.add_argument(
        "--seed", metavar="N", type=int, help="the simulator's seed, noted in the flight log"
    )


def options(arguments: argparse.Namespace) -> FswOptions:
    """The options as one value."""
    return FswOptions(
        sim=arguments.sim,
        links=link_choice(arguments),
        control=control_choice(arguments),
        out=arguments.out,
        wait_s=arguments.wait,
        params=arguments.params,
        events=arguments.events,
        scenario=arguments.scenario,
        scenario_digest=arguments.scenario_digest,
        seed=arguments.seed,
    )
