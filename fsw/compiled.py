"""The one place that decides how numerical kernels are compiled."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, ParamSpec, TypeVar, cast

import numba
import numpy as np
from llvmlite.binding import get_host_cpu_name
from numba.extending import register_jitable
from numpy.typing import NDArray

from command_line.callee_code import callees_without_code
from command_line.kernel_cache import KernelCache, kernel_cache, tell_layouts_apart
from command_line.kernel_types import compile_for_types, compile_quietly, compile_within, types_of

tell_layouts_apart(numba.types.Record)

IN_PYTHON: Final = bool(numba.config.DISABLE_JIT)
"""Whether kernels are run as the Python they are, as NUMBA_DISABLE_JIT has it."""

P = ParamSpec("P")
R = TypeVar("R")

_CACHE: Final = kernel_cache(
    Path(__file__).parent, numba.config.CACHE_DIR, f"{numba.__version__}-{get_host_cpu_name()}"
)


def cache() -> KernelCache:
    """Where the kernels of the flight software are kept."""
    return _CACHE


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a kernel with numba, cached on disk; it makes no array.

    Its caller holds those that it works on, so references to them need not be counted, which took
    half of the time of kernels of some ten operations. Those are too short to let go of the GIL,
    which takes as long as another ten. ``fastmath`` stays off: results must not depend on how a
    compiler reorders sums.
    """
    before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(_CACHE.folder)
    try:
        dispatcher = numba.njit(
            cache=_CACHE.folder is not None,
            fastmath=False,
            error_model="numpy",
            no_cfunc_wrapper=True,  # nothing in C calls a kernel
            _nrt=False,  # numba's own switch for its runtime, undocumented
        )(function)
    finally:
        numba.config.CACHE_DIR = before
    compile_for_types(dispatcher, numba.types.unliteral)
    compile_quietly(dispatcher)
    compile_within(dispatcher, callees_without_code)
    _DISPATCHERS.append(dispatcher)
    return cast(Callable[P, R], dispatcher)


_DISPATCHERS: list[Any] = []


def compiled_so_far() -> int:
    """How many kernels there are in this process, each for the types of its arguments."""
    return sum(len(one.overloads) for one in _DISPATCHERS)


def forget_bitcode() -> None:
    """Free what only compiling needs of kernels that are loaded: 30 MB.

    numba keeps each as LLVM's bitcode beside its machine code, to link it into kernels that are
    compiled later. Call it where none is: one that calls these would raise a RuntimeError.
    """
    for dispatcher in _DISPATCHERS:
        for overload in dispatcher.overloads.values():
            overload.library._shared_module = None


def machine_code(kernel: Callable[P, R], *example: Any) -> Callable[P, R]:
    """The machine code of a kernel for arguments of the types of an example, called directly.

    Without an example those of the first call, which all later ones must equal; so it decorates.
    numba looks at the type of every number in every call, and of every entry of a record, which for
    those of a tick costs as much as the arithmetic. Here numbers become what they are in the
    example and tuples may be named or not; an array must be of the example's type: it is not
    checked. With NUMBA_DISABLE_JIT there is none, and the kernel is plain Python.
    """
    dispatcher = cast(Any, kernel)
    if not hasattr(dispatcher, "typeof_pyval"):
        return kernel

    def compile_for(arguments: tuple[Any, ...]) -> Callable[..., R]:
        return cast(Callable[..., R], dispatcher.compile(types_of(dispatcher, arguments)))

    if example:
        return compile_for(example)
    known: list[Callable[..., R]] = []

    def call(*args: Any) -> R:
        if not known:
            known.append(compile_for(args))
        return known[0](*args)

    return cast(Callable[P, R], call)


def compilable(function: Callable[P, R]) -> Callable[P, R]:
    """Let kernels compile a pure law into themselves; called from Python it stays Python.

    So every law can be read, tested and stepped through as it stands, and flies as machine
    code (docs/decisions/0017-one-compiled-call-a-tick.md).
    """
    in_kernels = register_jitable(fastmath=False, error_model="numpy", no_cfunc_wrapper=True)
    return cast(Callable[P, R], in_kernels(function))


def packed(numbers: Any) -> NDArray[Any]:
    """A frozen dataclass of numbers as an array of one record, for kernels.

    A kernel reads ``packed(tuning)[0].kp`` as a law reads ``tuning.kp``; handing it over costs
    as much as one float, however many numbers are in it. Tuples become arrays: laws pick their
    entries by index. Whole numbers and truth values become floats. Tuples of dataclasses are for
    Python alone. Kernels that run as the Python they are read the dataclass itself.
    """
    if IN_PYTHON:
        return [numbers]  # type: ignore[return-value]
    array = np.zeros(1, dtype=_layout(numbers))
    array[0] = _values(numbers)
    return array


def _layout(value: Any) -> np.dtype[Any]:
    if dataclasses.is_dataclass(value):
        inner = [(name, _layout(one)) for name, one in _fields(value)]
        return np.dtype(inner, align=True)
    return np.dtype((np.float64, np.shape(value)))


def _values(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        return tuple(_values(one) for _, one in _fields(value))
    return value


def _fields(value: Any) -> list[tuple[str, Any]]:
    named = [(field.name, getattr(value, field.name)) for field in dataclasses.fields(value)]
    return [
        (name, one)
        for name, one in named
        if not (isinstance(one, tuple) and any(map(dataclasses.is_dataclass, one)))
    ]
