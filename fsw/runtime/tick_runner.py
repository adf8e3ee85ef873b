"""Runs the pure tick: the only place where an unexpected error in it is caught."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from dataclasses import replace
from typing import Final, Generic

from fsw.runtime.program import State
from fsw.signals import Severity, StatusText, TickInputs, TickOutputs

MAX_FAILED_TICKS: Final = 5  # 10 ms, as long as the estimate may be missing


class TickRunner(Generic[State]):
    """Keeps the state between ticks, and repeats the last command if a tick fails.

    A failed tick leaves the state as it was. Repeating the last command is the safest thing known
    for a few milliseconds. A lasting error is raised and ends the process; the rotors stop when
    the actuators' time-out is over.
    """

    def __init__(
        self,
        tick: Callable[[State, TickInputs], tuple[State, TickOutputs]],
        first_state: State,
        on_error: Callable[[], None] = traceback.print_exc,
    ) -> None:
        """Start before the first tick; a survived error calls ``on_error`` in its handler."""
        self._tick = tick
        self._on_error = on_error
        self._state = first_state
        self._last: TickOutputs | None = None
        self._failed = 0  # in a row

    def __call__(self, inputs: TickInputs) -> TickOutputs:
        """Run one tick.

        Raises:
            Exception: What the tick raised, if it is the first tick or ``MAX_FAILED_TICKS`` before
                it failed.
        """
        try:
            self._state, outputs = self._tick(self._state, inputs)
        except Exception as error:
            self._failed += 1
            if self._last is None or self._failed > MAX_FAILED_TICKS:
                raise
            self._on_error()
            text = f"tick failed, {type(error).__name__}: last command repeated"
            return replace(
                self._last,
                plan_request=None,
                acks=(),
                texts=(StatusText(Severity.CRITICAL, text),),
                tuning_taken=None,
            )
        self._failed = 0
        self._last = outputs
        return outputs
