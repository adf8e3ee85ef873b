"""Write ``docs/messages.md``: every message on the links to the ground, and the dialect.

Run by hand after an edit of the dialect or of the table of streams:
``python -m docs.generators.message_page``. A test compares.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

from docs.generators.message_reference import Traffic, reference
from fsw.link.files.ftp_service import FtpService
from fsw.link.files.log_service import LogService
from fsw.link.inbox import Inbox
from fsw.link.services.parameter_service import ParameterService
from fsw.link.services.time_service import TimeService
from fsw.link.telemetry.streams import AT_ONCE, ON_REQUEST, STREAMS
from fsw.link.wire import message_ids as ids

# What the vehicle says in answer, or as it happens, beside the streams.
ANSWERS: Final = (
    ids.PING, ids.PARAM_VALUE, ids.PARAM_ERROR, ids.MISSION_CURRENT, ids.MISSION_COUNT,
    ids.MISSION_ITEM_INT, ids.MISSION_ITEM, ids.MISSION_REQUEST_INT, ids.MISSION_ITEM_REACHED,
    ids.MISSION_ACK, ids.COMMAND_ACK, ids.FILE_TRANSFER_PROTOCOL, ids.TIMESYNC, ids.LOG_ENTRY,
    ids.LOG_DATA, ids.MESSAGE_INTERVAL, ids.STATUSTEXT, *ON_REQUEST,
)  # fmt: skip
_OF_THE_LINK: Final = (ids.HEARTBEAT, ids.RADIO_STATUS, ids.SETUP_SIGNING)
# What the mission service hears; it exists with a mission only.
OF_MISSIONS: Final = (
    ids.MISSION_COUNT, ids.MISSION_ITEM, ids.MISSION_ITEM_INT, ids.MISSION_REQUEST_LIST,
    ids.MISSION_REQUEST, ids.MISSION_REQUEST_INT, ids.MISSION_ACK, ids.MISSION_CLEAR_ALL,
    ids.MISSION_SET_CURRENT, ids.MISSION_WRITE_PARTIAL_LIST, ids.MISSION_REQUEST_PARTIAL_LIST,
)  # fmt: skip


def heard() -> frozenset[int]:
    """Every message that the vehicle does something with."""
    services = (ParameterService, LogService, FtpService, TimeService)
    return frozenset(_OF_THE_LINK).union(
        Inbox().message_ids,
        OF_MISSIONS,
        *(service.message_ids for service in services),
    )


def traffic() -> list[Traffic]:
    """Who sends what, and how often, by message."""
    rows: dict[int, Traffic] = {}
    for stream in STREAMS:
        rates = f"{stream.ground_hz:g} / {stream.api_hz:g}"
        if stream.ground_hz == 0.0:
            rates = "on request"
        elif stream in AT_ONCE:
            rates += ", and at once"
        rows[stream.message_id] = Traffic(stream.message_id, stream.component, rates, heard=False)
    for message_id in ANSWERS:
        rows.setdefault(
            message_id, Traffic(message_id, ids.AUTOPILOT, "as it happens", heard=False)
        )
    for message_id in heard():
        sent = rows.get(message_id, Traffic(message_id, 0, "", heard=True))
        rows[message_id] = Traffic(message_id, sent.component, sent.rates, heard=True)
    return [rows[message_id] for message_id in sorted(rows)]


if __name__ == "__main__":
    page = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("docs/messages.md")
    page.write_text(reference(traffic()), encoding="utf-8")
    print(f"wrote {page}")
