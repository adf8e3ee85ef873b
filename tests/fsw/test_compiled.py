"""What records of numbers are like."""

from __future__ import annotations

import inspect
from dataclasses import dataclass

import numpy as np

from fsw import compiled
from tests.mutation import plain_compiled


@dataclass(frozen=True)
class Inner:
    enabled: bool
    gains: tuple[float, ...]


@dataclass(frozen=True)
class Outer:
    inner: Inner
    lag: float


def test_a_whole_number_or_truth_value_gives_no_other_layout() -> None:
    """By its layout machine code is told apart: it would be compiled a second time."""
    floats = compiled.packed(Outer(Inner(True, (1.5, 2.0)), 0.5))
    whole = compiled.packed(Outer(Inner(False, (1, 2)), 3))
    assert floats.dtype == whole.dtype
    assert whole[0]["lag"] == 3.0
    assert whole[0]["inner"]["gains"].tolist() == [1.0, 2.0]
    assert (floats[0]["inner"]["enabled"], whole[0]["inner"]["enabled"]) == (1.0, 0.0)


def test_what_stands_in_under_mutation_has_every_function_and_reads_alike() -> None:
    names = {name for name, one in vars(compiled).items() if inspect.isfunction(one)}
    ours = {n for n in names if getattr(compiled, n).__module__ == compiled.__name__}
    assert {name for name in ours if not name.startswith("_")} <= set(vars(plain_compiled))
    for module in (compiled, plain_compiled):
        law = module.packed(Outer(Inner(True, (1.5, 2.0)), 0.5)).view(np.recarray)[0]
        assert (law.inner.gains[1], law.lag) == (2.0, 0.5)
