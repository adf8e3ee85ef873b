"""A tick of a test, which is one function, as the loop takes it: in two parts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from fsw.autopilot.signals import TickInputs, TickOutputs

Tick = Callable[[Any, TickInputs], tuple[Any, TickOutputs]]


class _Begun(NamedTuple):
    outputs: TickOutputs
    result: tuple[Any, TickOutputs]


def parts_of(
    tick: Tick,
) -> tuple[Callable[[Any, TickInputs], Any], Callable[[Any], tuple[Any, TickOutputs]]]:
    """Both parts of a tick; the first one does all of it."""

    def control(state: Any, inputs: TickInputs) -> _Begun:
        result = tick(state, inputs)
        return _Begun(result[1], result)

    def conclude(begun: _Begun) -> tuple[Any, TickOutputs]:
        return begun.result

    return control, conclude
