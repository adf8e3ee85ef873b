"""The files of the vehicle as a ground station finds them over FTP: logs, and metadata.

Component metadata are documents with the meanings of parameters and events.
Source: https://mavlink.io/en/services/component_information.html
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from itertools import count
from typing import Final

from command_line.version import version
from fsw.autopilot.signals import FlightSnapshot
from fsw.link.events.event_table import event_document
from fsw.link.files.flight_logs import FlightLogs, LoggedFlight
from fsw.link.files.served_file import Directory, MemoryFile, Node
from fsw.link.wire.outgoing import Outgoing, TelemetryContext
from messages import message_ids

_GENERAL: Final = "general.json"
_PARAMETERS: Final = "parameters.json"
_EVENTS: Final = "events.json"
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
    # Made now, so that no tick has to: it takes longer than six of them.
    metadata = {
        _GENERAL: MemoryFile(_general()[0]),
        _PARAMETERS: MemoryFile(_parameters()),
        _EVENTS: MemoryFile(event_document()),
    }
    return {"logs": _LaidOut(logs, _by_name), **metadata, **px4}


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
