"""The one place that decides how numerical kernels are compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

import numba

Kernel = TypeVar("Kernel", bound=Callable[..., object])


def compiled(kernel: Kernel) -> Kernel:
    """Compile a kernel with numba, cached on disk, without the GIL.

    ``fastmath`` stays off: results must not depend on how a compiler reorders sums.
    """
    return cast(
        Kernel, numba.njit(cache=True, fastmath=False, nogil=True, error_model="numpy")(kernel)
    )
