"""Compile the kernels of one half into the cache on disk, before tests that need them run."""

from __future__ import annotations

import gc
import sys

# Compiling leaves much behind that is not garbage yet: as often as Python looks by itself, looking
# takes 7 % of the time; so, 2.5 %.
YOUNG = 100_000


def compile_kernels(half: str) -> None:
    """Build what flies, or what simulates; either compiles all that it calls."""
    if half == "fsw":
        from fsw.flight.autopilot import Autopilot
        from fsw.parameters.control_choice import ControlChoice
        from fsw.parameters.flight_config import flight_config
        from fsw.runtime.assembly import flight_software

        flight_software(ControlChoice())
        Autopilot(flight_config()).quiet_ticks()  # of studies alone
    else:
        from sitl.flight import rehearse
        from sitl.scenario_file import load_scenario
        from sitl.simulation import Simulation

        rehearse(Simulation(load_scenario("walls", "mocap"), 0))


if __name__ == "__main__":
    gc.set_threshold(YOUNG)
    compile_kernels(sys.argv[1])
