"""Where ``--json`` goes."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path


def json_target(text: str) -> str:
    """The value of ``--json``, for argparse: a file that can be made, or ``-``."""
    if text != "-" and not Path(text).parent.is_dir():
        raise argparse.ArgumentTypeError(f"no directory for {text}")
    return text


def write_text(target: str | None, text: str) -> None:
    """Write to the file of that name, to standard output for ``-``, nowhere for None."""
    if target == "-":
        sys.stdout.write(text)
        sys.stdout.flush()
    elif target is not None:
        Path(target).write_text(text, encoding="utf-8")
