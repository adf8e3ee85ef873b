"""Component metadata: documents over FTP with the meanings of parameters and events.

Source: https://mavlink.io/en/services/component_information.html
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Final

from command_line.version import version
from fsw.autopilot.signals import FlightSnapshot
from fsw.link.events.event_table import event_document
from fsw.link.files.ftp_tree import Node
from fsw.link.files.served_file import MemoryFile
from fsw.link.wire.outgoing import Outgoing, TelemetryContext
from messages import message_ids

_GENERAL: Final = "general.json"
_PARAMETERS: Final = "parameters.json"
_EVENTS: Final = "events.json"


def metadata_files() -> dict[str, Node]:
    """The documents, by their names in the root of the tree."""
    for make in (_general, _parameters, event_document):
        make()  # now, so that no tick has to: it takes longer than six of them
    return {
        _GENERAL: MemoryFile(lambda: _general()[0]),
        _PARAMETERS: MemoryFile(_parameters),
        _EVENTS: MemoryFile(event_document),
    }


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
