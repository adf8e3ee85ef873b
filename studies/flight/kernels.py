"""Compiles what flies and what simulates into the cache on disk, before many processes need it.

Each process would compile for itself otherwise: a minute of each of them, and 1.2 GB that the
compiler leaves behind for as long as it flies.
"""

from __future__ import annotations

import contextlib
import gc
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from typing import Final

import numba

from command_line.compile_progress import CompileProgress
from command_line.kernel_cache import KernelCache
from command_line.output import say as say_line
from fsw.autopilot.parameters.control_choice import ControlChoice

HALVES: Final = ("fsw", "sitl")
_COMPLETE: Final = "campaign"  # the mark of a cache that has all kernels of a half
# Compiling leaves much behind that is not garbage yet: as often as Python looks by itself, looking
# takes 7 % of the time; so, 2.5 %.
_YOUNG: Final = 100_000
_LOOK_S: Final = 0.5
_SAY_S: Final = 10.0

_failed: set[str] = set()  # halves that could not be compiled first by this process


def _on_standard_error(sentence: str) -> None:
    say_line(f"pandion: {sentence}", sys.stderr)


def compile_first(
    say: Callable[[str], None] = _on_standard_error, halves: Sequence[str] = HALVES
) -> None:
    """Compile what is not on disk yet, each half in a process of its own, and wait for it.

    ``say`` takes a sentence. A half that cannot be compiled so is compiled by the first flight,
    which says why it cannot be; no second attempt is made.
    """
    due = [half for half in halves if half not in _failed and _cache(half).is_due(_COMPLETE)]
    if not due or numba.config.DISABLE_JIT:
        return
    progress = CompileProgress()
    for cache in map(_cache, due):
        if cache.folder is not None:
            progress.add(cache.folder, cache.kernels)
    say(f"compiling {sum(_cache(half).kernels for half in due)} kernels before the first flight")
    # In sessions of their own: an interrupt is for this process, which ends them silently.
    running = [
        subprocess.Popen(
            # -P: a directory of the same name where the user stands must not be imported.
            [sys.executable, "-P", "-m", __name__, half, str(os.getpid())],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        for half in due
    ]
    try:
        _wait(running, progress, say)
    finally:
        for one in running:
            one.kill()
            one.wait()
    _failed.update(half for half in due if _cache(half).is_due(_COMPLETE))


def _wait(
    running: list[subprocess.Popen[bytes]], progress: CompileProgress, say: Callable[[str], None]
) -> None:
    said_s = time.monotonic()
    for one in running:
        while True:
            with contextlib.suppress(subprocess.TimeoutExpired):
                one.wait(_LOOK_S)
                break
            seen = progress.look()
            if seen is not None and time.monotonic() - said_s >= _SAY_S:
                say(f"compiling: {seen[2]}")
                said_s = time.monotonic()


def compile_half(half: str, *, above_px4: bool = False) -> None:
    """Build what flies, or what simulates; either compiles all that it calls.

    And what flies above PX4, if that is wanted: of laws that this process has compiled, 5 s; in a
    process of its own, 17 s.
    """
    _build(half)
    if above_px4:
        _build_above_px4()
    cache = _cache(half)
    cache.note(_COMPLETE)
    cache.note(ControlChoice().kernels if half == "fsw" else "flight")


def _cache(half: str) -> KernelCache:
    from fsw import compiled as fsw
    from sitl import compiled as sitl

    return {"fsw": fsw.cache, "sitl": sitl.cache}[half]()


def _build(half: str) -> None:
    if half == "fsw":
        from fsw.autopilot.flight.autopilot import Autopilot
        from fsw.autopilot.mpc.planner import Planner
        from fsw.autopilot.parameters.flight_config import flight_config
        from studies.flight.result import processor_time_us

        config = flight_config()
        Planner(config.planner, config.airframe, processor_time_us).warm_up()
        Autopilot(config).warm_up()
    else:
        from sitl.rehearsal import rehearse
        from sitl.scenario_file import load_scenario
        from sitl.simulation import Simulation

        rehearse(Simulation(load_scenario("walls", "mocap"), 0))


def _build_above_px4() -> None:
    from fsw.autopilot.flight.autopilot import Autopilot
    from fsw.autopilot.parameters.flight_config import above_px4, flight_config

    Autopilot(above_px4(flight_config())).warm_up()


if __name__ == "__main__":
    from fsw.runtime.process import die_with_parent, pin_numerics_to_one_thread

    # Who has started it may be gone before the imports are over, and says who it is.
    die_with_parent(int(sys.argv[2]) if sys.argv[2:3] and sys.argv[2].isdigit() else os.getppid())
    pin_numerics_to_one_thread()
    gc.set_threshold(_YOUNG)
    compile_half(sys.argv[1], above_px4="px4" in sys.argv[2:])
