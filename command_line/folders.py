"""Folders of the user's, by the names that the XDG base directory specification gives them."""

from __future__ import annotations

import errno
import os
from pathlib import Path


class NoHomeError(OSError):
    """The user has no home directory, and nothing names another folder."""

    def __init__(self) -> None:
        super().__init__(errno.ENOENT, "this user has no home directory; set HOME")

    def __str__(self) -> str:
        return str(self.strerror)


def state_folder() -> Path:
    """Where what must outlive a process is kept, such as signing keys.

    Raises:
        NoHomeError: There is no such place.
    """
    return _folder("XDG_STATE_HOME", ".local/state") / "pandion"


def data_folder() -> Path:
    """Where other programs find what Pandion writes for them; raises as ``state_folder``."""
    return _folder("XDG_DATA_HOME", ".local/share")


def cache_folder() -> Path:
    """Where what can be made again is kept; raises as ``state_folder``."""
    return _folder("XDG_CACHE_HOME", ".cache") / "pandion"


def home() -> Path:
    """The user's home directory.

    Raises:
        NoHomeError: Neither HOME nor the system's list of users names one.
    """
    try:
        return Path.home()
    except RuntimeError:
        raise NoHomeError from None


def _folder(variable: str, usual: str) -> Path:
    # A relative path is not valid there and is to be ignored, says the specification.
    wanted = Path(os.environ.get(variable) or ".")
    return wanted if wanted.is_absolute() else home() / usual
