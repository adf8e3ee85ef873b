"""Typed door to numba: every kernel of the simulator is compiled through this wrapper."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, ParamSpec, TypeVar, cast

from command_line.kernel_cache import KernelCache
from command_line.kernel_types import types_of
from command_line.kernels import Kernels
from command_line.kernels import compilable as compilable

P = ParamSpec("P")
R = TypeVar("R")

_KERNELS: Final = Kernels(Path(__file__).parent, nogil=True)
kernel = _KERNELS.compile


def cache() -> KernelCache:
    """Where the kernels of the simulator are kept."""
    return _KERNELS.cache


def machine_code(function: Callable[P, R], *example: Any) -> Callable[P, R]:
    """The machine code of a compiled function for arguments of the types of an example.

    Called directly it is spared numba's look at the types of all arguments; the caller
    must pass the right ones. The function is called once.
    """
    dispatcher = cast(Any, function)
    dispatcher(*example)
    types = types_of(dispatcher, example)
    return cast(Callable[P, R], dispatcher.overloads[types].entry_point)
