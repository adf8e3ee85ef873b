"""Kernels of both processes are compiled for types of numbers, not for the numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import fsw.compiled
import sitl.compiled

DOORS = {
    "fsw compiled": fsw.compiled.compiled,
    "fsw kernel": fsw.compiled.kernel,
    "sitl compiled": sitl.compiled.compiled,
    "sitl kernel": sitl.compiled.kernel,
}


def put(out: Any, at: int, value: float, more: bool = False) -> None:
    out[at] = value + (1.0 if more else 0.0)


@pytest.mark.parametrize("door", DOORS)
def test_a_kernel_that_is_handed_constants_is_compiled_once_for_all_of_them(door: str) -> None:
    compile_it: Callable[..., Any] = DOORS[door]
    inner: Any = compile_it(put)

    def fill(out: Any, at: int) -> None:
        inner(out, 0, 5.0)
        inner(out, 1, 6.0)
        inner(out, at, 7.0)
        inner(out, 3, value=8.0, more=True)

    filled = np.zeros(4)
    compile_it(fill)(filled, 2)
    assert filled.tolist() == [5.0, 6.0, 7.0, 9.0]
    assert len({signature[1] for signature in inner.signatures}) == 1
    assert not any("Literal" in str(signature) for signature in inner.signatures)
