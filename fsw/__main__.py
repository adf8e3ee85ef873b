"""Entry point: ``python -m fsw``. It imports when an interrupt ends it without a traceback."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

from command_line.interrupts import end_at_once
from command_line.output import print_anything

if TYPE_CHECKING:
    from fsw.autopilot.parameters.control_choice import ControlChoice


def main(
    argv: list[str] | None = None,
    prog: str = "fsw",
    prepare: Callable[[ControlChoice], None] = lambda flown: None,
) -> int:
    """Fly until the simulator ends the run, after ``prepare``; returns the exit code."""
    from command_line.options import read
    from fsw.arguments import FswOptions
    from fsw.runtime.process import pin_numerics_to_one_thread

    options = read(FswOptions, prog, "Run the flight software alone.", argv)
    pin_numerics_to_one_thread()
    # numpy reads the variables above when it is imported, and this imports it.
    prepare(options.flown)
    from fsw import app

    return app.run(options)


if __name__ == "__main__":
    end_at_once()
    print_anything()
    sys.exit(main())
