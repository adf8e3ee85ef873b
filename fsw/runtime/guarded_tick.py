"""The one place where an unexpected error in the tick is caught."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from dataclasses import replace
from typing import Final, Generic

from fsw.runtime.program import State
from fsw.signals import Severity, StatusText, TickInputs, TickOutputs

PATIENCE_TICKS: Final = 5  # 10 ms, as long as the estimate may be missing


class GuardedTick(Generic[State]):
    """Keeps the state between ticks, and flies through a tick that fails.

    A failed tick leaves the state as it was and repeats the last actuator command: for a few
    milliseconds that is the safest thing known. An error that stays is not survived by
    ignoring it; it is raised and ends the process, with the rotors' controls timing out.
    """

    def __init__(
        self,
        tick: Callable[[State, TickInputs], tuple[State, TickOutputs]],
        first_state: State,
        tell: Callable[[], None] = traceback.print_exc,
    ) -> None:
        """Start at the first tick.

        Args:
            tick: May fail.
            first_state: What it starts from.
            tell: Called where it has failed, for whoever will look for the reason.
        """
        self._tick = tick
        self._tell = tell
        self._state = first_state
        self._last: TickOutputs | None = None
        self._failed = 0

    def __call__(self, inputs: TickInputs) -> TickOutputs:
        """One tick.

        Raises:
            Exception: whatever the tick raised, if it is the first or has failed too often in a
                row.
        """
        try:
            self._state, outputs = self._tick(self._state, inputs)
        except Exception as error:
            self._failed += 1
            if self._last is None or self._failed > PATIENCE_TICKS:
                raise
            self._tell()
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
