"""Where a link's signing key outlives the process: one file, for its owner's eyes only."""

from __future__ import annotations

import json
import os
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from fsw.link.udp_endpoint import LinkError

_MODE: Final = 0o600
_KEY_SIZE: Final = 32  # bytes


@dataclass(frozen=True, slots=True)
class SigningKey:
    """A key, and the newest signing time that was accepted under it."""

    key: bytes  # 32
    newest: int  # units of 10 us since 2015


class KeyFile:
    """Reads and replaces the file in one step, so that a reader never sees half of it."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def read(self) -> SigningKey | None:
        """The key, or None if there is none.

        Raises:
            LinkError: Others may read the file, or it holds no key. Flying on without signatures
                would open a link that its owner has closed.
        """
        try:
            if stat.S_IMODE(self._path.stat().st_mode) & 0o077:
                raise LinkError(f"{self._path} may be read by others; chmod 600 it")
            content = json.loads(self._path.read_text(encoding="ascii"))
            key, newest = bytes.fromhex(content["key"]), content["newest"]
            if len(key) != _KEY_SIZE or not isinstance(newest, int):
                raise ValueError
        except FileNotFoundError:
            return None
        except (OSError, ValueError, KeyError, TypeError):
            raise LinkError(
                f"{self._path} holds no signing key; remove it to fly unsigned"
            ) from None
        return SigningKey(key, newest)

    def write(self, key: SigningKey) -> None:
        """Replace the file; raises OSError if that is not possible."""
        self._path.parent.mkdir(parents=True, exist_ok=True)
        beside = self._path.with_name(f"{self._path.name}.{os.getpid()}.new")
        text = json.dumps({"key": key.key.hex(), "newest": key.newest})
        # Created with its mode, never readable by others even for a moment.
        handle = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, _MODE)
        try:
            os.fchmod(handle, _MODE)
            os.write(handle, text.encode("ascii"))
            os.fsync(handle)
        finally:
            os.close(handle)
        beside.replace(self._path)

    def remove(self) -> None:
        """Delete the key; raises OSError if that is not possible."""
        self._path.unlink(missing_ok=True)
