"""Command line of the flight software."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from command_line.options import Option, declared, events, group, option
from command_line.values import seconds, whole
from fsw.autopilot.parameters.control_choice import ControlChoice
from fsw.link.link_choice import LinkChoice

PARAMS: Final = Option(
    "--params FILE",
    "start with the parameters in FILE and keep changes there (default: the defaults, "
    "and changes end with the flight)",
    Path,
)
OUT: Final = Option("--out DIR", "directory for logs (default a new one in runs/)", Path)


@dataclass(frozen=True, slots=True, kw_only=True)
class FswOptions:
    """What the flight software is started with."""

    sim: str = option(
        "--sim udp:HOST:PORT",
        "address on which the simulator listens",
        default="udp:127.0.0.1:4560",
    )
    links: LinkChoice = group(LinkChoice)
    control: ControlChoice = group(ControlChoice)
    vehicle: str = option(
        "--vehicle NAME",
        "vehicle that it flies: one that comes with Pandion, or a .toml file",
        default="paper",
    )
    params: Path | None = declared(PARAMS)
    out: Path | None = declared(OUT)
    wait_s: float = option(
        "--wait S", "how long to wait for the simulator, in seconds", seconds, default=30.0
    )
    events: str = events()
    # For the log only: what the simulator flies.
    scenario: str = option(
        "--scenario NAME", "name of the scenario, noted in the flight log", default=""
    )
    scenario_digest: str = option(
        "--scenario-digest HEX", "digest of its file, noted in the flight log", default=""
    )
    seed: int | None = option("--seed N", "the simulator's seed, noted in the flight log", whole())

    def __post_init__(self) -> None:
        """Refuse a contradictory choice; raises ContradictionError."""
        self.control.check()
