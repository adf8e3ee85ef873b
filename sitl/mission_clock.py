"""When the trajectory runs, and where the end-effector should be."""

from __future__ import annotations

import math

import numpy as np

from sitl.heading import Heading
from sitl.scenario import V3, Scenario
from sitl.trajectory import TrajectoryPoint, curve_row, reference


class MissionClock:
    """Turns time since the start of the simulation into trajectory time.

    A vehicle that starts in the air is asked to hold the first point until the trajectory
    begins; one that starts on the ground is not asked to follow one.
    """

    def __init__(self, scenario: Scenario) -> None:
        airborne = scenario.start.kind == "airborne"
        self.reference = reference(scenario.trajectory)
        self._heading = Heading(scenario, self.reference)
        self.curve = np.array(curve_row(scenario.trajectory))  # the same for compiled code
        self.starts_s: float | None = scenario.pilot.start_delay_s if airborne else None
        self.stops_s = math.inf

    def stop(self, time_s: float) -> None:
        """From ``time_s`` on the trajectory is no longer asked for."""
        self.stops_s = time_s

    def counts(self, time_s: float) -> bool:
        """Whether the vehicle should be on the reference at ``time_s``."""
        return self.starts_s is not None and time_s < self.stops_s

    def target_at(self, time_s: float) -> TrajectoryPoint:
        """End-effector reference at ``time_s``; its first point where there is no start."""
        return self.reference.at(0.0 if self.starts_s is None else time_s - self.starts_s)

    def place_at(self, time_s: float) -> V3:
        """The place [m, NED] of ``target_at`` alone."""
        return self.reference.place(0.0 if self.starts_s is None else time_s - self.starts_s)

    def yaw_at(self, time_s: float) -> float:
        """Yaw of the reference at ``time_s`` [rad]."""
        return self._heading.at(0.0 if self.starts_s is None else time_s - self.starts_s)
