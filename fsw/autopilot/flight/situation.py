"""What is decided on: by commands, arming checks, the needs of modes, and the failsafe table."""

from __future__ import annotations

import math

from fsw.autopilot.flight.state import FlightState, MissionMemory, VehicleMemory
from fsw.autopilot.parameters.flight_config import FlightConfig, FlightLimits
from fsw.autopilot.signals import Mode, Sender, StateEstimate
from fsw.frozen import dataclass


@dataclass(frozen=True, slots=True)
class Situation:
    """All that the vehicle knows, and its limits."""

    state: FlightState
    estimate: StateEstimate
    config: FlightConfig
    against: str = ""  # which parameters contradict each other, whatever the safe set
    heaviest: float = math.inf  # kg, of a payload that is safe
    sender: Sender | None = None  # of the command that is decided on, if one is
    known: bool = True  # there has been an estimate; else this one says nothing

    @property
    def limits(self) -> FlightLimits:
        """Timeouts, and the parameters of actions."""
        return self.config.limits

    @property
    def vehicle(self) -> VehicleMemory:
        """Mode and what belongs to it."""
        return self.state.vehicle

    @property
    def mission(self) -> MissionMemory:
        """The uploaded mission, targets and safe set."""
        return self.state.mission

    @property
    def mode(self) -> Mode:
        """What is flown."""
        return self.state.vehicle.mode

    @property
    def landed(self) -> bool:
        """Whether it stands on the ground."""
        return self.state.vehicle.landed

    @property
    def estimate_is_valid(self) -> bool:
        """Whether the estimate is one of now."""
        return self.known and self.state.invalid_ticks == 0

    @property
    def contradiction(self) -> str:
        """Which parameters contradict each other, or the safe set in force; empty: none."""
        refusals = self.mission.refusals
        return "; ".join((self.against, *refusals) if self.against else refusals)
