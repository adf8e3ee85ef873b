"""The one place that decides how numerical kernels are compiled."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, ParamSpec, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

from command_line.kernel_cache import KernelCache
from command_line.kernel_types import types_of
from command_line.kernels import Kernels
from command_line.kernels import compilable as compilable

IN_PYTHON: Final = bool(numba.config.DISABLE_JIT)
"""Whether kernels are run as the Python they are, as NUMBA_DISABLE_JIT has it."""

P = ParamSpec("P")
R = TypeVar("R")

# Most are too short to let go of the GIL.
_KERNELS: Final = Kernels(Path(__file__).parent, nogil=False)
kernel = _KERNELS.compile


def cache() -> KernelCache:
    """Where the kernels of the flight software are kept."""
    return _KERNELS.cache


def compiled_so_far() -> int:
    """How many kernels there are in this process, each for the types of its arguments."""
    return sum(len(one.overloads) for one in _KERNELS.dispatchers)


def forget_bitcode() -> None:
    """Free what only compiling needs of kernels that are loaded: 30 MB.

    numba keeps each as LLVM's bitcode beside its machine code, to link it into kernels that are
    compiled later. Call it where none is: one that calls these would raise a RuntimeError.
    """
    for dispatcher in _KERNELS.dispatchers:
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
