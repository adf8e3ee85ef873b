"""When the trajectory runs, and where the end-effector should be."""

from __future__ import annotations

import math

from sitl.scenario import Scenario
from sitl.trajectory import TrajectoryPoint, curve_row, reference


class MissionClock:
    """Turns time since the start of the simulation into trajectory time.

    A vehicle that starts in the air is asked to hold the first point until the trajectory
    begins; one that starts on the ground waits for the pilot.
    """

    def __init__(self, scenario: Scenario) -> None:
        airborne = scenario.start.kind == "airborne"
        self.reference = reference(scenario.trajectory)
        self.curve = curve_row(scenario.trajectory)  # the same for compiled code
        self.starts_s: float | None = scenario.pilot.start_delay_s if airborne else None
        self.stops_s = math.inf
        self._counts_from_s = 0.0 if airborne else math.inf

    def start(self, time_s: float) -> None:
        """The trajectory begins at ``time_s``."""
        self.starts_s = time_s
        self._counts_from_s = min(self._counts_from_s, time_s)

    def stop(self, time_s: float) -> None:
        """From ``time_s`` on the trajectory is no longer asked for."""
        self.stops_s = time_s

    def counts(self, time_s: float) -> bool:
        """Whether the vehicle should be on the reference at ``time_s``."""
        return self._counts_from_s <= time_s < self.stops_s

    def target_at(self, time_s: float) -> TrajectoryPoint:
        """End-effector reference at ``time_s``; its first point while the start is open."""
        return self.reference.at(0.0 if self.starts_s is None else time_s - self.starts_s)
