"""Valid frames with any payload, to everything that listens: nothing raises, nothing ends."""

from __future__ import annotations

import random
import struct
from collections.abc import Iterator
from pathlib import Path

import fastcrc
import pytest

from docs.pages.messages import heard
from messages import dialect
from messages import message_ids as ids
from messages.frames import as_version_1
from tests.fsw.link.ground import Ground, whole_vehicle

# Bytes that make NaN, infinities, extremes and our own address more likely than chance would.
_LIKELY = (
    struct.pack("<f", float("nan")), struct.pack("<f", float("inf")), struct.pack("<f", -1e38),
    b"\xff\xff\xff\xff", b"\x00\x00\x00\x80", b"\x01\x01", b"\x00", b"\x01",
)  # fmt: skip
COUNT = 4000


def frame(message_id: int, chance: random.Random, sequence: int) -> bytes:
    """A valid frame whose payload is chance's."""
    message = dialect.mavlink_map[message_id]
    size = message.unpacker.size
    payload = bytearray(
        b"".join(
            chance.choice(_LIKELY) if chance.random() < 0.5 else chance.randbytes(2)
            for _ in range(size)
        )[:size]
    )
    names = list(message.ordered_fieldnames)
    for name in ("target_system", "target_component"):
        if name in names and chance.random() < 0.8:
            # Wire order: one-byte targets stand where the format says.
            fields = struct.Struct("<" + "".join(_codes(message)[: names.index(name)]))
            payload[fields.size] = 1
    shown = bytes(payload[: chance.randrange(1, size + 1)])
    header = bytes(
        [len(shown), 0, 0, sequence & 0xFF, chance.randrange(256), chance.randrange(256)]
    )
    body = header + message_id.to_bytes(3, "little") + shown
    checksum = fastcrc.crc16.mcrf4xx(body + bytes([message.crc_extra]))
    whole = b"\xfd" + body + checksum.to_bytes(2, "little")
    return (as_version_1(whole) if chance.random() < 0.3 else None) or whole


def _codes(message: object) -> list[str]:
    """struct codes of each field, in wire order, arrays as one code with a count."""
    codes, rest = [], message.native_format.decode().lstrip("<")  # type: ignore[attr-defined]
    for length, code in zip(message.array_lengths, rest, strict=True):  # type: ignore[attr-defined]
        codes.append(f"{length}{code}" if length else code)
    return codes


@pytest.fixture
def vehicle(tmp_path: Path) -> Iterator[Ground]:
    with whole_vehicle(tmp_path) as ground:
        yield ground


@pytest.mark.requirement("REQ-LINK-6")
def test_no_payload_of_a_valid_frame_raises_or_breaks_a_service(vehicle: Ground) -> None:
    chance, inbox = random.Random(7), vehicle.inbox
    # A random key would shut the test out.
    listened = sorted(heard() - {ids.SETUP_SIGNING})
    for number in range(COUNT):
        vehicle.polled(frame(listened[number % len(listened)], chance, number))
        if number % 20 == 0:
            vehicle.fly(1)
            inbox.take()
    assert vehicle.link.accepted > 0.9 * COUNT
    assert vehicle.link.dispatch.failures == 0
    assert vehicle.link.outbox.encode_failures == 0
