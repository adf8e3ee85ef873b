"""What records of numbers are like."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from fsw import compiled


@dataclass(frozen=True)
class Inner:
    enabled: bool
    gains: tuple[float, ...]


@dataclass(frozen=True)
class Outer:
    inner: Inner
    lag: float


def test_a_whole_number_or_truth_value_gives_no_other_layout() -> None:
    """By its layout machine code is told apart, and not safely: see ``packed``."""
    floats = compiled.packed(Outer(Inner(True, (1.5, 2.0)), 0.5))
    whole = compiled.packed(Outer(Inner(False, (1, 2)), 3))
    assert floats.dtype == whole.dtype
    assert whole[0]["lag"] == 3.0
    assert whole[0]["inner"]["gains"].tolist() == [1.0, 2.0]
    assert (floats[0]["inner"]["enabled"], whole[0]["inner"]["enabled"]) == (1.0, 0.0)


def test_a_second_layout_of_a_class_is_refused() -> None:
    compiled.packed(Outer(Inner(True, (1.5, 2.0)), 0.5))
    with pytest.raises(TypeError, match="records of Outer have two layouts"):
        compiled.packed(Outer(Inner(True, (1.5, 2.0, 3.0)), 0.5))
