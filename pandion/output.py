"""Where ``--json`` goes."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TextIO


def json_target(text: str) -> str:
    """The value of ``--json``, for argparse: a file that can be made, or ``-``."""
    if text != "-" and not Path(text).parent.is_dir():
        raise argparse.ArgumentTypeError(f"no directory for {text}")
    return text


def add_json_option(parser: argparse.ArgumentParser, what: str) -> None:
    """Add ``--json FILE``, to which a verb writes ``what``."""
    parser.add_argument(
        "--json", metavar="FILE", type=json_target, help=f"write {what}; - for standard output"
    )


def console_beside(target: str | None) -> TextIO:
    """Where sentences go: standard error if standard output is the JSON's."""
    return sys.stderr if target == "-" else sys.stdout


def write_text(target: str | None, text: str) -> None:
    """Write to the file of that name, to standard output for ``-``, nowhere for None."""
    if target == "-":
        sys.stdout.write(text)
        sys.stdout.flush()
    elif target is not None:
        Path(target).write_text(text, encoding="utf-8")
