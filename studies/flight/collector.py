"""Python's garbage collector, which a flight has no use for."""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Iterator


@contextlib.contextmanager
def collector_off() -> Iterator[None]:
    """Do without collections meanwhile; also as a decorator.

    A flight makes no reference cycles in its steps, so counting references frees all it allocates;
    a collection goes through all that numba and SciPy have made and takes 50 to 100 ms, in a
    flight of 10 s as much as 10 us a step.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()
