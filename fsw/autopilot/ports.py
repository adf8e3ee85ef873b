"""What surrounds the loop: the planner as protocols, facts and timing as data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple, dataclass, field
from typing import TYPE_CHECKING, Protocol

from fsw.autopilot.periods import PLANNING_US, TICK_US
from fsw.autopilot.signals import ActuatorCommand, Plan, PlanFailure, PlanRequest, Vec2

if TYPE_CHECKING:  # it imports numpy, which must not be there before numerics are pinned
    from fsw.autopilot.model.airframe import Airframe

Clock = Callable[[], int]
"""Monotonic wall time [us]. Measures the loop; no law ever sees it."""


class PlanningCycle(Protocol):
    """One planning cycle, with whatever memory it keeps from the last one."""

    def plan(self, request: PlanRequest) -> Plan | PlanFailure:
        """Answer one request; blocks for as long as the optimisation takes."""
        ...


class PlanService(Protocol):
    """The planner as the tick sees it: ask now, look later, never wait."""

    def submit(self, request: PlanRequest) -> None:
        """Take a request; a newer one replaces one that has not been started."""
        ...

    def take(self, t_us: int) -> Plan | PlanFailure | None:
        """Return an answer that is there and due at ``t_us``, once."""
        ...

    def close(self) -> None:
        """Stop planning; what is under way is abandoned."""
        ...


@dataclass(frozen=True, slots=True)
class GroupTiming:
    """Real-time health of one rate group: counts since start, statistics of the last interval."""

    period_us: int
    ticks: int = 0
    late_ticks: int = 0  # ended after the next release
    skipped_ticks: int = 0  # never executed
    execution_p50_us: float = 0.0
    execution_p99_us: float = 0.0
    execution_max_us: float = 0.0
    lateness_p50_us: float = 0.0
    lateness_p99_us: float = 0.0
    lateness_max_us: float = 0.0
    load: float = 0.0  # share of the period spent executing, mean over the interval

    @property
    def shown(self) -> tuple[float, ...]:
        """Counts, period and times, in the order of log and link."""
        period_us, *counts_and_times, _ = astuple(self)
        return (*counts_and_times[:3], period_us, *counts_and_times[3:])


@dataclass(frozen=True, slots=True)
class VehicleFacts:
    """What does not change in flight."""

    airframe: Airframe
    tick_period_us: int
    mpc_period_us: int
    mpc_delay_us: int  # from a request to the first use of its plan
    horizon: int  # steps
    sqp_iterations: int

    def thrust_share(self, command: ActuatorCommand) -> float:
        """What rotors are asked for, of all that they can give [1]."""
        return sum(command.rotor_thrust) / self.airframe.full_thrust


@dataclass(frozen=True, slots=True)
class LinkLosses:
    """What came over the links to the ground and was of no use, since the start."""

    damaged: int = 0  # start markers without a valid frame
    echoes: int = 0  # the vehicle's own frames, sent back by a router
    refused: int = 0  # frames, by their signature
    unhandled: int = 0  # frames of kinds that are of no use here
    overflowed: int = 0  # datagrams that the kernel dropped


@dataclass(slots=True)
class LoopHealth:
    """The latest timing of the rate groups; the loop replaces them once a second."""

    inner: GroupTiming = field(default_factory=lambda: GroupTiming(period_us=TICK_US))
    mpc: GroupTiming = field(default_factory=lambda: GroupTiming(period_us=PLANNING_US))
    telemetry: GroupTiming = field(default_factory=lambda: GroupTiming(period_us=TICK_US))
    housekeeping: GroupTiming = field(default_factory=lambda: GroupTiming(period_us=1_000_000))
    vibration: Vec2 = (0.0, 0.0)  # rad/s, m/s^2: gyro and accelerometer, high-pass filtered
    clipped: int = 0  # readings of one axis of the accelerometer at an end of its range, so far
    losses: LinkLosses = field(default_factory=LinkLosses)  # of all links to the ground
