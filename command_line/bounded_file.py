"""Files that somebody else may have written: no more is read than one of them should have."""

from __future__ import annotations

import errno
from pathlib import Path


def read_bounded(path: Path, most: int) -> bytes:
    """The content of a file of at most ``most`` bytes; of a device or a pipe no more is read.

    Raises:
        OSError: It cannot be read or is longer; ``strerror`` says which.
    """
    with path.open("rb") as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise OSError(errno.EFBIG, f"it is too long: must be at most {most} bytes", str(path))
    return content
