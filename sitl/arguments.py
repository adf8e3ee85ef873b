"""Command line of the simulator."""

from __future__ import annotations

from argparse import ArgumentTypeError
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from command_line.options import (
    ContradictionError,
    Option,
    declared,
    events,
    json_file,
    option,
    switch,
)
from command_line.values import known, number, one_of, place, seconds, whole
from sitl.earth import DEFAULT_ORIGIN, Place
from sitl.scenario_file import PERFECT, SUITE_NAMES, scenario_names

SLOWEST: Final = 0.05  # below it a step in lockstep would take longer than the stall time allows
_FASTEST: Final = 1e6
ORIGIN: Final = Option(
    "--origin LAT,LON,ALT",
    "origin of the local frame, in degrees and metres above sea level, for satellites and "
    "barometer; a negative latitude needs --origin=LAT,LON,ALT",
    lambda text: Place(*place(text)),
    default=DEFAULT_ORIGIN,
    text=lambda origin: ",".join(map(repr, origin)),
)


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


def rate(text: str) -> int:
    """A rate of the exchange with PX4 [Hz]."""
    if text not in ("250", "500"):
        raise ArgumentTypeError(f"{text!r} is neither 250 nor 500")
    return int(text)


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions:
    """Options shared by every way to start a simulated flight."""

    scenario: str = option(
        "SCENARIO", "name or path of a .toml file", known(*scenario_names()), default="walls"
    )
    seed: int = option("--seed N", "root of all randomness", whole(), default=0)
    duration_s: float | None = option(
        "--duration S", "seconds to fly (default the scenario's)", seconds
    )
    sensors: str | None = option(
        "--sensors SUITE",
        f"sensors of the vehicle: {', '.join(SUITE_NAMES)} (default the scenario's)",
        one_of("suite", *SUITE_NAMES),
    )
    vehicle: str | None = option(
        "--vehicle NAME",
        "vehicle that flies: one that comes with Pandion, or a .toml file (default the scenario's)",
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

    autopilot: str = option(
        "--for AUTOPILOT",
        "who flies: pandion, or px4, whose simulator it is then",
        one_of("autopilot", "pandion", "px4"),
        default="pandion",
    )
    listen: str | None = option(
        "--listen ADDRESS",
        "where the autopilot finds it: udp:HOST:PORT (default udp:127.0.0.1:4560), "
        "for px4 tcp:HOST:PORT (default tcp:127.0.0.1:4560)",
    )
    rate_hz: int = option("--rate HZ", "for px4: steps a second, 250 or 500", rate, default=250)
    companion: str | None = option(
        "--companion udp:HOST:PORT",
        "for px4: the arm's link of a planner above it, which is told the joints' angles, the "
        "trajectory and the safe set",
    )
    wait_s: float = option(
        "--wait S", "how long to wait for the flight software, in seconds", seconds, default=60.0
    )
    origin: Place = declared(ORIGIN)
    json: str | None = json_file("the result")
    out: Path | None = option("--out DIR", "directory for sitl.json", Path)
    events: str = events()

    @property
    def for_px4(self) -> bool:
        """Whether PX4 flies."""
        return self.autopilot == "px4"

    def __post_init__(self) -> None:
        """Refuse a contradictory choice; raises ContradictionError."""
        if not self.for_px4:
            if self.rate_hz != 250:
                raise ContradictionError("--rate is of the exchange with PX4; add --for px4")
            if self.companion is not None:
                raise ContradictionError("--companion stands beside PX4; add --for px4")
        elif self.realtime:
            raise ContradictionError(
                "--for px4 is in lockstep with PX4; --speed 1 is real time, without --realtime"
            )
        elif self.sensors == PERFECT:
            raise ContradictionError(
                "--sensors perfect: PX4 takes sensors without noise for stuck; "
                f"choose {', '.join(name for name in SUITE_NAMES if name != PERFECT)}"
            )
