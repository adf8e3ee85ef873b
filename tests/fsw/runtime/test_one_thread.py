"""Numerics have one thread each, however the flight software is started."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

# The program's own start, up to where it would fly: there it says what it finds.
START = """
import json, os, sys, types

def run(options):
    early = "numpy" in sys.modules
    import numpy, scipy.linalg
    threads = {name: value for name, value in os.environ.items() if name.endswith("_NUM_THREADS")}
    print(json.dumps([early, len(os.listdir("/proc/self/task")), threads]))
    return 0

sys.modules["fsw.app"] = types.SimpleNamespace(run=run)
"""
STARTS = {
    "fsw": "from fsw.__main__ import main; main([])",
    "pandion fsw": "from pandion.__main__ import main; main(['fsw'])",
}


@pytest.mark.parametrize("start", STARTS.values(), ids=STARTS)
def test_it_is_pinned_before_numpy_is_there_to_read_it(start: str) -> None:
    outside = {
        name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")
    }
    done = subprocess.run(
        [sys.executable, "-c", START + start],
        env={**outside, "OMP_NUM_THREADS": "2"},  # set by a user for other programs
        capture_output=True,
        text=True,
        check=True,
    )
    early, threads, variables = json.loads(done.stdout)
    assert not early
    assert threads == 1, "BLAS starts its threads when numpy is imported"
    assert variables == {
        f"{library}_NUM_THREADS": "1" for library in ("OPENBLAS", "OMP", "MKL", "NUMBA", "RAYON")
    }
