"""Processes that follow a script: ``python -m tests.cli.fake_processes NAME``."""

from __future__ import annotations

import json
import signal
import sys
import time
from types import FrameType


def main(name: str, script: list[str]) -> int:
    """Act word by word.

    An event as JSON; ``deaf`` to interrupts or ``slow`` to end; ``short``, ``sleep``; an exit code.
    """
    for word in script:
        if word.startswith("{"):
            print(word, flush=True)
        elif word == "deaf":
            signal.signal(signal.SIGINT, signal.SIG_IGN)
        elif word == "slow":
            signal.signal(signal.SIGINT, end_slowly)
        elif word == "sleep":
            time.sleep(60.0)
        elif word == "short":
            time.sleep(0.3)
        elif word.isdecimal():
            return int(word)
        else:
            break
    return 0


def end_slowly(number: int, frame: FrameType | None) -> None:
    """As a process does that has loaded much, on a busy machine."""
    print(event("error"), flush=True)
    time.sleep(1.0)
    sys.exit(1)


def event(name: str, **details: object) -> str:
    """A word of a script."""
    return json.dumps({"event": name, "message": f"{name} said", **details})


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2:]))
