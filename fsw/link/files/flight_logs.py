"""Which flights' logs are offered, and under which numbers.

The list is made once, when the vehicle starts: a number must mean the same file for as long as a
ground station may ask for it. Only erasing the finished logs changes it.

A vehicle reaches its own logs and no others: that of this flight, and those of earlier flights
beside it that it marked as its own. Its parameter file is what makes it the same vehicle again; one
without such a file is another vehicle at each start. Whoever writes a log holds a lock on it
(``messages/block_file.py``).
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from command_line.bounded_file import read_bounded
from fsw.link.files.served_file import DiskFile

NAMES: Final = ("flight.ulg", "flight.tlog")  # the first that a flight has is *the* log of it
MARK: Final = "vehicle.txt"  # of the directory of a flight: whose it is
_MAX_MARK: Final = 4096  # bytes, of a path
_LAST_S: Final = 0xFFFFFFFF  # seconds that LOG_ENTRY has room for, to 2106
_MAX_FLIGHTS: Final = 1000  # the newest; more would take a ground station minutes to list


@dataclass(frozen=True, slots=True)
class LoggedFlight:
    """The files of one flight."""

    flight: str  # name of its directory
    begun_s: int  # when it began [s since 1970]
    files: tuple[DiskFile, ...]  # in the order of NAMES; at least one

    @property
    def log(self) -> DiskFile:
        """The file that stands for the flight."""
        return self.files[0]


class Erasure:
    """Logs on their way from the disk, in a thread: that takes longer than a tick."""

    def __init__(self, logs: Sequence[LoggedFlight]) -> None:
        self.erased = 0  # flights
        self.written = 0  # flights that are not over: kept
        self.failed = 0
        self.reason = ""  # of the last that could not be
        self._logs = logs
        self._thread = threading.Thread(target=self._work, name="erase", daemon=True)
        if logs:  # else there is nothing that takes time: a flood of requests starts no threads
            self._thread.start()

    @property
    def done(self) -> bool:
        """Whether it has come to its end."""
        return not self._thread.is_alive()

    def _work(self) -> None:
        for log in self._logs:
            try:
                _erase(log)
                self.erased += 1
            except BlockingIOError:
                self.written += 1
            except OSError as error:
                self.failed += 1
                self.reason = f"{log.flight}: {error.strerror}"


def _erase(log: LoggedFlight) -> None:
    """Delete the files of a flight, all or, where one of them is being written, none.

    Raises:
        BlockingIOError: One is being written.
        OSError: One is gone, or cannot be deleted.
    """
    with contextlib.ExitStack() as opened:
        for file in log.files:
            descriptor = os.open(file.path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
            opened.callback(os.close, descriptor)
            # Shared is enough to learn of a writer, and needs no right to write.
            fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        for file in log.files:
            file.path.unlink()


class FlightLogs:
    """The list that all links share."""

    def __init__(self, directory: Path, parameter_file: Path | None = None) -> None:
        """Find this flight's log, which must exist already, and those of the vehicle's others.

        Raises:
            OSError: The directory cannot be written, or be read.
        """
        self._present = directory.absolute().name
        own = None if parameter_file is None else bytes(parameter_file.resolve())
        if own is not None:
            (directory / MARK).write_bytes(own)
        self.all = flight_logs(directory, own)

    @property
    def present_ulog(self) -> DiskFile | None:
        """The ULog of this flight; None if it writes none."""
        files = (file for log in self.all if log.flight == self._present for file in log.files)
        return next((file for file in files if file.path.suffix == ".ulg"), None)

    def erase(self) -> Erasure:
        """Begin to delete the logs of finished flights; from now on only this one is listed.

        Which of the others are finished is found out beside the ticks.
        """
        others = [log for log in self.all if log.flight != self._present]
        if others:
            self.all = tuple(log for log in self.all if log.flight == self._present)
        return Erasure(others)


def flight_logs(directory: Path, own: bytes | None) -> tuple[LoggedFlight, ...]:
    """List this flight, last, and those beside it with the ``own`` mark, oldest first."""
    directory = directory.absolute()
    dated = []
    with os.scandir(directory.parent) as entries:
        for entry in entries if own is not None else ():
            # A link may lead anywhere, so it leads nowhere.
            if entry.is_dir(follow_symlinks=False) and entry.name != directory.name:
                folder = Path(entry.path)
                earlier = _flight(folder) if _mark(folder) == own else None
                if earlier is not None:
                    dated.append((earlier.log.status().st_mtime, entry.name, earlier))
    earlier_flights = [flight for _, _, flight in sorted(dated, key=lambda item: item[:2])]
    present = _flight(directory, present=True)
    return tuple([*earlier_flights, *([present] if present else [])][-_MAX_FLIGHTS:])


def _mark(directory: Path) -> bytes | None:
    """Whose flight a directory has; None if it does not say."""
    try:
        return read_bounded(directory / MARK, _MAX_MARK)
    except OSError:
        return None


def _flight(directory: Path, *, present: bool = False) -> LoggedFlight | None:
    paths = [directory / name for name in NAMES]
    files = tuple(DiskFile(path) for path in paths if path.is_file() and not path.is_symlink())
    if all(file.size == 0 for file in files) and not present:
        return None  # a download of nothing never ends
    return LoggedFlight(directory.name, _begun_s(directory), files) if files else None


def _begun_s(directory: Path) -> int:
    """When a flight began [s since 1970]: then its mark was written; one without it begins now."""
    try:
        return min(max(int((directory / MARK).stat().st_mtime), 0), _LAST_S)
    except OSError:
        return int(time.time())
