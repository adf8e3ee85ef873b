"""Entry point: ``python -m sitl``. It imports when an interrupt ends it without a traceback."""

from __future__ import annotations

import os
import sys

from command_line.interrupts import end_at_once
from command_line.output import print_anything


def main(argv: list[str] | None = None, prog: str = "sitl") -> int:
    """Simulate one flight; returns the exit code."""
    from command_line.options import read
    from sitl.arguments import SitlOptions

    options = read(SitlOptions, prog, "Run the simulator alone.", argv)
    # One thread for BLAS, before NumPy reads it: the other core is the flight software's.
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    from sitl import app

    return app.run(options)


if __name__ == "__main__":
    end_at_once()
    print_anything()
    sys.exit(main())
