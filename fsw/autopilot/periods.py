"""The periods of the flight software; everything else that has one derives it from these."""

from typing import Final

TICK_US: Final = 2_000  # estimation and control
PLANNING_US: Final = 100_000  # T of the paper: one step of the horizon, and between two plans
HORIZON_US: Final = 500_000  # how far the planner looks ahead, however often it plans
