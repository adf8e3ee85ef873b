"""Kernels of both processes are compiled for types of numbers, not for the numbers."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numba
import numpy as np
import pytest
from numba import literal_unroll
from numba.core.registry import cpu_target

import fsw.compiled
import sitl.compiled
from command_line.kernel_types import compile_quietly

DOORS = {"fsw": fsw.compiled.kernel, "sitl": sitl.compiled.kernel}
LAWS = {"fsw": fsw.compiled.compilable, "sitl": sitl.compiled.compilable}


def put(out: Any, at: int, value: float, more: bool = False) -> None:
    out[at] = value + (1.0 if more else 0.0)


@pytest.mark.parametrize("door", DOORS)
def test_a_kernel_that_is_handed_constants_is_compiled_once_for_all_of_them(door: str) -> None:
    compile_it: Callable[..., Any] = DOORS[door]
    inner: Any = compile_it(put)

    def fill(out: Any, at: int) -> None:
        inner(out, 0, 5.0)
        inner(out, 1, 6.0)
        inner(out, at, 7.0)
        inner(out, 3, value=8.0, more=True)

    filled = np.zeros(4)
    compile_it(fill)(filled, 2)
    assert filled.tolist() == [5.0, 6.0, 7.0, 9.0]
    assert len({signature[1] for signature in inner.signatures}) == 1
    assert not any("Literal" in str(signature) for signature in inner.signatures)


def add_one(x: float) -> float:
    return x + 1.0


def add_two(x: float) -> float:
    return x + 2.0


@pytest.mark.parametrize("door", DOORS)
def test_of_a_table_of_kernels_numba_says_nothing_whatever_filters_there_are(door: str) -> None:
    compile_it: Callable[..., Any] = DOORS[door]
    table: Any = (compile_it(add_one), compile_it(add_two))

    def add_all(x: float) -> float:
        for one in literal_unroll(table):
            x = one(x)
        return x

    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        assert compile_it(add_all)(1.0) == 4.0
    assert said == []


def test_what_else_numba_warns_of_is_heard() -> None:
    def compile_it(arguments: Any, returned: Any) -> Any:
        warnings.warn("np.dot() is faster on contiguous arrays", UserWarning, stacklevel=1)
        return arguments, returned

    dispatcher = SimpleNamespace(_compiler=SimpleNamespace(compile=compile_it))
    compile_quietly(dispatcher)
    with pytest.warns(UserWarning, match="contiguous"):
        assert dispatcher._compiler.compile("arguments", "returned") == ("arguments", "returned")


def below_zero(x: float) -> float:
    if x < 0.0:
        raise ValueError("below zero")  # a kernel that makes no array cannot say how far
    return np.sqrt(x)


@pytest.mark.parametrize("door", DOORS)
def test_what_only_kernels_call_has_no_machine_code_and_does_what_it_did(
    door: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded: list[str] = []
    engine = type(cpu_target.target_context.codegen()._engine)
    add = engine.add_module

    def load(self: Any, module: Any) -> Any:
        loaded.append(module.name)
        return add(self, module)

    monkeypatch.setattr(engine, "add_module", load)
    compiled = DOORS[door]
    law, inner = LAWS[door](below_zero), compiled(add_one)

    def outer(x: float) -> float:
        return law(x) + inner(x)

    kernel: Any = compiled(outer)
    assert kernel(4.0) == 7.0
    kernel.recompile()  # it may have been on disk
    assert kernel(4.0) == 7.0
    assert {"outer", "add_one"} <= {name.split(".")[-1] for name in loaded}
    assert "below_zero" not in {name.split(".")[-1] for name in loaded}
    with pytest.raises(ValueError, match="below zero"):
        kernel(-1.0)
    assert inner(1.0) == 2.0


def test_kernels_of_others_are_compiled_as_ever() -> None:
    fsw.compiled.kernel(add_one)(1.0)
    mine: Any = numba.njit(add_two)
    assert mine(1.0) == 3.0
    (overload,) = mine.overloads.values()
    assert type(overload.library).__module__ == "numba.core.codegen"
