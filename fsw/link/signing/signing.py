"""MAVLink 2 signing of one link.

A frame is accepted if its hash is right and then its time: newer than the last of its sender,
not further ahead than a minute. In this order, because a time taken from a forged frame would lock
its true sender out. Source: https://mavlink.io/en/guide/message_signing.html
"""

from __future__ import annotations

import hmac
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from hashlib import sha256
from typing import Final, cast

from fsw.link.signing.key_file import KeyFile, SigningKey
from fsw.link.udp_endpoint import Address, is_loopback
from fsw.link.wire.decode import Numbers, for_this_vehicle
from fsw.link.wire.message_ids import HEARTBEAT, RADIO_STATUS
from fsw.signals import Severity, StatusText
from messages.frames import Frame, announcing_signature, is_signed, is_version_1

_HASH_SIZE: Final = 6  # bytes, the first of SHA-256
_SIGNATURE_SIZE: Final = 13  # bytes: link, time (6), hash (6)
_EPOCH_UNIX_S: Final = 1_420_070_400  # 2015-01-01 UTC, where signing time begins
_UNIT_US: Final = 10  # of signing time
_TOLERANCE: Final = 6_000_000  # one minute, in units
_MAX_SENDERS: Final = 64  # that are remembered; only holders of the key can add one
# A radio that puts its own status on the link has no key, and presence asks for nothing. MAVLink 1
# cannot be signed, so nothing of it passes.
_EXEMPT: Final = frozenset({HEARTBEAT, RADIO_STATUS})


class FrameTrust(Enum):
    """What a frame may do."""

    TRUSTED = "trusted"
    EXEMPT = "exempt"  # unsigned on a signed link, but harmless: nothing is learnt from its sender
    REFUSED = "refused"


@dataclass(slots=True)
class SigningCounters:
    """Frames that a signed link refused."""

    unsigned: int = 0
    wrong_hash: int = 0
    wrong_time: int = 0  # replayed, or too far ahead


class Signing:
    """The key of one link and the times of its senders; without a key everything passes."""

    def __init__(self, link_id: int, unix_us: Callable[[], int], file: KeyFile | None) -> None:
        """Take up the key that an earlier flight left; without a file it ends with the process.

        ``link_id``, 0..255, distinguishes our links in our own signatures.

        Raises:
            LinkError: The file is there and cannot be trusted or read.
        """
        self.counters = SigningCounters()
        self._link_id = link_id
        self._unix_us = unix_us
        self._file = file
        stored = None if file is None else file.read()
        self._key = b"" if stored is None else stored.key
        # Frames of a flight before this one must not be played to this one.
        self._oldest = 0 if stored is None else stored.newest
        self._sent = self._oldest
        self._senders: dict[tuple[int, int, int], int] = {}

    @property
    def active(self) -> bool:
        """Whether this link is signed."""
        return bool(self._key)

    def signed(self, frame: bytes) -> bytes:
        """Sign a frame of ours."""
        self._sent = max(self._sent + 1, self._now())
        marked = announcing_signature(frame)
        stamp = bytes([self._link_id]) + self._sent.to_bytes(6, "little")
        return marked + stamp + self._hash(marked + stamp)

    def judge(self, frame: Frame, raw: bytes) -> FrameTrust:
        """Decide about a frame whose checksum is right; ``raw`` is all of its bytes."""
        if not self._key:
            return FrameTrust.TRUSTED
        if not is_signed(raw):
            if frame.message_id in _EXEMPT and not is_version_1(raw):
                return FrameTrust.EXEMPT
            self.counters.unsigned += 1
            return FrameTrust.REFUSED
        if not hmac.compare_digest(self._hash(raw[:-_HASH_SIZE]), raw[-_HASH_SIZE:]):
            self.counters.wrong_hash += 1
            return FrameTrust.REFUSED
        link_id = raw[-_SIGNATURE_SIZE]
        time = int.from_bytes(raw[1 - _SIGNATURE_SIZE : -_HASH_SIZE], "little")
        if not self._in_time((frame.system_id, frame.component_id, link_id), time):
            self.counters.wrong_time += 1
            return FrameTrust.REFUSED
        return FrameTrust.TRUSTED

    def set_up(self, key: bytes, initial_time: int) -> None:
        """Sign from now on with a key of 32 bytes, or stop signing if it is all zeros.

        Our signing time does not begin before the sender's ``initial_time``, unless that is further
        ahead than a minute.

        Raises:
            OSError: The key cannot be stored; nothing has changed.
        """
        new = key if any(key) else b""
        if self._file is not None:
            if new:
                self._file.write(SigningKey(new, self._newest()))
            else:
                self._file.remove()
        if new != self._key:  # frames under the same key must not be played again
            self._senders.clear()
        self._key = new
        if initial_time <= self._now() + _TOLERANCE:
            self._sent = max(self._sent, initial_time)

    def close(self) -> None:
        """Release the key's file."""
        if self._file is not None:
            self._file.close()

    def _in_time(self, sender: tuple[int, int, int], time: int) -> bool:
        now = self._now()
        last = self._senders.get(sender)
        if last is None:
            if len(self._senders) >= _MAX_SENDERS:
                return False
            last = max(self._oldest, now - _TOLERANCE)
        if not last < time <= now + _TOLERANCE:
            return False
        # Kept before the frame does anything: a process that is killed leaves it to the next one.
        if self._file is not None and time > self._newest():
            self._file.keep(time)
        self._senders[sender] = time
        return True

    def _newest(self) -> int:
        return max(self._senders.values(), default=self._oldest)

    def _hash(self, covered: bytes) -> bytes:
        return sha256(self._key + covered).digest()[:_HASH_SIZE]

    def _now(self) -> int:
        return (self._unix_us() - 1_000_000 * _EPOCH_UNIX_S) // _UNIT_US


def set_up_signing(
    signing: Signing, frame: Frame, sender: Address, armed: bool
) -> StatusText | None:
    """Carry out SETUP_SIGNING, judged already; None if the message was not for this vehicle.

    The key crosses the link in the clear, so only this machine may send it; and storing it takes
    time, which an armed vehicle does not have. The answer is a text for the operator.
    """
    if not for_this_vehicle(frame):
        return None
    initial_time, _, _, *key = cast(Numbers, frame.payload_values)
    if not is_loopback(sender):
        return StatusText(
            Severity.WARNING, "signing unchanged: a key is taken from this machine only"
        )
    if armed:
        return StatusText(Severity.WARNING, "signing unchanged: disarm first")
    try:
        signing.set_up(bytes(int(byte) for byte in key), int(initial_time))
    except OSError as error:
        return StatusText(
            Severity.WARNING, f"signing unchanged: the key cannot be kept, {error.strerror}"
        )
    return StatusText(Severity.NOTICE, "signing is on" if signing.active else "signing is off")
