"""Entry point: ``python -m benchmarks NAME …``, from a checkout."""

from __future__ import annotations

import sys
from importlib import import_module
from typing import Final

from command_line.output import print_error
from command_line.parser import COULD_NOT_START, unknown_name
from fsw.runtime.process import pin_numerics_to_one_thread

_INTERRUPTED: Final = 1  # exit code

BENCHMARKS: Final = {
    "mpc": "the planner's optimiser against others, on recorded requests",
    "loop": "a flight in real time: lateness, stage times, memory, against budgets",
    "lockstep": "a whole flight as fast as it goes, and where its time goes",
    "flood": "a flight in real time under 5000 useless datagrams a second",
    "soak": "an hour in real time with failures and a busy client",
    "download": "how fast a flight log comes over the link during a flight",
    "scheduler": "what a campaign's scheduler costs a task, and what more cores would do",
    "plant": "one step of the simulator's plant",
    "estimator": "a tick with real sensors beside one with exact states",
    "first_start": "what the first flight compiles, by kernel",
}


def help_text() -> str:
    """The list of the benchmarks."""
    rows = (f"  {name:12}{what}" for name, what in BENCHMARKS.items())
    return "\n".join(
        ("usage: python -m benchmarks NAME [options]", "", "benchmarks:", *rows, "")
        + ("`python -m benchmarks NAME --help` prints the options of one.",)
    )


def main(argv: list[str] | None = None) -> int:
    """Run one benchmark; returns the exit code."""
    words = sys.argv[1:] if argv is None else argv
    if not words or words[0] in ("-h", "--help", "help"):
        print(help_text())
        return 0
    name, *options = words
    if name not in BENCHMARKS:
        sentence = unknown_name("benchmark", name, BENCHMARKS)
        print_error("python -m benchmarks", sentence)
        return COULD_NOT_START
    try:
        pin_numerics_to_one_thread()  # before NumPy loads, whose idle threads spin
        return int(import_module(f"benchmarks.{name}").main(options))
    except KeyboardInterrupt:
        print_error(f"python -m benchmarks {name}", "interrupted")
        return _INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
