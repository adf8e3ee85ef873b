"""What lets a job of continuous integration fail: requirements, and results test by test."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from command_line.options import Option
from command_line.values import output_file

if TYPE_CHECKING:
    from studies.statistics.requirement import Requirement


def _requirement(text: str) -> Requirement:
    from studies.statistics.requirement import requirement

    try:
        return requirement(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def required() -> Any:
    """The field for ``--require``: what must be shown, or the exit code is 1."""
    return Option(
        "--require TEXT",
        "what must be shown, or the exit code is 1: p<0.01@95%, p-each<0.05@95%, "
        "contact<1e-3@99%, margin>=0.01, te<=0.05 (metres); may be given again",
        _requirement,
        default=(),
        text=lambda one: one.text,
        repeated=True,
    ).field()


def junit() -> Any:
    """The field for ``--junit``: results for a server of continuous integration."""
    return Option(
        "--junit FILE", "write the results as JUnit XML to FILE; - for standard output", output_file
    ).field()
