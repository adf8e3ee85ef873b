"""Numerical libraries with one thread each: matrices here are small and processes many."""

from __future__ import annotations

import os

_VARIABLES = (
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "OMP_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMBA_NUM_THREADS",
)


def pin_threads() -> None:
    """Set the limits; heeded by libraries loaded afterwards, here or in child processes."""
    for name in _VARIABLES:
        os.environ[name] = "1"
