"""A child process leaves its results on disk and changes nothing in its parent."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from fsw.runtime.process import in_a_child


def test_work_in_a_child_leaves_files_and_no_memory(tmp_path: Path) -> None:
    done: list[str] = []

    def work() -> None:
        done.append("in the child")
        (tmp_path / "left").write_text("behind")

    in_a_child(work)
    assert (tmp_path / "left").read_text() == "behind"
    assert done == []


def test_work_that_fails_in_a_child_is_silent(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    def work() -> None:
        (tmp_path / "begun").touch()
        raise ValueError("no such controller")

    in_a_child(work)
    assert (tmp_path / "begun").exists()
    assert capfd.readouterr() == ("", "")


# In a process of its own: kernels that are compiled afterwards could not call those of before.
SETTLE = """
from pathlib import Path
from fsw.autopilot.parameters.control_choice import ControlChoice
from fsw.runtime.assembly import flight_software
from fsw.runtime.process import settle_memory

def anonymous_mb():
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) / 1024 for line in lines if line.startswith("RssAnon"))

program = flight_software(ControlChoice())
before = anonymous_mb()
settle_memory()
print(before - anonymous_mb())
"""


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")
def test_what_only_building_needed_is_given_back() -> None:
    given_back = subprocess.run(
        [sys.executable, "-c", SETTLE], capture_output=True, text=True, check=True
    )
    assert float(given_back.stdout) > 15.0
