"""Report of the ground links after a flight, for `fsw.json`."""

from __future__ import annotations

from dataclasses import asdict

from fsw.link.gcs_link import GcsLink
from fsw.link.ground_links import GroundLinks
from fsw.link.inbox import Inbox


def as_json(links: GroundLinks, inbox: Inbox) -> dict[str, object]:
    """Counts since start: by link, and of messages that were valid but of no use."""
    return {
        "inbox_refused": inbox.refused,
        "links": {link.name: _counts(link) for link in links.links},
    }


def _counts(link: GcsLink) -> dict[str, object]:
    return {
        "frames_accepted": link.accepted,
        "false_starts": link.losses.frames,
        "bytes_lost": link.losses.bytes,
        "datagrams_dropped": link.dropped,
        "refused": asdict(link.signing.counters),
        "signed": link.signing.active,
        "peers": len(link.peers),
        "encode_failures": link.outbox.encode_failures,
        "service_failures": link.dispatch.failures,
    }
