"""What a first flight from Python says: kernels are compiled, for minutes, and nothing moves."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from command_line.output import say
from fsw.compiled import cache as of_flight_software
from sitl.compiled import cache as of_simulator

_WHAT: Final = "library"  # flights


@contextmanager
def compiling() -> Iterator[None]:
    """Say so where kernels may have to be compiled meanwhile, and keep in mind that they were."""
    due = [one for one in (of_flight_software(), of_simulator()) if one.is_due(_WHAT)]
    if due:
        say("pandion: the first flight of a version compiles its kernels, for minutes", sys.stderr)
    yield
    for one in due:
        one.note(_WHAT)
