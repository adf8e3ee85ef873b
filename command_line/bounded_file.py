"""Files that somebody else may have written: regular ones, and no more of them than is expected."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO


def open_regular(path: Path, *, append: bool = False, follow: bool = True) -> BinaryIO:
    """Open a regular file to read it, or to ``append`` to it as well; never waits.

    Unless ``follow``, a symbolic link of this name is refused.

    Raises:
        OSError: It cannot be opened, or is a directory, pipe, socket or device; ``strerror`` says
            which.
    """
    # O_NONBLOCK: to open a pipe would wait for its writer. O_NOCTTY: a terminal stays a stranger.
    flags = os.O_NONBLOCK | os.O_NOCTTY
    flags |= os.O_RDWR | os.O_CREAT | os.O_APPEND if append else os.O_RDONLY
    flags |= 0 if follow else os.O_NOFOLLOW
    try:
        handle = os.open(path, flags, 0o666)
    except ValueError:  # a NUL byte, or what is no UTF-8
        raise OSError(errno.EINVAL, "this cannot be the name of a file", str(path)) from None
    except OSError as error:
        if error.errno == errno.ENXIO:  # a socket
            raise _irregular(path) from None
        if error.errno == errno.ELOOP and not follow:
            raise OSError(errno.ELOOP, "it is a symbolic link", str(path)) from None
        raise
    try:
        mode = os.fstat(handle).st_mode
        if stat.S_ISDIR(mode):
            raise OSError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        if not stat.S_ISREG(mode):
            raise _irregular(path)
        return os.fdopen(handle, "a+b" if append else "rb")
    except BaseException:
        os.close(handle)
        raise


def read_bounded(path: Path, most: int) -> bytes:
    """The content of a regular file of at most ``most`` bytes.

    Raises:
        OSError: As of :func:`open_regular`, or it is longer; ``strerror`` says which.
    """
    with open_regular(path) as file:
        # A sparse file may be longer than the memory; one in /proc says that it has no bytes.
        long = os.fstat(file.fileno()).st_size > most
        content = b"" if long else file.read(most + 1)
    if long or len(content) > most:
        raise OSError(errno.EFBIG, f"it is too long: must be at most {most} bytes", str(path))
    return content


def _irregular(path: Path) -> OSError:
    return OSError(errno.EINVAL, "it is not a regular file", str(path))
