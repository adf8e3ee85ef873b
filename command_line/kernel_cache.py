"""Where the machine code of kernels is kept on disk, and how much of it is there."""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from command_line.folders import NoHomeError, cache_folder
from command_line.process import Events

_DECORATED: Final = re.compile(rb"^@kernel\b", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class KernelCache:
    """The kernels of one package, in one state of its sources."""

    folder: Path | None  # None: nowhere can be written, every process compiles for itself
    kernels: int  # in the sources; a flight needs nearly all of them
    compiler: str  # numba keeps what it compiled by its version and the processor

    def is_due(self, what: str) -> bool:
        """Whether a kernel of ``what`` flies may not be on disk yet, and would be kept there.

        That some are there says nothing: another command, or one that was interrupted, has left
        them.
        """
        return self.folder is not None and not self._mark(self.folder, what).exists()

    def announce(self, name: str, events: Events) -> None:
        """Report that the process of this ``name`` compiles now, and where one can watch it."""
        sentence = f"{name}: compiling {self.kernels} kernels"
        if self.folder is None:
            sentence += "; nowhere can they be kept for the next start: set NUMBA_CACHE_DIR"
        folder = None if self.folder is None else str(self.folder)
        events.report("compiling", sentence, kernels=self.kernels, folder=folder)

    def note(self, what: str) -> None:
        """Keep in mind, on disk, that all kernels of ``what`` flies are there."""
        if self.folder is not None:
            with contextlib.suppress(OSError):  # then it is looked for again
                self._mark(self.folder, what).touch()

    def _mark(self, folder: Path, what: str) -> Path:
        return folder / f"{what}-{self.compiler}.complete"


def tell_layouts_apart(record: Any) -> None:
    """Let numba tell records of different layouts apart; ``record`` is its class of their types.

    It names code that other code calls by a number that it counts up in each process, so that of
    two layouts, one from the disk, either could run the other's code, and silently gave its
    numbers. And where a shorter record was compiled it takes a longer one that begins alike, with
    no more than a warning.
    """

    def mangling_args(one: Any) -> tuple[str, tuple[str]]:
        return "Record", (hashlib.sha256(one.name.encode()).hexdigest()[:16],)

    record.mangling_args = property(mangling_args)
    record.can_convert_to = lambda _one, _context, _other: None


def kept_in(folder: Path) -> int:
    """How many kernels are in a folder: numba writes an index for each."""
    return sum(1 for _ in folder.rglob("*.nbi"))


def kernel_cache(package: Path, wanted: str, compiler: str) -> KernelCache:
    """The cache of a ``package`` whose kernels are decorated by its module ``compiled``.

    It is in the folder ``wanted``, in the package if that is empty, or with the user's caches where
    the package cannot be written. numba stamps a cached kernel with its own file only: after an
    edit in a callee of another file the caller would still run the old machine code, so a state of
    the sources has a folder of its own. So has a place of them: numba keeps kernels by their path.
    """
    name = f"{package.name}.compiled".encode()
    door = package / "compiled.py"
    files = ((path, path.read_bytes()) for path in sorted(package.rglob("*.py")))
    sources = [text for path, text in files if name in text or path == door]
    digest = hashlib.sha256(b"".join([os.fsencode(package), *sources])).hexdigest()[:12]
    kernels = sum(len(_DECORATED.findall(text)) for text in sources)
    root = Path(wanted) if wanted else _root(package)
    # Absolute: the processes of a flight may stand elsewhere.
    folder = None if root is None else root.absolute() / f"numba-{digest}"
    return KernelCache(folder if folder and _can_be_written(folder) else None, kernels, compiler)


def _root(package: Path) -> Path | None:
    if _can_be_written(package / "__pycache__"):
        return package / "__pycache__"
    try:
        return cache_folder()
    except NoHomeError:
        return None


def _can_be_written(folder: Path) -> bool:
    nearest = next(one for one in (folder, *folder.parents) if one.exists())
    return nearest.is_dir() and os.access(nearest, os.W_OK | os.X_OK)
