"""Values made in every tick: replaced as the library does."""

from __future__ import annotations

import dataclasses

import pytest

from fsw.autopilot.flight.state import first_state
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.frozen import Remembered, dataclass, replace


@dataclass(frozen=True, slots=True)
class Checked:
    share: float
    name: str = ""

    def __post_init__(self) -> None:
        if not 0.0 <= self.share <= 1.0:
            raise ValueError(f"a share of {self.share}")


def test_a_value_is_replaced_as_the_library_replaces_it() -> None:
    state = first_state(AIRFRAME)
    changed = replace(state, index=7, limited="a wall")
    assert changed == dataclasses.replace(state, index=7, limited="a wall")
    assert (state.index, changed.index) == (-1, 7)
    assert changed.vehicle is state.vehicle


def test_a_value_that_checks_itself_is_checked_when_it_is_replaced() -> None:
    assert replace(Checked(0.5, "a"), share=1.0) == Checked(1.0, "a")
    with pytest.raises(ValueError, match="share"):
        replace(Checked(0.5), share=2.0)


def test_what_was_made_of_a_value_is_kept_for_it_and_for_its_equals() -> None:
    made: list[Checked] = []

    @Remembered
    def tenfold(value: Checked) -> float:
        made.append(value)
        return 10.0 * value.share

    half, whole = Checked(0.5), Checked(1.0)
    assert [tenfold(one) for one in (half, half, whole, half, Checked(0.5))] == [5, 5, 10, 5, 5]
    assert made == [half, whole]
