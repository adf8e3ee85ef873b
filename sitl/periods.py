"""The period of the simulation; everything that is counted in its steps derives from it."""

from typing import Final

STEP_US: Final = 2_000  # one exchange with the flight software, which ticks as often
