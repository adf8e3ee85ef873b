"""The files of the vehicle as a ground station finds them over FTP."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from fsw.link.files.component_metadata import metadata_files
from fsw.link.files.flight_logs import FlightLogs
from fsw.link.files.ftp_tree import Directory, Node

_MAX_NAME = 200  # bytes: an entry of a directory must fit one message


class _Flights(Mapping[str, Node]):
    """A directory for each flight whose logs there still are."""

    def __init__(self, logs: FlightLogs) -> None:
        self._logs = logs

    def __getitem__(self, name: str) -> Node:
        for log in self._logs.all:
            if log.flight == name and _can_be_listed(name):
                return {file.path.name: file for file in log.files}
        raise KeyError(name)

    def __iter__(self) -> Iterator[str]:
        return (log.flight for log in self._logs.all if _can_be_listed(log.flight))

    def __len__(self) -> int:
        return sum(1 for _ in self)


def vehicle_files(logs: FlightLogs) -> Directory:
    """``logs/FLIGHT/flight.ulg`` and ``flight.tlog`` of every flight, and the metadata."""
    return {"logs": _Flights(logs), **metadata_files()}


def _can_be_listed(name: str) -> bool:
    return name.isascii() and name.isprintable() and len(name) <= _MAX_NAME
