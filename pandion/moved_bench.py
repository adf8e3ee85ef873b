"""``pandion bench``, for one more release; the benchmarks are in a checkout's ``benchmarks/``."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Final

from command_line.output import print_error
from command_line.parser import COULD_NOT_START

CHECKOUT: Final = Path(__file__).parents[1]


def main(argv: list[str]) -> int:
    """Name the new command and run it; returns its exit code."""
    if not (CHECKOUT / "benchmarks" / "__main__.py").exists():
        print_error(
            "pandion bench",
            "the benchmarks are not part of the installed package; "
            "run `python -m benchmarks` in a checkout of the repository",
        )
        return COULD_NOT_START
    command = " ".join(["python -m benchmarks", *argv[:1]])
    print_error("pandion bench", f"this command has moved; use `{command}`")
    # By name: the shipped package may not depend on the folder.
    return int(import_module("benchmarks.__main__").main(argv))
