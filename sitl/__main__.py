"""Entry point: ``python -m sitl``."""

from __future__ import annotations

import argparse
import os
import sys

from sitl import arguments


def main(argv: list[str] | None = None) -> int:
    """Simulate one flight; returns the exit code."""
    parser = argparse.ArgumentParser(prog="sitl", description="The simulator.", allow_abbrev=False)
    arguments.add_arguments(parser)
    return run(arguments.options(parser.parse_args(argv)))


def run(options: arguments.SitlOptions) -> int:
    """Simulate with parsed options; returns the exit code."""
    # One thread for BLAS, before NumPy reads it: the other core is the flight software's.
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    from sitl import app

    return app.run(options)


if __name__ == "__main__":
    sys.exit(main())
