"""Makes one file of the flight log and the simulator's truth when both halves have ended."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from messages.ulog_reader import UlogError, open_log


def join_truth(directory: Path, fsw: dict[str, Any] | None) -> None:
    """Append ``truth.ulg`` to ``flight.ulg``, which has declared its topics, and remove it.

    A flight log that may end in the middle of a record is left alone, and the truth beside it.

    Args:
        directory: Of the flight.
        fsw: What the flight software said of itself at its end, None if it did not get there.
    """
    truth, flight = directory / "truth.ulg", directory / "flight.ulg"
    file = (fsw or {}).get("files", {}).get("flight.ulg")
    if file is None or file["failure"] is not None or not truth.exists():
        return
    try:
        records = truth.read_bytes()[open_log(truth).at :]
        _append(flight, records)
        truth.unlink()
    except (OSError, UlogError):
        return  # both are still readable, each alone


def _append(file: Path, records: bytes) -> None:
    """Append all of it, or nothing if the disk refuses."""
    size = file.stat().st_size
    try:
        with file.open("ab") as joined:
            joined.write(records)
    except OSError:
        os.truncate(file, size)
        raise
