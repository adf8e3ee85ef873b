"""Entry point: ``python -m fsw``."""

from __future__ import annotations

import argparse
import sys

from fsw import arguments
from fsw.runtime.process import pin_numerics_to_one_thread


def main(argv: list[str] | None = None) -> int:
    """Fly until the simulator ends the run; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="fsw", description="The flight software.", allow_abbrev=False
    )
    arguments.add_arguments(parser)
    return run(arguments.options(parser.parse_args(argv)))


def run(options: arguments.FswOptions) -> int:
    """Fly with parsed options; returns the exit code."""
    pin_numerics_to_one_thread()
    # numpy reads the variables above when it is imported, and this imports it.
    from fsw import app

    return app.run(options)


if __name__ == "__main__":
    sys.exit(main())
