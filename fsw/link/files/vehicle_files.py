"""The files of the vehicle as a ground station finds them over FTP."""

from __future__ import annotations

from collections.abc import Sequence

from fsw.link.files.component_metadata import metadata_files
from fsw.link.files.flight_logs import FlightLog
from fsw.link.files.ftp_tree import Directory, Node

_MAX_NAME = 200  # bytes: an entry of a directory must fit one message


def vehicle_files(logs: Sequence[FlightLog]) -> Directory:
    """``logs/FLIGHT/flight.ulg`` and ``flight.tlog`` of every flight, and the metadata."""
    flights: dict[str, Node] = {
        log.flight: {file.path.name: file for file in log.files}
        for log in logs
        if _can_be_listed(log.flight)
    }
    return {"logs": flights, **metadata_files()}


def _can_be_listed(name: str) -> bool:
    return name.isascii() and name.isprintable() and len(name) <= _MAX_NAME
