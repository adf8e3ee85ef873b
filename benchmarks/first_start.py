"""``python -m benchmarks first_start``: what compiling costs the first flight, by kernel."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from typing import Any

from command_line.output import json_text
from command_line.parser import Parser

PROCESSES = ("fsw", "sitl")
ROWS = 40  # of the table; the rest is one line


def main(argv: list[str]) -> int:
    """Print the table; returns the exit code."""
    Parser(
        "python -m benchmarks first_start", "Time what the first flight compiles, by kernel."
    ).read(argv)
    for process in PROCESSES:
        print("\n".join(lines(process, compiled_from_nothing(process))), flush=True)
    return 0


def compiled_from_nothing(process: str) -> dict[str, Any]:
    """CPU seconds of one process's start with nothing on disk, and of each compilation in it."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "NUMBA_CACHE_DIR": folder}
        command = [sys.executable, "-m", "benchmarks.first_start", process]
        run = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return dict(json.loads(run.stdout))


def lines(process: str, found: dict[str, Any]) -> list[str]:
    """The table of a process: kernels by the CPU time that they take without those they call."""
    own, times = defaultdict[str, float](float), defaultdict[str, int](int)
    for name, seconds in found["compiled"]:
        own[name] += seconds
        times[name] += 1
    again = {name: own[name] * (1 - 1 / times[name]) for name in own if times[name] > 1}
    rows = sorted(own, key=lambda name: -own[name])
    table = [f"{own[name]:7.2f} {times[name]:3}   {name}" for name in rows[:ROWS]]
    table.append(f"{sum(own[name] for name in rows[ROWS:]):7.2f}       {len(rows[ROWS:])} others")
    return [
        f"{process}: {found['cpu_s']:.1f} CPU s, of which {sum(own.values()):.1f} for "
        f"{sum(times.values())} compilations of {len(own)} functions; "
        f"{len(again)} of them more than once, which is {sum(again.values()):.1f} s",
        "  CPU s  of   function",
        *table,
        "more than once: " + ", ".join(f"{name} {times[name]}" for name in sorted(again)),
    ]


def _start(process: str) -> None:
    if process == "fsw":
        from fsw.autopilot.parameters.control_choice import ControlChoice
        from fsw.runtime.assembly import flight_software

        flight_software(ControlChoice())
    else:
        from sitl.rehearsal import rehearse
        from sitl.scenario_file import load_scenario
        from sitl.simulation import Simulation

        rehearse(Simulation(load_scenario("walls", "mocap"), 0))


def _watched(process: str) -> dict[str, Any]:
    """Start a process; what it compiled, each without what was compiled meanwhile for its calls."""
    from numba.core import event

    compiled: list[tuple[str, float]] = []
    open_s = [0.0]  # of each compilation that is not over, what those inside it took
    began: list[float] = []

    class Watch(event.Listener):  # type: ignore[misc]
        def on_start(self, _: Any) -> None:
            began.append(time.thread_time())
            open_s.append(0.0)

        def on_end(self, ended: Any) -> None:
            took, inside = time.thread_time() - began.pop(), open_s.pop()
            open_s[-1] += took
            function = ended.data["dispatcher"].py_func
            compiled.append((f"{function.__module__}.{function.__qualname__}", took - inside))

    with event.install_listener("numba:compile", Watch()):
        _start(process)
    return {"cpu_s": time.process_time(), "compiled": compiled}


if __name__ == "__main__":
    print(json_text(_watched(sys.argv[1])))
