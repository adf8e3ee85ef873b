"""Typed door to numba: every kernel of the simulator is compiled through this wrapper."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, ParamSpec, TypeVar, cast

import numba
from llvmlite.binding import get_host_cpu_name
from numba.extending import register_jitable

from command_line.callee_code import callees_without_code
from command_line.kernel_cache import KernelCache, kernel_cache, tell_layouts_apart
from command_line.kernel_types import compile_for_types, compile_quietly, compile_within, types_of

tell_layouts_apart(numba.types.Record)

P = ParamSpec("P")
R = TypeVar("R")

_CACHE: Final = kernel_cache(
    Path(__file__).parent, numba.config.CACHE_DIR, f"{numba.__version__}-{get_host_cpu_name()}"
)


def cache() -> KernelCache:
    """Where the kernels of the simulator are kept."""
    return _CACHE


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile ``function`` to machine code on first call, cached on disk.

    It allocates nothing and returns no array, works on memory that its caller holds, and so needs
    no reference counts; with them the plant takes 3.6 times as long. Allocating in a kernel is a
    compile-time error.

    ``error_model="numpy"``: a division by zero gives inf/nan, which the simulation detects as
    divergence, instead of an exception test in every division.
    """
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(_CACHE.folder)
    try:
        dispatcher = numba.njit(
            cache=_CACHE.folder is not None,
            fastmath=False,
            nogil=True,
            error_model="numpy",
            no_cfunc_wrapper=True,  # nothing in C calls a kernel
            _nrt=False,  # numba's own switch for its runtime, undocumented
        )(function)
    finally:
        numba.config.CACHE_DIR = before
    compile_for_types(dispatcher, numba.types.unliteral)
    compile_quietly(dispatcher)
    compile_within(dispatcher, callees_without_code)
    return cast(Callable[P, R], dispatcher)


def machine_code(function: Callable[P, R], *example: Any) -> Callable[P, R]:
    """The machine code of a compiled function for arguments of the types of an example.

    Called directly it is spared numba's look at the types of all arguments; the caller
    must pass the right ones. The function is called once.
    """
    dispatcher = cast(Any, function)
    dispatcher(*example)
    types = types_of(dispatcher, example)
    return cast(Callable[P, R], dispatcher.overloads[types].entry_point)


def compilable(function: Callable[P, R]) -> Callable[P, R]:
    """Let compiled code take a function into itself; called from Python it stays Python."""
    same: Callable[P, R] = register_jitable(error_model="numpy", no_cfunc_wrapper=True)(function)
    return same
