"""Joins the flight log and the simulator's truth when both processes have ended."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Final

from messages import ulog
from messages.ground_truth import FIRST_NUMBER, SIM_GROUND_TRUTH
from messages.ulog_reader import UlogError, open_log

_HEAD_SIZE: Final = 3  # of a message: size and type
_THIN: Final = 0  # LOG_PROFILE
_THIN_US: Final = 20_000
_STATE_HEAD: Final = ulog.data_head(FIRST_NUMBER, SIM_GROUND_TRUTH)
_TIME_AT: Final = len(_STATE_HEAD)  # in a record


def join_truth(directory: Path, fsw: dict[str, Any] | None) -> None:
    """Append ``truth.ulg`` to ``flight.ulg``, which has declared its topics, and remove it.

    A flight log that may end in the middle of a record is left alone, and the truth beside it, as
    is one whose flight software did not get to write its result. The true state is thinned out as
    the estimate is in this log (LOG_PROFILE).
    """
    truth, flight = directory / "truth.ulg", directory / "flight.ulg"
    file = (fsw or {}).get("files", {}).get("flight.ulg")
    if file is None or file["failure"] is not None or not truth.exists():
        return
    try:
        records = truth.read_bytes()[open_log(truth).at :]
        if open_log(flight).information.get("profile") == _THIN:
            records = _thinned(records)
        _append(flight, records)
        truth.unlink()
    except (OSError, UlogError):
        return  # both are still readable, each alone


def _thinned(records: bytes) -> bytes:
    """The records without those of the true state that are nearer to the last than the log's."""
    kept, last, at = bytearray(), -1, 0
    while at < len(records):
        end = at + _HEAD_SIZE + int.from_bytes(records[at : at + 2], "little")
        interval = int.from_bytes(records[at + _TIME_AT : at + _TIME_AT + 8], "little") // _THIN_US
        if records[at : at + len(_STATE_HEAD)] != _STATE_HEAD or interval != last:
            kept += records[at:end]
        if records[at : at + len(_STATE_HEAD)] == _STATE_HEAD:
            last = interval
        at = end
    return bytes(kept)


def _append(file: Path, records: bytes) -> None:
    """Append all of it, or nothing if the disk refuses."""
    size = file.stat().st_size
    try:
        with file.open("ab") as joined:
            joined.write(records)
    except OSError:
        os.truncate(file, size)
        raise
