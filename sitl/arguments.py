"""Command line of the simulator."""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final

SLOWEST: Final = 0.05  # below it a step in lockstep would take longer than the stall time allows


@dataclass(frozen=True, slots=True)
class SitlOptions:
    """What the simulator is started with."""

    scenario: str  # name or path of a .toml file
    listen: str  # udp:HOST:PORT
    seed: int
    duration_s: float | None  # None: the scenario's
    realtime: bool
    speed: float | None  # lockstep: times real time, None as fast as possible
    wait_s: float  # for the flight software
    json: str | None  # result file, "-" for standard output
    out: Path | None  # directory for sitl.json
    events: str  # "text" for people, "json" for programs


def add_run_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what any way to start a simulated flight has in common."""
    parser.add_argument(
        "scenario",
        nargs="?",
        metavar="SCENARIO",
        default="walls",
        help="name or path of a .toml file (default %(default)s)",
    )
    parser.add_argument(
        "--seed", metavar="N", type=seed, default=0, help="root of all randomness (default 0)"
    )
    parser.add_argument(
        "--duration", metavar="S", type=duration, help="seconds to fly (default the scenario's)"
    )
    pacing = parser.add_mutually_exclusive_group()
    pacing.add_argument(
        "--lockstep",
        dest="realtime",
        action="store_false",
        default=False,
        help="simulator and flight software wait for each other (default)",
    )
    pacing.add_argument(
        "--realtime",
        dest="realtime",
        action="store_true",
        help="the simulator paces and waits for nobody",
    )
    parser.add_argument(
        "--speed",
        metavar="X",
        type=speed,
        default=None,
        help="lockstep: times real time, or max (default max)",
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare every option of the simulator."""
    add_run_arguments(parser)
    parser.add_argument(
        "--listen",
        metavar="udp:HOST:PORT",
        default="udp:127.0.0.1:4560",
        help="where the flight software finds it (default %(default)s)",
    )
    parser.add_argument(
        "--wait",
        metavar="S",
        type=duration,
        default=60.0,
        help="how long to wait for the flight software (default %(default)g s)",
    )
    parser.add_argument("--json", metavar="FILE", help="write the result; - for standard output")
    parser.add_argument("--out", metavar="DIR", type=Path, help="write sitl.json there")
    parser.add_argument(
        "--events",
        choices=("text", "json"),
        default="text",
        help="how to report on standard output (default %(default)s)",
    )


def options(arguments: argparse.Namespace) -> SitlOptions:
    """The options as one value."""
    return SitlOptions(
        scenario=arguments.scenario,
        listen=arguments.listen,
        seed=arguments.seed,
        duration_s=arguments.duration,
        realtime=arguments.realtime,
        speed=arguments.speed,
        wait_s=arguments.wait,
        json=arguments.json,
        out=arguments.out,
        events=arguments.events,
    )


def seed(text: str) -> int:
    """A seed: a whole number from 0 to 2^63 - 1."""
    if not text.isdecimal() or int(text) >= 1 << 63:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number of 0 or more")
    return int(text)


def duration(text: str) -> float:
    """A positive number of seconds."""
    value = _number(text)
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a positive number of seconds")
    return value


def speed(text: str) -> float | None:
    """A speed factor; None for max."""
    if text == "max":
        return None
    value = _number(text)
    if not SLOWEST <= value < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is neither max nor a number from {SLOWEST}")
    return value


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
