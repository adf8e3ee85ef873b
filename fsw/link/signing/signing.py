"""MAVLink 2 signing of one link.

A frame is accepted if its hash is right and then its time: newer than the last of its sender on any
link with the same key, not further ahead than a minute. In this order, because a time taken from a
forged frame would lock its true sender out. Source: https://mavlink.io/en/guide/message_signing.html
"""

from __future__ import annotations

import hmac
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from hashlib import sha256
from typing import Final, cast

from fsw.autopilot.signals import Severity, StatusText
from fsw.link.endpoints import is_loopback
from fsw.link.signing.key_file import KeyFile, SigningKey
from fsw.link.wire.decode import Numbers, for_this_vehicle
from messages.addresses import Address
from messages.frames import Frame, announcing_signature, is_signed, is_version_1
from messages.message_ids import HEARTBEAT, RADIO_STATUS

_HASH_SIZE: Final = 6  # bytes, the first of SHA-256
_SIGNATURE_SIZE: Final = 13  # bytes: link, time (6), hash (6)
_EPOCH_UNIX_S: Final = 1_420_070_400  # 2015-01-01 UTC, where signing time begins
_UNIT_US: Final = 10  # of signing time
_LAST: Final = (1 << 48) - 1  # of its six bytes: in the year 2104
# A radio that puts its own status on the link has no key, and presence asks for nothing. MAVLink 1
# cannot be signed, so nothing of it passes.
_EXEMPT: Final = frozenset({HEARTBEAT, RADIO_STATUS})
TOLERANCE: Final = 6_000_000  # one minute, in units of 10 us
_MAX_SENDERS: Final = 64  # of a key, that are remembered; only its holders can add one
_MAX_KEYS: Final = 8  # that are remembered, beside those in use

Sender = tuple[int, int, int]
"""System, component and link id, as they stand in the frame."""


class KeyTimes:
    """The times under one key; all are in units of 10 us since 2015."""

    def __init__(self, key: bytes, oldest: int) -> None:
        """Frames under ``key`` (32 bytes) that are not newer than ``oldest`` are refused."""
        self.newest = oldest
        self._key = key
        self._oldest = oldest
        self.files: list[KeyFile] = []  # of the links that have the key now
        self._senders: dict[Sender, int] = {}

    def join(self, file: KeyFile, newest: int) -> None:
        """Count a link in, whose file says the ``newest`` time that it knows of."""
        self._oldest = max(self._oldest, newest)
        self.files.append(file)
        self._note(newest)

    def leave(self, file: KeyFile) -> None:
        """Count a link out, which has another key from now on."""
        self.files.remove(file)

    def accept(self, sender: Sender, time: int, now: int) -> bool:
        """Whether a frame's time is newer than its sender's last one and not far ahead.

        It is kept, on the disk too, before the frame does anything: a process that is killed leaves
        it to the next one.
        """
        last = self._senders.get(sender)
        if last is None:
            if len(self._senders) >= _MAX_SENDERS:
                return False
            last = max(self._oldest, now - TOLERANCE)
        if not last < time <= now + TOLERANCE:
            return False
        self._senders[sender] = time
        if time > self.newest:
            self._note(time)
        return True

    def _note(self, time: int) -> None:
        """Keep the newest time in the file of every link that has the key."""
        self.newest = max(self.newest, time)
        for file in self.files:
            file.keep(self._key, self.newest)


class SignedTimes:
    """The newest signing time of each sender, one record for all links that have the same key.

    A frame that was recorded on one link could be played to another one otherwise.
    """

    def __init__(self) -> None:
        self._by_key: dict[bytes, KeyTimes] = {}
        self._forgotten = 0  # the newest time under a key that is not remembered any more

    def of(self, key: bytes) -> KeyTimes:
        """The record of a key, the same for every link.

        It outlives the key's use: frames must not be played again when the key comes back.
        """
        found = self._by_key.get(key)
        if found is None:
            idle = [one for one, times in self._by_key.items() if not times.files]
            for one in idle[: max(len(idle) + 1 - _MAX_KEYS, 0)]:
                self._forgotten = max(self._forgotten, self._by_key.pop(one).newest)
            found = self._by_key[key] = KeyTimes(key, self._forgotten)
        return found


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


@dataclass
class Signing:
    """The key of one link; without a key everything passes.

    The key that an earlier flight left is taken up: ``LinkError`` if its file is there and cannot
    be trusted or read.
    """

    _link_id: int  # 0..255, distinguishes our links in our own signatures
    _unix_us: Callable[[], int]
    _file: KeyFile
    _times: SignedTimes  # of all links, so that no frame of one can be played to another
    counters: SigningCounters = field(default_factory=SigningCounters)

    def __post_init__(self) -> None:
        stored = self._file.read(self._now() + TOLERANCE)
        self._key = b"" if stored is None else stored.key
        self._sent = 0
        if stored is not None:
            # Frames of a flight before this one must not be played to this one.
            self._times.of(stored.key).join(self._file, stored.newest)
            self._sent = stored.newest

    @property
    def active(self) -> bool:
        """Whether this link is signed."""
        return bool(self._key)

    def signed(self, frame: bytes) -> bytes:
        """Sign a frame of ours."""
        self._sent = min(max(self._sent + 1, self._now()), _LAST)
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
        sender = frame.system_id, frame.component_id, link_id
        if not self._times.of(self._key).accept(sender, time, self._now()):
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
        old_times = self._times.of(self._key) if self._key else None
        new_times = self._times.of(new) if new else None
        if new_times is not None:
            known = 0 if old_times is None else old_times.newest
            self._file.write(SigningKey(new, max(new_times.newest, known)))
        else:
            self._file.remove()
        if new != self._key:
            if old_times is not None:
                old_times.leave(self._file)
            if new_times is not None:
                new_times.join(self._file, new_times.newest)
        self._key = new
        if initial_time <= self._now() + TOLERANCE:
            self._sent = max(self._sent, initial_time)

    def close(self) -> None:
        """Release the key's file."""
        self._file.close()

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
