"""Command line of the flight software."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from command_line.options import ContradictionError, Option, declared, events, group, option, switch
from command_line.values import seconds, whole
from fsw.autopilot.parameters.control_choice import ControlChoice
from fsw.link.link_choice import LinkChoice

PARAMS: Final = Option(
    "--params FILE",
    "start with the parameters in FILE and keep changes there (default: the defaults, "
    "and changes end with the flight)",
    Path,
)
# Where ground stations and programs find PX4 itself, and where its planner is found beside it.
_BESIDE: Final = {
    "udp:127.0.0.1:14550": "udp:127.0.0.1:14551",
    "udp:127.0.0.1:14540": "udp:127.0.0.1:14541",
}
OUT: Final = Option("--out DIR", "directory for logs (default a new one in runs/)", Path)


@dataclass(frozen=True, slots=True, kw_only=True)
class FswOptions:
    """What the flight software is started with."""

    sim: str = option(
        "--sim udp:HOST:PORT",
        "address on which the simulator listens",
        default="udp:127.0.0.1:4560",
    )
    autopilot_link: str | None = option(
        "--autopilot-link ADDRESS",
        "be the planner above PX4, the companion computer, in place of --sim: udp:HOST:PORT, "
        "tcp:HOST:PORT or serial:DEVICE:BAUD of PX4",
    )
    arm_link: str | None = option(
        "--arm-link ADDRESS",
        "with --autopilot-link: where the arm tells its joints, udp:HOST:PORT (listens), "
        "tcp:HOST:PORT, tcpin:HOST:PORT or serial:DEVICE:BAUD (default none: they are PX4's "
        "servos and believed where they are sent)",
    )
    arm_servos: bool = switch(
        "--arm-servos", "with --arm-link: PX4 moves the joints, by DO_SET_ACTUATOR, all the same"
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
        if self.autopilot_link is None:
            if self.arm_link is not None or self.arm_servos:
                raise ContradictionError("--arm-link is beside PX4; add --autopilot-link ADDRESS")
        elif self.control.tracking != "lqr" or self.control.controller != "blf":
            raise ContradictionError(
                "above PX4 the loops are PX4's and the controller is blf; leave --tracking and "
                "--controller out"
            )
        elif self.arm_servos and self.arm_link is None:
            raise ContradictionError(
                "--arm-servos goes with --arm-link; without that they are anyway"
            )

    @property
    def above_px4(self) -> bool:
        """Whether PX4 flies, and is told where."""
        return self.autopilot_link is not None

    @property
    def flown(self) -> ControlChoice:
        """What flies, with PX4's loops in place of ours where they are."""
        return replace(self.control, tracking="px4") if self.above_px4 else self.control

    @property
    def ground(self) -> LinkChoice:
        """The links to the ground; above PX4 those that are not chosen keep off PX4's own ports."""
        links = self.links
        if not self.above_px4:
            return links
        gcs = _BESIDE.get(links.gcs, links.gcs)
        return replace(links, gcs=gcs, api=_BESIDE.get(links.api, links.api))
