"""The flight program as the loop sees it, and what runs its tick and catches what fails there."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final, TypeAlias

from fsw.autopilot.periods import TICK_US
from fsw.autopilot.ports import PlanningCycle, VehicleFacts
from fsw.autopilot.signals import Severity, StatusText, TickInputs, TickOutputs
from fsw.link.events import EventLog
from fsw.link.services.mission_store import MissionStore

if TYPE_CHECKING:
    # They import everything that flies; a refusal need not wait for that.
    from fsw.autopilot.flight.autopilot import Controlled
    from fsw.autopilot.flight.state import FlightState
    from fsw.storage.parameter_store import ParameterStore

MAX_FAILED_TICKS: Final = 10_000 // TICK_US  # as long as the estimate may be missing

Control: TypeAlias = "Callable[[FlightState, TickInputs], Controlled]"
"""A tick from a state and its inputs up to its answer."""
Conclude: TypeAlias = "Callable[[Controlled], tuple[FlightState, TickOutputs]]"
"""The rest of that tick: the next state, and everything the tick says."""


@dataclass(frozen=True, slots=True)
class FlightProgram:
    """Everything that is pure, with its stores; the loop adds time, links and logs."""

    facts: VehicleFacts
    first_state: FlightState
    control: Control
    conclude: Conclude
    planner: PlanningCycle
    parameters: ParameterStore
    missions: MissionStore
    events: EventLog = field(default_factory=EventLog)
    numbers: Mapping[str, float] = field(default_factory=dict)  # of the configuration, by name


@dataclass(slots=True)
class TickRunner:
    """Keeps the state between ticks, and repeats the last command if a tick fails.

    A failed tick leaves the state as it was. Repeating the last command is the safest thing known
    for a few milliseconds. A lasting error is raised and ends the process; the rotors stop when
    the actuators' time-out is over.
    """

    _control: Control
    _conclude: Conclude
    _state: FlightState  # before the first tick, and then after the last one
    on_error: Callable[[], None] = traceback.print_exc  # in the handler of a survived error
    _begun: Controlled | TickOutputs | None = None  # the outputs are of a tick that failed
    _last: TickOutputs | None = None
    _failed: int = 0  # in a row

    def __call__(self, inputs: TickInputs) -> TickOutputs:
        """Run one tick, both parts of it; raises what they raise."""
        self.control(inputs)
        return self.conclude()

    def control(self, inputs: TickInputs) -> TickOutputs:
        """Run a tick up to its answer.

        Raises:
            Exception: What the tick raised, if it is the first tick or ``MAX_FAILED_TICKS`` before
                it failed.
        """
        try:
            begun = self._control(self._state, inputs)
        except Exception as error:
            failed = self._begun = self._survived(error)
            return failed
        self._begun = begun
        return begun.outputs

    def conclude(self) -> TickOutputs:
        """Run the rest of the tick; raises as :meth:`control` does."""
        begun, self._begun = self._begun, None
        assert begun is not None
        if isinstance(begun, TickOutputs):
            return begun
        try:
            self._state, outputs = self._conclude(begun)
        except Exception as error:
            return self._survived(error)
        self._failed = 0
        self._last = outputs
        return outputs

    def _survived(self, error: Exception) -> TickOutputs:
        """The outputs of a tick that failed; to be called in the handler of its ``error``."""
        self._failed += 1
        if self._last is None or self._failed > MAX_FAILED_TICKS:
            raise error
        self.on_error()
        text = f"tick failed, {type(error).__name__}: last command repeated"
        return replace(
            self._last,
            plan_request=None,
            acks=(),
            texts=(StatusText(Severity.CRITICAL, text),),
            tuning_taken=None,
            upload_taken=None,
        )
