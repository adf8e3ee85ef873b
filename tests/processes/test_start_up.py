"""An interrupt while a process of a flight imports: its end, and nothing in its log."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.command import environment
from tests.processes.both_processes import free_port


@pytest.mark.parametrize("half", ["sitl", "fsw"])
def test_an_interrupt_of_the_imports_ends_the_process_without_a_traceback(
    half: str, tmp_path: Path
) -> None:
    options = ["--out", str(tmp_path / "out"), *(["ground"] if half == "sitl" else [])]
    if half == "fsw":
        options += ["--sim", f"udp:127.0.0.1:{free_port()}"]
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", half, *options],
        cwd=tmp_path,
        # Each import is a line, so that it is known to be in the middle of them.
        env={**environment(), "PYTHONPROFILEIMPORTTIME": "1"},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    assert any(line.rpartition("|")[2].lstrip().startswith("numpy") for line in process.stderr)
    process.send_signal(signal.SIGINT)
    rest = process.stderr.read()
    assert process.wait(10.0) == -signal.SIGINT
    process.stderr.close()
    said = [line for line in rest.splitlines() if not line.startswith("import time:")]
    assert said == []
