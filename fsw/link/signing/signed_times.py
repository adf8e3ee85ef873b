"""The newest signing time of each sender, one record for all links that have the same key.

A frame that was recorded on one link could be played to another one otherwise.
Source: https://mavlink.io/en/guide/message_signing.html, "Timestamp Handling".
"""

from __future__ import annotations

from typing import Final

from fsw.link.signing.key_file import KeyFile

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
        self._senders: dict[Sender, int] = {}
        self._files: list[KeyFile] = []  # of the links that have the key now

    def join(self, file: KeyFile, newest: int) -> None:
        """Count a link in, whose file says the ``newest`` time that it knows of."""
        self._oldest = max(self._oldest, newest)
        self._files.append(file)
        self._note(newest)

    def leave(self, file: KeyFile) -> None:
        """Count a link out, which has another key from now on."""
        self._files.remove(file)

    @property
    def in_use(self) -> bool:
        """Whether a link has the key."""
        return bool(self._files)

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
        for file in self._files:
            file.keep(self._key, self.newest)


class SignedTimes:
    """What all links of a vehicle share."""

    def __init__(self) -> None:
        self._by_key: dict[bytes, KeyTimes] = {}
        self._forgotten = 0  # the newest time under a key that is not remembered any more

    def of(self, key: bytes) -> KeyTimes:
        """The record of a key, the same for every link.

        It outlives the key's use: frames must not be played again when the key comes back.
        """
        found = self._by_key.get(key)
        if found is None:
            idle = [one for one, times in self._by_key.items() if not times.in_use]
            for one in idle[: max(len(idle) + 1 - _MAX_KEYS, 0)]:
                self._forgotten = max(self._forgotten, self._by_key.pop(one).newest)
            found = self._by_key[key] = KeyTimes(key, self._forgotten)
        return found
