"""Flights that cost nothing, and those that go wrong in every way."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class StubRow:
    number: int
    reason: str = ""
    error: bool = False


@dataclass(frozen=True)
class StubFlight:
    """Does ``how`` when it is flown; ``note`` is a file that gets a line each time."""

    number: int
    how: str = "flies"
    note: Path | None = None
    lasts_s: float = 0.0

    def key(self) -> str:
        return f"{self.how} {self.number}"

    def row(self) -> StubRow:
        if self.note is not None:
            with self.note.open("a") as file:
                file.write(f"{self.key()}\n")
        time.sleep(self.lasts_s)
        if self.how == "raises":
            raise ValueError("no such wind")
        if self.how == "kills":
            os.kill(os.getpid(), signal.SIGKILL)
        while self.how == "hangs":
            time.sleep(0.01)
        if self.how == "hangs in C":
            time.sleep(1000.0)
        return StubRow(self.number)

    def broken(self, reason: str) -> StubRow:
        return StubRow(self.number, reason, error=True)

    def from_line(self, line: Mapping[str, Any]) -> StubRow:
        return StubRow(**line)


def noted(path: Path) -> list[str]:
    return path.read_text().splitlines() if path.exists() else []
