"""Command line of the simulator."""

from __future__ import annotations

from argparse import ArgumentTypeError
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from command_line.options import events, json_file, option, switch
from command_line.values import number, one_of, place, seconds, whole
from sitl.earth import DEFAULT_ORIGIN, Place
from sitl.scenario_file import SUITE_NAMES

SLOWEST: Final = 0.05  # below it a step in lockstep would take longer than the stall time allows
_FASTEST: Final = 1e6


def speed(text: str) -> float | None:
    """A speed factor; None for max."""
    if text == "max":
        return None
    try:
        return number(SLOWEST, _FASTEST, "")(text)
    except ArgumentTypeError:
        raise ArgumentTypeError(
            f"{text!r} is neither max nor a number from {SLOWEST:g} to {_FASTEST:g}"
        ) from None


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions:
    """Options shared by every way to start a simulated flight."""

    scenario: str = option("SCENARIO", "name or path of a .toml file", default="walls")
    seed: int = option("--seed N", "root of all randomness", whole(), default=0)
    duration_s: float | None = option(
        "--duration S", "seconds to fly (default the scenario's)", seconds
    )
    sensors: str | None = option(
        "--sensors SUITE",
        f"sensors of the vehicle: {', '.join(SUITE_NAMES)} (default the scenario's)",
        one_of("suite", *SUITE_NAMES),
    )
    realtime: bool = switch(
        "--realtime",
        "the simulator keeps real time and does not wait for the flight software",
        off="--lockstep",
    )
    # None: as fast as possible.
    speed: float | None = option(
        "--speed X", "lockstep: times real time, or max (default max)", speed
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SitlOptions(RunOptions):
    """What the simulator is started with."""

    listen: str = option(
        "--listen udp:HOST:PORT",
        "address on which the flight software finds it",
        default="udp:127.0.0.1:4560",
    )
    wait_s: float = option(
        "--wait S", "how long to wait for the flight software, in seconds", seconds, default=60.0
    )
    origin: Place = option(
        "--origin LAT,LON,ALT",
        "origin of the local frame, in degrees and metres above sea level, for satellites and "
        "barometer; a negative latitude needs --origin=LAT,LON,ALT",
        lambda text: Place(*place(text)),
        default=DEFAULT_ORIGIN,
        text=lambda origin: ",".join(map(repr, origin)),
    )
    json: str | None = json_file("the result")
    out: Path | None = option("--out DIR", "directory for sitl.json", Path)
    events: str = events()
