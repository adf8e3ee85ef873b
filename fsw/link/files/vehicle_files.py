"""The files of the vehicle as a ground station finds them over FTP: flight logs, and metadata.

The list of logs is made once, when the vehicle starts: a number must mean the same file for as long
as a ground station may ask for it. Only erasing the finished logs changes it.

A vehicle reaches its own logs and no others: that of this flight, and those of earlier flights
beside it that it marked as its own. Its parameter file is what makes it the same vehicle again; one
without such a file is another vehicle at each start. Whoever writes a log holds a lock on it
(``messages/block_file.py``).

Component metadata are documents with the meanings of parameters and events.
Source: https://mavlink.io/en/services/component_information.html
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import threading
import time
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from functools import cache
from itertools import count
from pathlib import Path
from typing import Final

from command_line.bounded_file import read_bounded
from command_line.version import version
from fsw.autopilot.signals import FlightSnapshot, Severity, StatusText
from fsw.link.events import event_document
from fsw.link.files.served_file import Directory, DiskFile, MemoryFile, Node
from fsw.link.wire.outgoing import Outgoing, TelemetryContext
from messages import message_ids

NAMES: Final = ("flight.ulg", "flight.tlog")  # the first that a flight has is *the* log of it
MARK: Final = "vehicle.txt"  # of the directory of a flight: whose it is
_MAX_MARK: Final = 4096  # bytes, of a path
_LAST_S: Final = 0xFFFFFFFF  # seconds that LOG_ENTRY has room for, to 2106
_MAX_FLIGHTS: Final = 1000  # the newest; more would take a ground station minutes to list
_GENERAL: Final = "general.json"
_PARAMETERS: Final = "parameters.json"
_EVENTS: Final = "events.json"
_PX4_NAME: Final = "%Y-%m-%d/%H_%M_%S"
_MAX_NAME = 200  # bytes: an entry of a directory must fit one message


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


def _erase(log: LoggedFlight) -> None:
    """Delete the files of a flight, all or, where one is being written (BlockingIOError), none."""
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
        """Find this flight's log, which must exist already, and those of the vehicle's others."""
        self._present = directory.absolute().name
        own = None if parameter_file is None else bytes(parameter_file.resolve())
        if own is not None:
            (directory / MARK).write_bytes(own)
        self.by_name: dict[str, Node] = {}  # as directories of FTP: of each flight its files
        self.by_day: dict[str, Node] = {}  # of each day its logs
        self._offer(flight_logs(directory, own))

    @property
    def present_ulog(self) -> DiskFile | None:
        """The ULog of this flight; None if it writes none."""
        files = (file for log in self.all if log.flight == self._present for file in log.files)
        return next((file for file in files if file.path.suffix == ".ulg"), None)

    def erase(self) -> Future[StatusText]:
        """Begin to delete the logs of finished flights; from now on only this one is listed.

        Which of the others are finished is found out beside the ticks, in a thread: to delete takes
        longer than one. Returns what is to be said of it, once it is done.
        """
        others = [log for log in self.all if log.flight != self._present]
        outcome = Future[StatusText]()
        work = threading.Thread(
            target=_erase_all, args=(others, outcome), name="erase", daemon=True
        )
        if others:
            self._offer(tuple(log for log in self.all if log.flight == self._present))
            work.start()
        else:  # nothing that takes time: a flood of requests starts no threads
            work.run()
        return outcome

    def _offer(self, logs: tuple[LoggedFlight, ...]) -> None:
        """Lay the directories out; only when logs come or go, for it takes a while."""
        self.all = logs
        self.by_name.clear()
        self.by_name |= _by_name(logs)
        self.by_day.clear()
        self.by_day |= _by_day(logs)


def _erase_all(logs: Sequence[LoggedFlight], outcome: Future[StatusText]) -> None:
    erased, written, failed, reason = 0, 0, 0, ""
    for log in logs:
        try:
            _erase(log)
            erased += 1
        except BlockingIOError:
            written += 1  # of a flight that is not over: kept
        except OSError as error:
            failed, reason = failed + 1, f"{log.flight}: {error.strerror}"
    text = f"{erased} {'log' if erased == 1 else 'logs'} erased, this flight's is kept"
    if written:
        text += f" and {written} of flights that are not over"
    if failed:
        text += f"; {failed} could not be: {reason}"
    outcome.set_result(StatusText(Severity.WARNING if failed else Severity.INFO, text))


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


def _by_name(flights: Sequence[LoggedFlight]) -> Directory:
    return {
        one.flight: {file.path.name: file for file in one.files}
        for one in flights
        if _can_be_listed(one.flight)
    }


def _by_day(flights: Sequence[LoggedFlight]) -> Directory:
    """A directory for each day; of two logs of the same second one has the name of the next."""
    days: dict[str, dict[str, Node]] = {}
    for flight in sorted(flights, key=lambda one: one.begun_s):
        for begun_s in count(flight.begun_s):
            day, name = time.strftime(_PX4_NAME, time.gmtime(begun_s)).split("/")
            file = f"{name}{flight.log.path.suffix}"
            if file not in days.setdefault(day, {}):
                days[day][file] = flight.log
                break
    return dict(days)


def vehicle_files(logs: FlightLogs) -> Directory:
    """``logs/FLIGHT/flight.ulg`` and ``flight.tlog`` of every flight, and the metadata.

    The logs are also where PX4 has them, in simulation (``log``) and on its card, by date.
    """
    px4: dict[str, Node] = {"log": logs.by_day, "fs": {"microsd": {"log": logs.by_day}}}
    # Made now, so that no tick has to: it takes longer than six of them.
    metadata = {
        _GENERAL: MemoryFile(_general()[0]),
        _PARAMETERS: MemoryFile(_parameters()),
        _EVENTS: MemoryFile(event_document()),
    }
    return {"logs": logs.by_name, **metadata, **px4}


def _can_be_listed(name: str) -> bool:
    return name.isascii() and name.isprintable() and len(name) <= _MAX_NAME


def component_metadata(
    _which: float, snapshot: FlightSnapshot, __: TelemetryContext
) -> Sequence[Outgoing]:
    """COMPONENT_METADATA: where the general document is; ``_which`` [1] is not used."""
    uri = _uri(_GENERAL).encode()
    values = (snapshot.t_us // 1000, _general()[1], uri)
    return [Outgoing(message_ids.COMPONENT_METADATA, values)]


def _uri(name: str) -> str:
    return f"mftp:///{name}"


# The table of parameters knows all that flies and is slow to import: it must not be imported
# before the command line has been found right.
@cache
def _parameters() -> bytes:
    from fsw.autopilot.parameters.metadata import parameter_document

    return parameter_document()


@cache
def _general() -> tuple[bytes, int]:
    """The general document and its checksum."""
    from fsw.autopilot.parameters.metadata import general_document, metadata_crc

    events = (_uri(_EVENTS), event_document())
    document = general_document(_uri(_PARAMETERS), events, version())
    return document, metadata_crc(document)
