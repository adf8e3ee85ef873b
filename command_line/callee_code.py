"""What kernels call gets no machine code of its own: a third of the time of compiling.

A caller takes what it calls into itself as LLVM's code, and only then optimises it. numba still
optimises every function by itself as well and makes machine code of it, in case Python calls it;
``compilable`` laws, and numba's own, Python never calls so.
"""

from __future__ import annotations

import contextlib
import ctypes
from collections.abc import Iterator
from typing import Any, Final

from numba.core.codegen import JITCodeLibrary, JITCPUCodegen

_OF_PYTHON: Final = "_ZN7cpython"  # how numba names what Python calls a kernel by
# By name, what numba hands to code that is not loaded: each caller that takes it in is given it.
_waiting: dict[str, Any] = {}


class _Library(JITCodeLibrary):  # type: ignore[misc]
    """The code of one function, which is loaded only where Python can call it."""

    def _is_called_by_python(self) -> bool:
        from_disk = self._object_caching_enabled and self._compiled_object is not None
        return from_disk or any(
            function.name.startswith(_OF_PYTHON) and not function.is_declaration
            for function in self._final_module.functions
        )

    def _optimize_final_module(self) -> None:
        if self._is_called_by_python():
            super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        if self._is_called_by_python():
            super()._finalize_final_module()
            for variable in self._final_module.global_variables:
                if variable.name in _waiting:
                    _set_environment(self._codegen, variable.name, _waiting[variable.name])
        else:
            self._finalize_dynamic_globals()
            self._verify_declare_only_symbols()
            self._finalized = True


def _set_environment(codegen: Any, name: str, environment: Any) -> None:
    """As numba's own, which takes for granted that the code is loaded."""
    address = codegen._engine.get_global_value_address(name)
    if address:
        ctypes.c_void_p.from_address(address).value = id(environment)
    else:
        _waiting[name] = environment


@contextlib.contextmanager
def callees_without_code() -> Iterator[None]:
    """While numba compiles a kernel: give no machine code to what only kernels call."""
    before = JITCPUCodegen._library_class, JITCPUCodegen.set_env
    JITCPUCodegen._library_class, JITCPUCodegen.set_env = _Library, _set_environment
    try:
        yield
    finally:
        JITCPUCodegen._library_class, JITCPUCodegen.set_env = before
