"""What stands in for fsw/compiled.py under mutation: every kernel is run as the Python it is.

A mutant changes the sources, and with them every kernel would be compiled anew: half a minute a
mutant. In Python the laws are the same, but for a division by zero, which raises.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any


def compiling_is_due(what: str, directory: Path | None = None) -> bool:
    return False


def note_compiled(what: str, directory: Path | None = None) -> None:
    pass


def kernel_directory() -> Path:
    return Path("nowhere")


def forget_bitcode() -> None:
    pass


def compiled(kernel: Callable[..., Any]) -> Callable[..., Any]:
    return kernel


def compilable(function: Callable[..., Any]) -> Callable[..., Any]:
    return function


def kernel(kernel: Callable[..., Any]) -> Callable[..., Any]:
    return kernel


def machine_code(kernel: Callable[..., Any], *example: Any) -> Callable[..., Any]:
    return kernel


def of_fixed_types(kernel: Callable[..., Any]) -> Callable[..., Any]:
    return kernel


def packed(numbers: Any) -> list[Any]:
    return [numbers]
