"""What stands in for fsw/compiled.py under mutation: every kernel is run as the Python it is.

A mutant changes the sources, and with them every kernel would be compiled anew: half a minute a
mutant. In Python the laws are the same, but for a division by zero, which raises.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from command_line.kernel_cache import KernelCache

IN_PYTHON = True


def cache() -> KernelCache:
    return KernelCache(None, 0, "")


def compiled_so_far() -> int:
    return 0


def forget_bitcode() -> None:
    pass


def compilable(function: Callable[..., Any]) -> Callable[..., Any]:
    return function


def kernel(kernel: Callable[..., Any]) -> Callable[..., Any]:
    return kernel


def machine_code(kernel: Callable[..., Any], *example: Any) -> Callable[..., Any]:
    return kernel


class _Record(list[Any]):
    """An array of one record, whose fields are those of the numbers themselves."""

    def view(self, _: Any) -> _Record:
        return self


def packed(numbers: Any) -> _Record:
    return _Record([numbers])
