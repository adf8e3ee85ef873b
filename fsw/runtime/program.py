"""The flight program as the loop sees it: a first state, a pure tick and a planner."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from fsw.autopilot.ports import PlanningCycle, VehicleFacts
from fsw.autopilot.signals import TickInputs, TickOutputs
from fsw.link.events.event_log import EventLog
from fsw.link.services.mission_store import MissionStore

if TYPE_CHECKING:
    # Its table of parameters imports everything that flies; a refusal need not wait for that.
    from fsw.storage.parameter_store import ParameterStore

State = TypeVar("State")


class Answered(Protocol):
    """A tick whose command is decided."""

    @property
    def outputs(self) -> TickOutputs:
        """What the actuators get, and what goes out with it."""
        ...


Control = Callable[[State, TickInputs], Answered]
"""A tick from a state and its inputs up to its answer."""
Conclude = Callable[[Any], tuple[State, TickOutputs]]
"""The rest of that tick: the next state, and everything the tick says."""


@dataclass(frozen=True, slots=True)
class FlightProgram(Generic[State]):
    """Everything that is pure, with its stores; the loop adds time, links and logs."""

    facts: VehicleFacts
    first_state: State
    control: Control[State]
    conclude: Conclude[State]
    planner: PlanningCycle
    parameters: ParameterStore
    missions: MissionStore
    events: EventLog = field(default_factory=EventLog)
    numbers: Mapping[str, float] = field(default_factory=dict)  # of the configuration, by name
