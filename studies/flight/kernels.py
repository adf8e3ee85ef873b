"""Compiles what flies and what simulates into the cache on disk, before many processes need it.

Each process would compile for itself otherwise: a minute of each of them, and 1.2 GB that the
compiler leaves behind for as long as it flies.
"""

from __future__ import annotations

import gc
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Final

from fsw.parameters.control_choice import ControlChoice

HALVES: Final = ("fsw", "sitl")
_CAMPAIGN: Final = "campaign"
# Compiling leaves much behind that is not garbage yet: as often as Python looks by itself, looking
# takes 7 % of the time; so, 2.5 %.
_YOUNG: Final = 100_000


def compile_first(say: Callable[[str], None]) -> None:
    """Compile what is not on disk yet, each half in a process of its own, and wait for it.

    ``say`` takes a sentence. If a half cannot be compiled, the first flight will say why.
    """
    due = [half for half in HALVES if _is_due(half)]
    if not due:
        return
    say("compiling before the first flight, which takes a minute")
    # In sessions of their own: an interrupt is for this process, which ends them silently.
    running = [
        subprocess.Popen(
            [sys.executable, "-m", __name__, half],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        for half in due
    ]
    try:
        for one in running:
            one.wait()
    finally:
        for one in running:
            one.kill()
            one.wait()


def compile_half(half: str) -> None:
    """Build what flies, or what simulates; either compiles all that it calls."""
    from fsw.compiled import note_compiled

    _build(half)
    note_compiled(_CAMPAIGN, _directory(half))
    if half == "fsw":
        note_compiled(ControlChoice().kernels)


def _is_due(half: str) -> bool:
    from fsw.compiled import compiling_is_due

    return compiling_is_due(_CAMPAIGN, _directory(half))


def _directory(half: str) -> Path:
    from fsw import compiled as fsw
    from sitl import compiled as sitl

    return {"fsw": fsw.kernel_directory, "sitl": sitl.kernel_directory}[half]()


def _build(half: str) -> None:
    if half == "fsw":
        from fsw.flight.autopilot import Autopilot
        from fsw.mpc.planner import Planner
        from fsw.parameters.flight_config import flight_config
        from studies.flight.result import processor_time_us

        config = flight_config()
        Planner(config.planner, config.airframe, processor_time_us).warm_up()
        autopilot = Autopilot(config)
        autopilot.warm_up()
        autopilot.quiet_ticks()
    else:
        from sitl.rehearsal import rehearse
        from sitl.scenario_file import load_scenario
        from sitl.simulation import Simulation

        rehearse(Simulation(load_scenario("walls", "mocap"), 0))


if __name__ == "__main__":
    from fsw.runtime.process import die_with_parent, pin_numerics_to_one_thread

    die_with_parent(os.getppid())
    pin_numerics_to_one_thread()
    gc.set_threshold(_YOUNG)
    compile_half(sys.argv[1])
