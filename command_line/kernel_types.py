"""What a kernel is compiled for: types of numbers, not the numbers themselves."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from typing import Any, Final

# Said of a tuple of kernels, such as the table of shapes that a kernel calls (sitl/distance.py,
# fsw/autopilot/shapes/zones.py), which numba has unrolled for years and still calls experimental.
_TUPLE_OF_KERNELS: Final = "First-class function type feature is experimental"


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


def compile_within(dispatcher: Any, context: Callable[[], AbstractContextManager[None]]) -> None:
    """Let numba compile a kernel within a ``context``, under its lock."""
    compiler = getattr(dispatcher, "_compiler", None)
    if compiler is None:  # NUMBA_DISABLE_JIT
        return
    compile_it = compiler.compile

    def within(arguments: Any, returned: Any) -> Any:
        with context():
            return compile_it(arguments, returned)

    compiler.compile = within


def compile_quietly(dispatcher: Any) -> None:
    """Let numba compile a kernel without its warning of tuples of kernels, and with all others.

    Whoever imports a package may set up warnings anew, as pytest does for each test: a filter that
    was set by an import holds for as long as that.
    """
    compile_within(dispatcher, _without_that_warning)


@contextlib.contextmanager
def _without_that_warning() -> Iterator[None]:
    # Under numba's lock, as its own filters of warnings: these are of the whole process.
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", _TUPLE_OF_KERNELS)
        yield


_OF_ARRAYS: dict[Any, Any] = {}


def types_of(dispatcher: Any, arguments: Sequence[Any]) -> tuple[Any, ...]:
    """Numba's types of the arguments of a call.

    Those of arrays are kept: for one of records numba takes milliseconds, each time, and a flight
    loop, of which every new tuning has one, is handed forty.
    """
    return tuple(_type_of(dispatcher, argument) for argument in arguments)


def _type_of(dispatcher: Any, argument: Any) -> Any:
    if type(argument).__name__ != "ndarray":  # options, declared beside this, load no NumPy
        return dispatcher.typeof_pyval(argument)
    dtype, flags = argument.dtype, argument.flags
    order = flags.c_contiguous, flags.f_contiguous
    key = dtype, dtype.isalignedstruct, argument.ndim, order, flags.aligned, flags.writeable
    if key not in _OF_ARRAYS:
        _OF_ARRAYS[key] = dispatcher.typeof_pyval(argument)
    return _OF_ARRAYS[key]
