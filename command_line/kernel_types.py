"""What a kernel is compiled for: types of numbers, not the numbers themselves."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


def compile_for_types(dispatcher: Any, without_value: Callable[[Any], Any]) -> None:
    """Let numba compile a kernel once for all constants that other kernels hand to it.

    Where a kernel calls another one with a constant, the constant's type is its value, and numba
    compiles the callee for each: ``put(state, 3, v)`` and ``put(state, 6, v)`` were two kernels, a
    seventh of all. Callers take a callee into themselves, where constants are what they were.

    Args:
        dispatcher: Numba's, of the kernel.
        without_value: ``numba.types.unliteral``, which gives the type of a constant's type.
    """
    template = getattr(dispatcher, "get_call_template", None)
    if template is None:  # NUMBA_DISABLE_JIT: it is the Python function itself
        return

    def of_types(args: Any, kws: dict[str, Any]) -> Any:
        return template(
            [without_value(one) for one in args],
            {name: without_value(one) for name, one in kws.items()},
        )

    dispatcher.get_call_template = of_types
