"""Where a link's signing key outlives the process: one file, for its owner's eyes only."""

from __future__ import annotations

import contextlib
import json
import os
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from command_line.bounded_json import read_json
from fsw.link.udp_endpoint import LinkError

_MODE: Final = 0o600
_KEY_SIZE: Final = 32  # bytes
_TIME_DIGITS: Final = 15  # of a signing time, which has 48 bits
_MOST_BYTES: Final = 1024  # of a file that is read


@dataclass(frozen=True, slots=True)
class SigningKey:
    """A key, and the newest signing time that was accepted under it."""

    key: bytes  # 32
    newest: int  # units of 10 us since 2015


class KeyFile:
    """Reads and replaces the file in one step, so that a reader never sees half of it.

    The newest time is changed in place, and nothing waits for the disk: the next process finds it
    however this one ends, and after a loss of power it is half a minute old at most.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._open: tuple[int, int] | None = None  # handle, and where the time ends

    def read(self) -> SigningKey | None:
        """The key, or None if there is none.

        Raises:
            LinkError: Others may read the file, or it holds no key. Flying on without signatures
                would open a link that its owner has closed.
        """
        try:
            if stat.S_IMODE(self._path.stat().st_mode) & 0o077:
                raise LinkError(f"{self._path} may be read by others; chmod 600 it")
            content = read_json(self._path, _MOST_BYTES)
            key, newest = bytes.fromhex(content["key"]), content["newest"]
            if len(key) != _KEY_SIZE or type(newest) is not int or not 0 <= newest < 1 << 48:
                raise ValueError
        except FileNotFoundError:
            return None
        except (OSError, ValueError, KeyError, TypeError):
            raise LinkError(
                f"{self._path} holds no signing key; remove it to fly unsigned"
            ) from None
        found = SigningKey(key, newest)
        try:
            self.write(found)  # as a file that ``keep`` can change in place
        except OSError as error:
            raise LinkError(
                f"{self._path} cannot be written, {error.strerror}: the newest signing time must be"
                " kept there"
            ) from None
        return found

    def write(self, key: SigningKey) -> None:
        """Replace the file; raises OSError if that is not possible."""
        self._path.parent.mkdir(parents=True, exist_ok=True)
        beside = self._path.with_name(f"{self._path.name}.{os.getpid()}.new")
        text = json.dumps({"key": key.key.hex()})[:-1] + f', "newest": {key.newest:>{_TIME_DIGITS}}'
        # Created with its mode, never readable by others even for a moment.
        handle = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, _MODE)
        try:
            os.fchmod(handle, _MODE)
            os.write(handle, f"{text}}}".encode("ascii"))
            os.fsync(handle)
            beside.replace(self._path)
        except BaseException:
            os.close(handle)
            raise
        self.close()
        self._open = (handle, len(text))

    def keep(self, newest: int) -> None:
        """Keep the ``newest`` signing time [10 us] in the file, in place; a disk error is ignored.

        The file must stay open since it was read or written: a tick may call this.
        """
        if self._open is not None:
            handle, end = self._open
            with contextlib.suppress(OSError):
                os.pwrite(handle, b"%*d" % (_TIME_DIGITS, newest), end - _TIME_DIGITS)

    def remove(self) -> None:
        """Delete the key; raises OSError if that is not possible."""
        self._path.unlink(missing_ok=True)
        self.close()

    def close(self) -> None:
        """Change nothing in the file any more."""
        if self._open is not None:
            os.close(self._open[0])
            self._open = None
