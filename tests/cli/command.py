"""``pandion`` as a process."""

from __future__ import annotations

import contextlib
import io
import os
import signal
import subprocess
import sys
from pathlib import Path

from pandion.__main__ import main
from tests.waiting import becomes

PANDION = [sys.executable, "-m", "pandion"]


def pandion(*arguments: str, cwd: Path, timeout: float = 90.0) -> subprocess.CompletedProcess[str]:
    """Run a command to its end; the repository is importable wherever it runs."""
    return subprocess.run(
        [*PANDION, *arguments],
        cwd=cwd,
        env=environment(),
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


def pandion_here(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """The same in this process, which has imported what a verb that does not fly needs."""
    printed, reported = io.StringIO(), io.StringIO()
    with (
        contextlib.chdir(cwd),
        contextlib.redirect_stdout(printed),
        contextlib.redirect_stderr(reported),
    ):
        try:
            code = main(list(arguments))
        except SystemExit as left:
            code = int(left.code or 0)
    return subprocess.CompletedProcess(arguments, code, printed.getvalue(), reported.getvalue())


def environment() -> dict[str, str]:
    """The environment with this source tree first, whether or not it is installed."""
    root = str(Path(__file__).parents[2])
    return {**os.environ, "PYTHONPATH": os.pathsep.join([root, os.environ.get("PYTHONPATH", "")])}


def start(*arguments: str, cwd: Path) -> subprocess.Popen[str]:
    """Start a command in a process group of its own."""
    return subprocess.Popen(
        [*PANDION, *arguments],
        cwd=cwd,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def read_until(process: subprocess.Popen[str], word: str) -> str:
    """Read its output up to a line that contains a word."""
    assert process.stdout is not None
    seen = ""
    for line in process.stdout:
        seen += line
        if word in line:
            return seen
    raise AssertionError(f"{word!r} is not in {seen!r}")


def group_is_empty(leader: int, patience_s: float = 2.0) -> bool:
    """True once no process of the leader's group is left."""

    def is_empty() -> bool:
        return not any(_lives_in(leader, entry) for entry in Path("/proc").iterdir())

    return becomes(is_empty, patience_s)


def _lives_in(group: int, entry: Path) -> bool:
    """A process that has ended counts no more, though init may take seconds to fetch its code."""
    try:
        state, _, number = (entry / "stat").read_text().rpartition(")")[2].split()[:3]
    except OSError:
        return False
    return int(number) == group and state != "Z"


def clean_up(process: subprocess.Popen[str]) -> None:
    """End a group whatever state it is in."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert process.stdout is not None
    process.stdout.close()


def one_sentence(text: str) -> bool:
    """True for exactly one line that is not a traceback."""
    lines = text.strip().splitlines()
    return len(lines) == 1 and "Traceback" not in text
