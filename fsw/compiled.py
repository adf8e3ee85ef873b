"""The one place that decides how numerical kernels are compiled."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import ParamSpec, TypeVar, cast

import numba

P = ParamSpec("P")
R = TypeVar("R")

_PACKAGE = Path(__file__).parent


def _cache_directory() -> str:
    """A cache directory per state of the sources.

    numba stamps a cached kernel with its own file only: after an edit in a callee of another
    file the caller would still run the old machine code.
    """
    sources = (path.read_bytes() for path in sorted(_PACKAGE.rglob("*.py")))
    digest = hashlib.sha256(b"".join(text for text in sources if b"fsw.compiled" in text))
    root = Path(numba.config.CACHE_DIR or _PACKAGE / "__pycache__")
    return str(root / f"numba-{digest.hexdigest()[:12]}")


_CACHE = _cache_directory()


def compiled(kernel: Callable[P, R]) -> Callable[P, R]:
    """Compile a kernel with numba, cached on disk, without the GIL.

    ``fastmath`` stays off: results must not depend on how a compiler reorders sums.
    """
    before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, _CACHE
    try:
        compile_it = numba.njit(cache=True, fastmath=False, nogil=True, error_model="numpy")
        return cast(Callable[P, R], compile_it(kernel))
    finally:
        numba.config.CACHE_DIR = before
