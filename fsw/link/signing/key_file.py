"""Where a link's signing key outlives the process: one file, for its owner's eyes only."""

from __future__ import annotations

import contextlib
import os
import re
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from command_line.bounded_json import read_json
from command_line.folders import NoHomeError
from messages.addresses import LinkError

_MODE: Final = 0o600
_KEY_SIZE: Final = 32  # bytes
_MAX_BYTES: Final = 1024  # of a file that is read
_HEAD: Final = b'{"key": "%s", "newest": '  # of the key in hexadecimal
_TIME_AT: Final = len(_HEAD % bytes(2 * _KEY_SIZE))
_TIME_SIZE: Final = 15  # digits of a signing time, which has 48 bits
_FORM: Final = re.compile(rb'\{"key": "([0-9a-f]{64})", "newest": (?=.{15}\}) *\d+\}')


@dataclass(frozen=True, slots=True)
class SigningKey:
    """A key, and the newest signing time that was accepted under it."""

    key: bytes  # 32
    newest: int  # units of 10 us since 2015


class KeyFile:
    """Replaces the file in one step, so that a reader never sees half of it.

    The newest time is changed in place, and nothing waits for the disk: the next process finds it
    however this one ends, and after a loss of power it is half a minute old at most. Several
    processes may have the file open: the time in it never goes back.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._handle: int | None = None

    def read(self, latest: int) -> SigningKey | None:
        """The key, or None if there is none; its newest time must not be after ``latest`` [10 us].

        Raises:
            LinkError: Others may read the file, it holds no key, or the newest time lies ahead, so
                that every frame would be refused. Flying on without signatures would open a link
                that its owner has closed.
        """
        try:
            if stat.S_IMODE(self._path.stat().st_mode) & 0o077:
                raise LinkError(f"{self._path} may be read by others; chmod 600 it")
            content = read_json(self._path, _MAX_BYTES)
            key, newest = bytes.fromhex(content["key"]), content["newest"]
            if len(key) != _KEY_SIZE or type(newest) is not int or not 0 <= newest < 1 << 48:
                raise ValueError
        except FileNotFoundError:
            return None
        except (OSError, ValueError, KeyError, TypeError):
            raise LinkError(
                f"{self._path} holds no signing key; remove it to fly unsigned"
            ) from None
        if newest > latest:
            raise LinkError(
                f"{self._path}: the newest signing time is {1e-5 * (newest - latest):.0f} s too far"
                " ahead of the clock; set the clock, or remove the file to fly unsigned"
            )
        found = SigningKey(key, newest)
        try:
            self.write(found)
        except OSError as error:
            raise LinkError(
                f"{self._path} cannot be written, {error.strerror}: the newest signing time must be"
                " kept there"
            ) from None
        return found

    def write(self, key: SigningKey) -> None:
        """Replace the file, or its time where it holds the key; raises OSError if it cannot be."""
        with contextlib.suppress(OSError):
            if self._take_up(key.key):
                self.keep(key.key, key.newest)
                return
        self._path.parent.mkdir(parents=True, exist_ok=True)
        beside = self._path.with_name(f"{self._path.name}.{os.getpid()}.new")
        # Created with its mode, never readable by others even for a moment.
        handle = os.open(beside, os.O_RDWR | os.O_CREAT | os.O_TRUNC, _MODE)
        try:
            os.fchmod(handle, _MODE)
            os.write(handle, _HEAD % key.key.hex().encode() + _digits(key.newest) + b"}")
            os.fsync(handle)
            beside.replace(self._path)
        except BaseException:
            os.close(handle)
            raise
        self.close()
        self._handle = handle

    def keep(self, key: bytes, newest: int) -> None:
        """Keep the ``newest`` signing time [10 us] in the file, in place; a disk error is ignored.

        The file must stay open since it was read or written: a tick may call this. One that another
        process has replaced is taken up if it holds the same ``key`` (32 bytes).
        """
        with contextlib.suppress(OSError):
            if self._handle is not None and os.fstat(self._handle).st_nlink == 0:
                self.close()
                self._take_up(key)
            if self._handle is not None:
                kept = os.pread(self._handle, _TIME_SIZE, _TIME_AT)
                # What is no number there, somebody else has put there.
                if not kept.strip().isdigit() or newest > int(kept):
                    os.pwrite(self._handle, _digits(newest), _TIME_AT)

    def remove(self) -> None:
        """Delete the key; raises OSError if that is not possible."""
        self._path.unlink(missing_ok=True)
        self.close()

    def close(self) -> None:
        """Change nothing in the file any more."""
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None

    def _take_up(self, key: bytes) -> bool:
        """Open the file for :meth:`keep`, if :meth:`write` has made it and with this key.

        Replaced, it would not be the file any more that another process keeps its time in.
        """
        with contextlib.ExitStack() as opened:
            handle = os.open(self._path, os.O_RDWR | os.O_NONBLOCK)
            opened.callback(os.close, handle)
            found = _FORM.fullmatch(os.read(handle, _MAX_BYTES))
            others = os.fstat(handle).st_mode & 0o077
            if others or found is None or found[1] != key.hex().encode():
                return False
            opened.pop_all()
        self.close()
        self._handle = handle
        return True


class NoKeyFile(KeyFile):
    """For a user without a home directory: there is no key, and none can be set."""

    def __init__(self) -> None:
        super().__init__(Path(os.devnull))

    def read(self, latest: int) -> SigningKey | None:
        """None; ``latest`` [10 us]."""
        return None

    def write(self, key: SigningKey) -> None:
        """Raise OSError: a link would be unsigned again after the next start."""
        raise NoHomeError

    def remove(self) -> None:
        """Nothing is there."""


def _digits(newest: int) -> bytes:
    return b"%*d" % (_TIME_SIZE, newest)
