"""The files of the vehicle as a ground station finds them over FTP."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import count
from typing import Final

from fsw.link.files.component_metadata import metadata_files
from fsw.link.files.flight_logs import FlightLogs, LoggedFlight
from fsw.link.files.ftp_tree import Directory, Node

_PX4_NAME: Final = "%Y-%m-%d/%H_%M_%S"
_MAX_NAME = 200  # bytes: an entry of a directory must fit one message


class _LaidOut(Mapping[str, Node]):
    """A directory made of the flights whose logs there still are."""

    def __init__(self, logs: FlightLogs, lay_out: Callable[[Sequence[LoggedFlight]], Directory]):
        """Lay them out; again only when some have been erased, for it takes a while."""
        self._logs = logs
        self._lay_out = lay_out
        self._laid_out, self._directory = logs.all, lay_out(logs.all)

    def _up_to_date(self) -> Directory:
        if self._logs.all is not self._laid_out:
            self._laid_out, self._directory = self._logs.all, self._lay_out(self._logs.all)
        return self._directory

    def __getitem__(self, name: str) -> Node:
        return self._up_to_date()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._up_to_date())

    def __len__(self) -> int:
        return len(self._up_to_date())


def _by_name(flights: Sequence[LoggedFlight]) -> Directory:
    """A directory for each flight."""
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
    dated = _LaidOut(logs, _by_day)
    px4 = {"log": dated, "fs": {"microsd": {"log": dated}}}
    return {"logs": _LaidOut(logs, _by_name), **metadata_files(), **px4}


def _can_be_listed(name: str) -> bool:
    return name.isascii() and name.isprintable() and len(name) <= _MAX_NAME
