"""How kernels are compiled with numba: one door for every package that has some."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

import numba
from llvmlite.binding import get_host_cpu_name
from numba.extending import register_jitable

from command_line.callee_code import callees_without_code
from command_line.kernel_cache import kernel_cache, tell_layouts_apart
from command_line.kernel_types import compile_for_types, compile_quietly, compile_within

tell_layouts_apart(numba.types.Record)

P = ParamSpec("P")
R = TypeVar("R")


class Kernels:
    """The kernels of one ``package``, and where they are kept."""

    def __init__(self, package: Path, *, nogil: bool) -> None:
        """With ``nogil`` they let go of the GIL, which takes as long as ten operations."""
        compiler = f"{numba.__version__}-{get_host_cpu_name()}"
        self.cache = kernel_cache(package, numba.config.CACHE_DIR, compiler)
        self.dispatchers: list[Any] = []
        self._nogil = nogil

    def compile(self, function: Callable[P, R]) -> Callable[P, R]:
        """Compile a kernel on its first call, cached on disk; it makes no array.

        Its caller holds those that it works on, so references to them need not be counted, which
        took half of the time of kernels of some ten operations. ``fastmath`` stays off: results
        must not depend on how a compiler reorders sums. A division by zero gives inf or NaN.
        """
        before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(self.cache.folder)
        try:
            dispatcher = numba.njit(
                cache=self.cache.folder is not None,
                fastmath=False,
                nogil=self._nogil,
                error_model="numpy",
                no_cfunc_wrapper=True,  # nothing in C calls a kernel
                _nrt=False,  # numba's own switch for its runtime, undocumented
            )(function)
        finally:
            numba.config.CACHE_DIR = before
        compile_for_types(dispatcher, numba.types.unliteral)
        compile_quietly(dispatcher)
        compile_within(dispatcher, callees_without_code)
        self.dispatchers.append(dispatcher)
        return cast(Callable[P, R], dispatcher)


def compilable(function: Callable[P, R]) -> Callable[P, R]:
    """Let kernels compile a pure law into themselves; called from Python it stays Python.

    So every law can be read, tested and stepped through as it stands, and flies as machine
    code (docs/decisions/0017-one-compiled-call-a-tick.md).
    """
    in_kernels = register_jitable(fastmath=False, error_model="numpy", no_cfunc_wrapper=True)
    return cast(Callable[P, R], in_kernels(function))
