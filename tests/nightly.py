"""Every target that takes too long for ``make test``, one after the other, and a table of them.

What is run seldom rots unseen. ``make nightly`` runs it; each target's output is in
``build/nightly``, and ``build/nightly/junit.xml`` is for a server of continuous integration.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from command_line.junit import Case, junit_xml

ROOT: Final = Path(__file__).parents[1]
_GRACE_S: Final = 30.0  # for a target that is interrupted


@dataclass(frozen=True)
class Target:
    """One target of the Makefile, with what makes it one of a night."""

    name: str
    words: tuple[str, ...] = ()
    limit_s: float = 3600.0


@dataclass(frozen=True)
class Outcome:
    """What came of it."""

    target: Target
    passed: bool
    seconds: float
    last: str  # line of its output


def targets(day: int) -> list[Target]:
    """Those of one night; what is drawn is drawn anew each ``day``."""
    seed = f"SEED={day}"
    return [
        Target("docs"),
        Target("docs-test"),
        Target("test-long", limit_s=4 * 3600.0),
        Target("interop"),
        Target("fuzz", ("SECONDS=60",)),
        Target("soak", ("MINUTES=5", seed)),
        Target("mutate", ("MODULES=6", "SAMPLE=4", "BUDGET=10", seed), 2 * 3600.0),
        Target("faults", limit_s=4 * 3600.0),
    ]


def run(target: Target, root: Path, folder: Path) -> Outcome:
    """Make it, with its output in a file of the folder; it is ended after its time."""
    log = folder / f"{target.name}.log"
    begun_s = time.monotonic()
    with log.open("wb") as output:
        process = subprocess.Popen(
            ["make", "--no-print-directory", target.name, *target.words],
            cwd=root, stdin=subprocess.DEVNULL, stdout=output, stderr=output,
            # Of this make's own only what it exports: neither its flags nor its variables.
            env={k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MFLAGS")},
            start_new_session=True,
        )  # fmt: skip
        late = False
        try:
            process.wait(target.limit_s)
        except subprocess.TimeoutExpired:
            late = True
        finally:
            _end(process)
    lines = [line for line in log.read_text("utf-8", "replace").splitlines() if line.strip()]
    last = f"ended after {target.limit_s:g} s" if late else lines[-1] if lines else "no output"
    return Outcome(target, process.returncode == 0, time.monotonic() - begun_s, last)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a target with all that it has started, if it has not ended."""
    for number in (signal.SIGINT, signal.SIGKILL):
        if process.poll() is None:
            os.killpg(process.pid, number)
            try:
                process.wait(_GRACE_S)
            except subprocess.TimeoutExpired:
                continue


def line(outcome: Outcome) -> str:
    """A row of the table."""
    verdict = "passed" if outcome.passed else "FAILED"
    minutes = outcome.seconds / 60.0
    return f"{outcome.target.name:10} {verdict} {minutes:6.1f} min  {outcome.last}"[:100].rstrip()


def night(chosen: Sequence[Target], left: Sequence[str], root: Path, folder: Path) -> int:
    """Make the chosen targets; returns the exit code."""
    folder.mkdir(parents=True, exist_ok=True)
    outcomes = []
    for target in chosen:
        outcomes.append(run(target, root, folder))
        print(line(outcomes[-1]), flush=True)
    for name in left:
        print(f"{name:10} left out")
    cases = [
        Case("nightly", one.target.name, one.seconds, failure="" if one.passed else one.last)
        for one in outcomes
    ]
    (folder / "junit.xml").write_text(junit_xml("nightly", cases), encoding="utf-8")
    failed = [one.target.name for one in outcomes if not one.passed]
    where = folder.relative_to(root) if folder.is_relative_to(root) else folder
    said = f"failed: {', '.join(failed)}" if failed else f"all {len(outcomes)} passed"
    print(f"nightly: {said}; output in {where}")
    return 1 if failed else 0


def main() -> int:
    """Make the targets of a night; returns the exit code."""
    every = targets(int(time.time() // 86400))
    names = [target.name for target in every]
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--only", nargs="+", choices=names, default=names, metavar="TARGET")
    parser.add_argument("--leave", nargs="+", choices=names, default=[], metavar="TARGET")
    options = parser.parse_args()
    chosen = [one for one in every if one.name in options.only and one.name not in options.leave]
    left = [name for name in names if name not in {one.name for one in chosen}]
    return night(chosen, left, ROOT, ROOT / "build" / "nightly")


if __name__ == "__main__":
    sys.exit(main())
