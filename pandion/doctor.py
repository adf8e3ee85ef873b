"""``pandion doctor``: whether this machine can fly, and in real time, one line a thing."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from command_line.options import json_file, option, read
from command_line.output import console_beside, json_text, say, write_text
from pandion.health_checks import FAIL, WARN, Check, all_checks

HEALTHY, UNFIT = 0, 1  # exit codes
_WORDS: Final = {FAIL: "cannot fly", WARN: "can fly; what is marked with ! costs something"}


@dataclass(frozen=True, slots=True, kw_only=True)
class DoctorOptions:
    """One examination."""

    out: Path = option("--out DIR", "where flights will be written", Path, default=Path("runs"))
    json: str | None = json_file("the findings")


def main(argv: list[str]) -> int:
    """Examine the machine; returns the exit code."""
    what = "Check this machine: what is missing for a flight, and for one in real time."
    options = read(DoctorOptions, "pandion doctor", what, argv)
    checks = all_checks(options.out)
    console = console_beside(options.json)
    for check in checks:
        say(line(check), console)
    states = {check.state for check in checks}
    verdict = next((_WORDS[state] for state in (FAIL, WARN) if state in states), "ready to fly")
    say(f"this machine {verdict}" if verdict != "ready to fly" else verdict, console)
    found = {"fit": FAIL not in states, "checks": [dataclasses.asdict(check) for check in checks]}
    write_text(options.json, json_text(found, 2) + "\n")
    return UNFIT if FAIL in states else HEALTHY


def line(check: Check) -> str:
    """What was found and, where it is not well, what to do."""
    mark = {FAIL: "✗", WARN: "!"}.get(check.state, "✓")
    remedy = f"; {check.remedy}" if check.remedy else ""
    return f"{mark} {check.name:16} {check.found}{remedy}"
